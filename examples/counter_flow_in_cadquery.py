"""A counter-flow heat exchanger in CadQuery: wall, both fluids and headers, as an assembly and for a solver.

Fluid a runs through the core from end to end. Fluid b comes in by the stub at the far end and leaves by the other one,
so that it runs against a. Each fluid has openings of its own: there the channels of the other end at a plug.
"""

import cadquery as cq

from gyroid_cad import fill

LENGTH, SIDE, SKIN = 20.0, 9.0, 0.8
STUBS = (-6.5, 6.5)

core = cq.Workplane().box(LENGTH, SIDE, SIDE)
for x in STUBS:
    core = core.union(cq.Workplane().box(6, 3, 7).translate((x, SIDE / 2 + 1.5, 0)))
mouths = [("b", (x, SIDE / 2 + 3, 0)) for x in STUBS]
ports = ["a:<X", "a:>X", *mouths]
made = fill(core, 8, 0.7, kind="bodies", compact=0.01, skin=SKIN, plug=1.2, openings=ports)

# What leads fluid a to its mouths is ordinary CAD: boxes that are open towards the core, with a hole for a hose.
header = cq.Workplane().box(5, SIDE, SIDE).faces("<X").shell(-SKIN).faces(">X").workplane().hole(4)
place = cq.Location((LENGTH + 5) / 2, 0, 0)
turn = cq.Location((0, 0, 0), (0, 0, 1), 180)

exchanger = cq.Assembly(name="exchanger")
colours = {"wall": "gold", "fluid-a": "firebrick", "fluid-b": "royalblue"}
for name, solid in made.named_solids().items():
    exchanger.add(cq.Shape.cast(solid), name=name, color=cq.Color(colours[name]))
exchanger.add(header, name="outlet a", loc=place, color=cq.Color("gray"))
exchanger.add(header, name="inlet a", loc=turn * place, color=cq.Color("gray"))
exchanger.export("counter_flow.step")
# A region for each name of fluid a's faces, for OpenFOAM's meshers.
made.write("fluid_a.stl", regions="fluid-a", deviation=0.05)

for fluid in made.report.fluids:
    called = sorted({name for name in made.face_names[fluid.name] if ":" in name})
    print(f"{fluid.name}: {fluid}, mouths {called}")
