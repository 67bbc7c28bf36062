"""A part filled with a lattice."""
