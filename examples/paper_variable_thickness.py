"""The paper's Fig. 16: 3 x 3 x 1 cubic cells whose wall grows along x and y. A unit is 5 mm."""

from gyroid_cad import Lattice

lattice = Lattice.paper(cells=(3, 3, 1), thickness_factor="0.08 + 0.05*x + 0.02*y", bc_length=1, scale=5.0)
lattice.write("paper_variable_thickness.step", "paper_variable_thickness.stl", deviation=0.1)

report = lattice.report()
low, high = lattice.bounding_box()
size = " x ".join(f"{b - a:.2f}" for a, b in zip(low, high, strict=True))
print(f"size {size} mm, wall {report.min_thickness:.3f} to {report.max_thickness:.3f} mm")
print(f"{report.control_points} control points a side, {report.max_deviation:.1e} mm from the exact faces at most")
print(f"volume {report.volume:.4f} mm3, exact {report.volume_exact:.4f} mm3")
