"""Tetrahedra of bodies that share faces: even triangles on the faces, then the volume between them."""
