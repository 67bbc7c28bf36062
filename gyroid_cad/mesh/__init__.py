"""Meshes and volumes straight from the wall's control nets: no kernel is asked."""
