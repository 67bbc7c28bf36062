"""Bone, as in the paper's Fig. 1: spongy about the middle, dense towards the outside, without a step between."""

from gyroid_cad import Lattice
from gyroid_cad.fields import distance_from_axis

from_axis = distance_from_axis((15, 15, 0), (0, 0, 1))
density = 0.12 + 0.68 / (1 + 2 ** (12 - from_axis))

lattice = Lattice(cells=(3, 3, 2), cell_size=10, density=density)
lattice.write("bone_gradient.step")

report = lattice.report()
print(
    f"density {density(15, 15, 0):.2f} at the axis, {density(0, 15, 0):.2f} at the sides, {report.density:.3f} in all"
)
print(f"wall {report.min_thickness:.3f} to {report.max_thickness:.3f} mm, volume {report.volume:.3f} mm3")
