"""A build123d script: a ball of gyroid, by intersecting a lattice with a sphere."""

from build123d import BuildPart, Mode, Sphere, export_step

from gyroid_cad.bd_objects import Gyroid

with BuildPart() as ball:
    Gyroid(cells=(2, 2, 2), cell_size=10, thickness=0.8)
    Sphere(7, mode=Mode.INTERSECT)

assert ball.part is not None
export_step(ball.part, "ball.step")
print(f"ball {ball.part.volume:.1f} mm3, {len(ball.part.faces())} faces")
