"""Structured hexahedra and quadrilaterals, their quality and files."""
