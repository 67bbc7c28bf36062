"""Render the pictures, off-screen through VTK, which CadQuery brings.

Run from the repository's root: ``python images/render.py [name ...]``, all of them if no name is given. Patches are
drawn with their outlines: each is one B-spline face of the solid. Where two lattices are shown they have one scale.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import vtk
from numpy.typing import NDArray
from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy

from gyroid_cad import Lattice
from gyroid_cad.fields import distance_from_axis
from gyroid_cad.maps import Cylinder
from gyroid_cad.nurbs.surface import NurbsSurface
from gyroid_cad.wall.offset import SIDES, Wall

FOLDER = Path(__file__).parent
WALL_COLOUR, RIM_COLOUR, LINE_COLOUR = (0.87, 0.68, 0.32), (0.97, 0.88, 0.66), (0.18, 0.16, 0.13)
# Points along each side of a face.
_FINENESS = 13
# Between two lattices, in parts of the first one's width, and round them, in parts of the picture's.
_GAP, _MARGIN = 0.08, 0.015
# PNG files of colours in so coarse steps are half as large.
_COLOUR_STEP = 6

Floats = NDArray[np.float64]
Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Picture:
    """What is drawn, and from where.

    Attributes
    ----------
    lattices : tuple of Lattice
        From left to right.
    size : tuple of int
        In pixels.
    camera : tuple of float
        Direction from the lattices to the viewer.
    zoom : float, optional
        Seen from close by, so much larger than would certainly fit; if left out, from afar, filling the picture.
    line_width : float
        In pixels.
    rim_colour : tuple of float
        Red, green and blue, of the faces through the wall where the lattice ends.
    """

    lattices: tuple[Lattice, ...]
    size: tuple[int, int]
    camera: Vector
    zoom: float | None = None
    line_width: float = 1.0
    rim_colour: Vector = RIM_COLOUR

    @property
    def axes(self) -> Floats:
        """Unit vectors to the picture's right, up it and to the viewer, as rows."""
        towards = np.array(self.camera) / np.linalg.norm(self.camera)
        right = np.cross((0, 0, 1), towards)
        right /= np.linalg.norm(right)
        return np.stack([right, np.cross(towards, right), towards])


def gyroid_2x2x2() -> Picture:
    """Eight cells, all alike."""
    lattice = Lattice(cells=(2, 2, 2), cell_size=10, thickness=0.8)
    return Picture((lattice,), (1100, 900), (3, -4, 2.4), 1.25, 1.6, WALL_COLOUR)


def specimen_variable_thickness() -> Picture:
    """The paper's Fig. 16."""
    return _specimen((3, 3, 1), "0.08 + 0.05*x + 0.02*y", 1.0, (1380, 560))


def specimen_variable_cell_length() -> Picture:
    """The paper's Fig. 17."""
    return _specimen((3, 3, 1), 0.08, "1 + 0.3*x + 0.08*y", (1400, 600))


def specimen_variable_both() -> Picture:
    """The paper's Fig. 18."""
    return _specimen((3, 3, 2), "0.08 + 0.05*x + 0.02*y", "1 + 0.05*x + 0.08*y", (1260, 630))


def bone_gradient() -> Picture:
    """As ``examples/bone_gradient.py`` builds it."""
    density = 0.12 + 0.68 / (1 + 2 ** (12 - distance_from_axis((15, 15, 0), (0, 0, 1))))
    return Picture((Lattice(cells=(3, 3, 2), cell_size=10, density=density),), (900, 850), (0.5, -1.5, 3.6))


def closed_cylinder() -> Picture:
    """As ``examples/closed_cylinder.py`` builds it."""
    lattice = Lattice(cells=(12, 2, 1), cell_size=10, thickness=0.8, map=Cylinder(radius=20, angle=360))
    return Picture((lattice,), (1000, 750), (0, -3, 2.7), 1.5)


def three_surfaces() -> Picture:
    """Gyroid, diamond and primitive surface: as many cells, of one size and density."""
    lattices = [Lattice((2, 2, 2), 10, density=0.25, surface=name) for name in ("gyroid", "diamond", "primitive")]
    return Picture(tuple(lattices), (1500, 560), (3, -4, 2.4))


def _specimen(
    cells: tuple[int, int, int], thickness_factor: float | str, bc_length: float | str, size: tuple[int, int]
) -> Picture:
    """A specimen of the paper to the right of the lattice whose wall and cells do not vary."""
    plain = Lattice.paper(cells, 0.08, scale=5.0)
    return Picture((plain, Lattice.paper(cells, thickness_factor, bc_length, scale=5.0)), size, (1.2, -3, 2.6))


PICTURES: tuple[Callable[[], Picture], ...] = (
    gyroid_2x2x2,
    specimen_variable_thickness,
    specimen_variable_cell_length,
    specimen_variable_both,
    bone_gradient,
    closed_cylinder,
    three_surfaces,
)


def main(names: Sequence[str] = ()) -> list[Path]:
    """Render pictures, and write each under its name.

    Parameters
    ----------
    names : sequence of str
        All if left out.

    Returns
    -------
    list of Path
    """
    by_name = {make.__name__: make for make in PICTURES}
    return [render(by_name[name](), FOLDER / f"{name}.png") for name in names or by_name]


def render(picture: Picture, target: Path) -> Path:
    """Draw a picture and write it as PNG.

    Parameters
    ----------
    picture : Picture
    target : Path

    Returns
    -------
    Path
    """
    renderer = vtk.vtkRenderer()
    renderer.SetBackground(1, 1, 1)
    seen = np.empty((0, 3))
    for lattice in picture.lattices:
        wall = lattice.wall()
        faces, rims = _sampled(_faces(wall)), _sampled(_rims(wall))
        points = np.concatenate([faces.points, rims.points]).reshape(-1, 3) @ picture.axes.T
        # Beside the one before, and on the same ground.
        beside = seen[:, 0].max() + _GAP * np.ptp(seen[:, 0]) - points[:, 0].min() if len(seen) else 0.0
        seen = np.concatenate([seen, points + np.array([beside, 0, 0])])
        for actor in (
            surface_actor(faces, WALL_COLOUR),
            surface_actor(rims, picture.rim_colour),
            *(outline_actor(grids, picture.line_width) for grids in (faces, rims)),
        ):
            actor.SetPosition(*(beside * picture.axes[0]).tolist())
            renderer.AddActor(actor)
    _place_camera(renderer, picture, seen)
    write_picture(renderer, picture.size, target)
    return target


@dataclass(frozen=True, slots=True)
class Grids:
    """Points and unit normals of faces on grids, shape (faces, m, m, 3) each."""

    points: Floats
    normals: Floats


def _faces(wall: Wall) -> Iterator[tuple[NurbsSurface, Floats]]:
    """The two faces of every patch, and how far each is shifted."""
    for net, shift in zip(wall.patch_net.tolist(), wall.shifts[wall.patch_shift], strict=True):
        for side in SIDES:
            yield wall.face(net, side), shift


def _rims(wall: Wall) -> Iterator[tuple[NurbsSurface, Floats]]:
    """The faces through the wall where the lattice ends, and how far each is shifted."""
    for patch, edge in np.argwhere(wall.complex.free[wall.complex.patch_edges]).tolist():
        yield wall.side_wall(int(wall.patch_net[patch]), edge), wall.shifts[wall.patch_shift[patch]]


def _sampled(faces: Iterator[tuple[NurbsSurface, Floats]]) -> Grids:
    points, normals = [], []
    for surface, shift in faces:
        along = (np.linspace(knots[0], knots[-1], _FINENESS) for knots in (surface.knots_u, surface.knots_v))
        u, v = (grid.ravel() for grid in np.meshgrid(*along, indexing="ij"))
        derivatives = surface.derivatives(u, v)
        normal = np.cross(derivatives[1, 0], derivatives[0, 1])
        points.append(derivatives[0, 0] + shift)
        normals.append(normal / np.linalg.norm(normal, axis=1, keepdims=True))
    shape = (-1, _FINENESS, _FINENESS, 3)
    return Grids(np.reshape(points, shape), np.reshape(normals, shape))


def surface_actor(grids: Grids, colour: Vector) -> vtk.vtkActor:
    index = np.arange(grids.points[..., 0].size).reshape(grids.points.shape[:3])
    squares = np.stack([index[:, :-1, :-1], index[:, 1:, :-1], index[:, 1:, 1:], index[:, :-1, 1:]], axis=-1)
    mesh = _poly_data(grids.points)
    mesh.SetPolys(_cells(squares.reshape(-1, 4)))
    mesh.GetPointData().SetNormals(numpy_to_vtk(grids.normals.reshape(-1, 3), deep=True))
    actor = _actor(mesh)
    actor.GetProperty().SetColor(*colour)
    actor.GetProperty().SetSpecular(0.25)
    actor.GetProperty().SetSpecularPower(25)
    return actor


def outline_actor(grids: Grids, width: float) -> vtk.vtkActor:
    index = np.arange(grids.points[..., 0].size).reshape(grids.points.shape[:3])
    sides = np.concatenate([index[:, 0], index[:, -1], index[:, :, 0], index[:, :, -1]])
    outlines = _poly_data(grids.points)
    outlines.SetLines(_cells(sides))
    actor = _actor(outlines)
    actor.GetProperty().SetColor(*LINE_COLOUR)
    actor.GetProperty().SetLineWidth(width)
    actor.GetProperty().LightingOff()
    return actor


def _poly_data(points: Floats) -> vtk.vtkPolyData:
    held = vtk.vtkPoints()
    held.SetData(numpy_to_vtk(points.reshape(-1, 3), deep=True))
    data = vtk.vtkPolyData()
    data.SetPoints(held)
    return data


def _cells(indices: NDArray[np.int64]) -> vtk.vtkCellArray:
    cells = vtk.vtkCellArray()
    cells.SetData(indices.shape[1], numpy_to_vtkIdTypeArray(np.ascontiguousarray(indices).ravel(), deep=True))
    return cells


def _actor(data: vtk.vtkPolyData) -> vtk.vtkActor:
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputData(data)
    mapper.SetResolveCoincidentTopologyToPolygonOffset()
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    return actor


def _place_camera(renderer: vtk.vtkRenderer, picture: Picture, seen: Floats) -> None:
    camera = renderer.GetActiveCamera()
    camera.SetViewUp(0, 0, 1)
    camera.SetPosition(*picture.camera)
    camera.SetFocalPoint(0, 0, 0)
    renderer.ResetCamera()
    if picture.zoom is not None:
        camera.Zoom(picture.zoom)
        return
    low, high = seen.min(axis=0), seen.max(axis=0)
    width, height, depth = high - low
    focus = (low + high) / 2 @ picture.axes
    camera.SetFocalPoint(*focus.tolist())
    camera.SetPosition(*(focus + depth * picture.axes[2]).tolist())
    camera.ParallelProjectionOn()
    across, down = picture.size
    camera.SetParallelScale(max(height, width * down / across) / 2 * (1 + 2 * _MARGIN))
    renderer.ResetCameraClippingRange()


def write_picture(renderer: vtk.vtkRenderer, size: tuple[int, int], target: Path) -> None:
    """Draw off-screen and write as PNG, in few colours."""
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(True)
    window.SetMultiSamples(8)
    window.SetSize(*size)
    window.AddRenderer(renderer)
    window.Render()
    grab = vtk.vtkWindowToImageFilter()
    grab.SetInput(window)
    grab.ReadFrontBufferOff()
    grab.Update()
    image = grab.GetOutput()
    colours = vtk_to_numpy(image.GetPointData().GetScalars())
    colours[:] = np.where(colours > 255 - _COLOUR_STEP, 255, colours // _COLOUR_STEP * _COLOUR_STEP)
    writer = vtk.vtkPNGWriter()
    writer.SetFileName(str(target))
    writer.SetCompressionLevel(9)
    writer.SetInputData(image)
    writer.Write()


if __name__ == "__main__":
    print(*main(sys.argv[1:]), sep="\n")
