"""B-splines: curves, surfaces and volumes, their evaluation, quadrature and root finding."""

from gyroid_cad.former import former_names, moved_to

# The module of this name had them before it became a room.
__getattr__ = former_names(__name__, moved_to(["gyroid_cad.nurbs.surface"]))
