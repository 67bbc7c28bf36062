"""A part filled with a lattice: its regions, its skin, its report."""
