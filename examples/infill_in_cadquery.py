"""A CadQuery script: two lattices on a base plate, and the space they leave in a block."""

import cadquery as cq

import gyroid_cad.cq_plugin  # noqa: F401  (adds Workplane.gyroid)

plate = cq.Workplane().box(40, 20, 2)
bumper = (
    plate.faces(">Z")
    .workplane(offset=-1)
    .pushPoints([(-10, 0), (10, 0)])
    .gyroid(cells=(1, 1, 1), cell_size=10, thickness=0.8, centered=(True, True, False))
)
network = cq.Workplane().box(8, 8, 8).gyroid(cells=(1, 1, 1), cell_size=10, thickness=0.8, combine="cut")

cq.exporters.export(bumper, "bumper.step")
print(f"bumper {bumper.val().Volume():.1f} mm3, network {network.val().Volume():.1f} mm3")
