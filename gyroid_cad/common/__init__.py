"""Tools that know nothing of lattices: arrays, checks, a cache, files and their formats, progress."""
