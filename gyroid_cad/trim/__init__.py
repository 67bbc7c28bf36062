"""Crossings of patches with other surfaces, and the trimmed faces and caps between them."""
