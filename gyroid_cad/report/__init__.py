"""One page, or JSON, of a lattice or a file."""
