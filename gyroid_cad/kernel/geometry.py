"""The curves and surfaces of a wall, each made once and shared by all patches that differ by a translation."""

from __future__ import annotations

from OCP.Geom import Geom_BSplineCurve, Geom_BSplineSurface
from OCP.Geom2d import Geom2d_Line
from OCP.gp import gp_Dir2d, gp_Pnt2d, gp_Trsf, gp_Vec
from OCP.TopLoc import TopLoc_Location

from gyroid_cad.kernel.surfaces import kernel_curve, kernel_surface
from gyroid_cad.wall.offset import Wall

__all__ = ["TOLERANCE", "WallGeometry", "parameter_line"]

# The kernel's own smallest distance (Precision::Confusion): shared edges agree to rounding.
TOLERANCE = 1e-7


class WallGeometry:
    """Curves and surfaces by patch, in the patch's own place; and the location that carries them to where they belong.

    Parameters
    ----------
    wall : Wall
    """

    def __init__(self, wall: Wall) -> None:
        self.wall = wall
        # One location object a translation: the kernel compares locations by how they were made.
        self._locations = [_translation(shift) for shift in wall.shifts.tolist()]
        self._patch_net, self._patch_shift = wall.patch_net.tolist(), wall.patch_shift.tolist()
        self._forward = wall.complex.edge_forward.tolist()
        self._faces: dict[tuple[int, int], Geom_BSplineSurface] = {}
        self._side_walls: dict[tuple[int, int], Geom_BSplineSurface] = {}
        self._rims: dict[tuple[int, int, int, bool], Geom_BSplineCurve] = {}
        self._borders = _border_lines()

    def location(self, patch: int) -> TopLoc_Location:
        return self._locations[self._patch_shift[patch]]

    def face(self, patch: int, side: int) -> Geom_BSplineSurface:
        """A face of the wall."""
        key = (self._patch_net[patch], side)
        if key not in self._faces:
            self._faces[key] = kernel_surface(self.wall.face(*key))
        return self._faces[key]

    def side_wall(self, patch: int, k: int) -> Geom_BSplineSurface:
        """The ruled surface through the wall along border k."""
        key = (self._patch_net[patch], k)
        if key not in self._side_walls:
            self._side_walls[key] = kernel_surface(self.wall.side_wall(*key))
        return self._side_walls[key]

    def rim(self, patch: int, k: int, side: int) -> Geom_BSplineCurve:
        """Border curve k of a face, run the way the complex's edge runs, on [-1, 1]."""
        forward = self._forward[patch][k]
        key = (self._patch_net[patch], k, side, forward)
        if key not in self._rims:
            curve = self.wall.face(self._patch_net[patch], side).edge(k)
            self._rims[key] = kernel_curve(curve if forward else curve.reversed())
        return self._rims[key]

    def border(self, patch: int, k: int) -> Geom2d_Line:
        """Border k in the parameter plane, run the way the complex's edge runs."""
        return self._borders[k][self._forward[patch][k]]


def parameter_line(u: float, v: float, du: float, dv: float) -> Geom2d_Line:
    """The line in the parameter plane through (u, v) towards (du, dv)."""
    return Geom2d_Line(gp_Pnt2d(u, v), gp_Dir2d(du, dv))


def _border_lines() -> list[tuple[Geom2d_Line, Geom2d_Line]]:
    """The square's four sides in the parameter plane, for edges that run against and along the patch."""
    starts = ((0, -1), (1, 0), (0, 1), (-1, 0))
    directions = ((1, 0), (0, 1), (-1, 0), (0, -1))
    return [
        (parameter_line(*start, -du, -dv), parameter_line(*start, du, dv))
        for start, (du, dv) in zip(starts, directions, strict=True)
    ]


def _translation(shift: list[float]) -> TopLoc_Location:
    transformation = gp_Trsf()
    transformation.SetTranslation(gp_Vec(*shift))
    return TopLoc_Location(transformation)
