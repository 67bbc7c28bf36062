"""One cubic cell, 30 % dense, as STEP for CAD and STL for a printer."""

from gyroid_cad import Lattice

lattice = Lattice(cells=(1, 1, 1), cell_size=10, density=0.3)
lattice.write("unit_cell.step", "unit_cell.stl", deviation=0.05)

report = lattice.report()
print(f"wall {report.thickness:.3f} mm, {report.faces} faces, {report.volume:.3f} mm3")
