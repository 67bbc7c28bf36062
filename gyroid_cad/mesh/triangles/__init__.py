"""Triangles of walls and files of triangles."""
