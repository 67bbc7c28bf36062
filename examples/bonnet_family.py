"""From the diamond surface through the gyroid to the primitive one: a patch bends, lengths and normals stay."""

import numpy as np

from gyroid_cad.surface.weierstrass import (
    GYROID,
    Family,
    corner_chart_omega,
    corner_chart_points,
    corner_chart_tangents,
    normals,
)

# Places on the patch, by a chart of the Gauss map: all members of the family have the same normal there.
places = np.array([0.2 + 0.1j, 0.5 - 0.2j, 0.8 + 0.05j])
upright = normals(corner_chart_omega(places))
reference = np.linalg.norm(corner_chart_tangents(places), axis=1)

for angle in (0.0, 20.0, float(np.degrees(GYROID.bonnet_angle)), 65.0, 90.0):
    family = Family("associate", np.radians(angle), GYROID.scale)
    tangents = corner_chart_tangents(places, family)
    stretched = np.abs(np.linalg.norm(tangents, axis=1) / reference - 1).max()
    tilted = np.abs(np.einsum("pi,pi->p", tangents, upright)).max()
    x, y, z = corner_chart_points(np.array([0j]), family)[0]
    print(
        f"{angle:5.2f} degrees: a corner at ({x:6.3f}, {y:6.3f}, {z:6.3f}) of a bounding cell, "
        f"lengths changed by {stretched:.0e}, tangents off the planes across the normals by {tilted:.0e}"
    )
