"""The minimal surfaces: exact points, symmetry, families, and the fit of one patch."""
