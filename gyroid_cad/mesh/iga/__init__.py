"""Trivariate NURBS patches for isogeometric analysis, and their files."""
