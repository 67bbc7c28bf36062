"""The paper's lattice of Figs. 11 and 13: 4 x 3 x 2 cubic cells, wall 0.08 of a bounding cell."""

from gyroid_cad import Lattice

BOUNDING_CELL = 5.0

lattice = Lattice(cells=(4, 3, 2), cell_size=2 * BOUNDING_CELL, thickness=0.08 * BOUNDING_CELL)
lattice.write("paper_4x3x2.step")

report = lattice.report()
print(f"{report.patches} patches, {report.faces} faces, {report.non_manifold_edges} non-manifold edges")
print(f"volume {report.volume:.6f} mm3, exact {report.volume_exact:.6f} mm3")
