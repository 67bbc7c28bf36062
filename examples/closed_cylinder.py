"""Twelve cells round a cylinder, the last joined to the first: no seam is left in the solid."""

from gyroid_cad import Lattice
from gyroid_cad.maps import Cylinder

lattice = Lattice(cells=(12, 2, 1), cell_size=10, thickness=0.8, map=Cylinder(radius=20, angle=360))
lattice.write("closed_cylinder.step")

report = lattice.report()
print(f"closed: {report.closed}, solids: {report.solids}, faces: {report.faces}")
print(f"{report.boundary_edges} boundary edges of patches, all at the two ends, inside and outside")
print(f"volume {report.volume:.3f} mm3, exact {report.volume_exact:.3f} mm3")
