"""A counter-flow heat exchanger in build123d: the same as in CadQuery, by parts and their children."""

import build123d as bd

from gyroid_cad.bd_objects import GyroidFill

LENGTH, SIDE, SKIN = 20.0, 9.0, 0.8
STUBS = (-6.5, 6.5)

core = bd.Box(LENGTH, SIDE, SIDE)
for x in STUBS:
    core += bd.Pos(x, SIDE / 2 + 1.5, 0) * bd.Box(6, 3, 7)
mouths = [("b", (x, SIDE / 2 + 3, 0)) for x in STUBS]
ports = ["a:<X", "a:>X", *mouths]
made = GyroidFill(core, 8, 0.7, kind="bodies", compact=0.01, skin=SKIN, plug=1.2, openings=ports)

box = bd.Box(5, SIDE, SIDE)
header = bd.offset(box, -SKIN, openings=box.faces().sort_by(bd.Axis.X)[0]) - bd.Rot(0, 90, 0) * bd.Cylinder(2, 9)
out = bd.Pos((LENGTH + 5) / 2, 0, 0)
outlet, inlet = out * header, bd.Rot(0, 0, 180) * out * header
outlet.label, inlet.label = "outlet a", "inlet a"

exchanger = bd.Compound(label="exchanger", children=[*made.children, inlet, outlet])
bd.export_step(exchanger, "counter_flow.step")

print(made.report)
print(f"headers {inlet.volume + outlet.volume:.1f} mm3")
