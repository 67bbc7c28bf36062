"""A lattice made: its solid, triangles, assembly and meshes, with their reports."""
