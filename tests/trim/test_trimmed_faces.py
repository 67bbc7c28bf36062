"""What a box leaves of a face."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import Graph
from hypothesis import given, reject, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gyroid_cad.errors import KernelError
from gyroid_cad.trim.edge_crossings import PLANES, FacesToCut
from gyroid_cad.trim.loops import signed_area
from gyroid_cad.trim.trimmed_faces import BOX, CutFace, cut_faces

Floats = NDArray[np.float64]

SIZE = 1.0
FINE = (np.arange(400) + 0.5) / 200 - 1


def wavy(x: Floats, y: Floats) -> Floats:
    return 0.35 * x * y + 0.25 * x * x - 0.2 * y


def cut(faces: FacesToCut) -> CutFace:
    return cut_faces(faces, SIZE)[0]


def sums(face: CutFace) -> Floats:
    """Flux, area vector and area of all that is left."""
    parts = [piece.integrals[:5] for piece in face.pieces]
    return np.sum(parts, axis=0) if parts else np.zeros(5)


def by_counting(levels: dict[int, float]) -> Floats:
    """The same of the wavy face, by the midpoint rule on a fine grid."""
    x, y = FINE[:, np.newaxis], FINE[np.newaxis]
    z = wavy(x, y)
    inside = np.ones_like(z, dtype=bool)
    for plane, level in levels.items():
        axis, sign = PLANES[plane]
        inside &= sign * ((x + 0 * y, y + 0 * x, z)[axis] - level) > 0
    normal = np.stack(np.broadcast_arrays(-(0.35 * y + 0.5 * x), -(0.35 * x - 0.2), np.ones_like(z)), axis=-1)
    flux = (x * normal[..., 0] + y * normal[..., 1] + z) / 3
    each = [flux, *np.moveaxis(normal, -1, 0), np.linalg.norm(normal, axis=-1)]
    return np.array([np.sum(some[inside]) for some in each]) * (FINE[1] - FINE[0]) ** 2


boxes = st.fixed_dictionaries(
    {},
    optional={
        plane: st.floats(-0.95, 0.1) if sign > 0 else st.floats(0.15, 0.95)
        for plane, (axis, sign) in enumerate(PLANES)
        if axis < 2
    }
    | {4: st.floats(-0.4, -0.02), 5: st.floats(0.02, 0.5)},
)


@settings(max_examples=20)
@given(boxes, st.sampled_from([0.0, 0.3]))
def test_what_is_left_has_the_measures_of_the_places_in_the_box(
    graph: Graph, levels: dict[int, float], lean: float
) -> None:
    try:
        face = cut(graph(wavy, levels, lean))
    except KernelError:
        # A face that touches a plane; were it the rule, hypothesis would say so.
        reject()
    # Each place on the border is in doubt: as many as run round the square and the box.
    np.testing.assert_allclose(sums(face), by_counting(levels), atol=0.02)


@settings(max_examples=12)
@given(st.integers(0, 5), st.floats(-0.6, 0.6), boxes, st.sampled_from([0.0, 0.3]))
def test_a_plane_parts_what_is_left_in_two_that_make_it_up_again(
    graph: Graph, plane: int, level: float, levels: dict[int, float], lean: float
) -> None:
    one, other = (key for key, (axis, _) in enumerate(PLANES) if axis == plane // 2)
    rest = {key: value for key, value in levels.items() if key not in (one, other)}
    try:
        all_of_it, above, below = (
            sums(cut(graph(wavy, {**rest, **more}, lean))) for more in ({}, {one: level}, {other: level})
        )
    except KernelError:
        reject()
    np.testing.assert_allclose(above + below, all_of_it, atol=2e-6)


@settings(max_examples=12)
@given(boxes)
def test_loops_are_closed_run_round_what_is_left_and_arcs_meet_in_space(graph: Graph, levels: dict[int, float]) -> None:
    faces = graph(wavy, levels)
    try:
        face = cut(faces)
    except KernelError:
        reject()
    for piece in face.pieces:
        for number, loop in enumerate(piece.loops):
            assert [arc.end for arc in loop] == [arc.start for arc in (*loop[1:], loop[0])]
            seen = [face.outlines[arc] for arc in loop if arc.curve >= 0]
            if len(seen) == len(loop):
                assert (signed_area(np.concatenate(seen)[:, :2]) > 0) == (number == 0)
            for arc in loop:
                for node, end in ((arc.start, 0), (arc.end, -1)):
                    if arc.curve >= 0:
                        assert face.points[node] == pytest.approx(face.outlines[arc][end], abs=5e-6)
    for node, planes in face.edges.items():
        for plane in planes:
            assert node[0] == BOX
            assert face.points[node][PLANES[plane][0]] == faces.levels[0, plane]


def test_a_box_within_one_face_leaves_a_patch_without_any_of_the_squares_sides(graph: Graph) -> None:
    levels = {0: -0.3, 1: 0.2, 2: -0.1, 3: 0.4}
    face = cut(graph(wavy, levels))
    (piece,) = face.pieces
    assert all(arc.curve >= 0 for loop in piece.loops for arc in loop)
    assert piece.integrals[3] == pytest.approx(0.5 * 0.5, abs=1e-6)
    assert len(face.edges) == 4


def test_a_box_that_a_face_passes_by_leaves_nothing_of_it(graph: Graph) -> None:
    # Each plane crosses the face, but not where the others leave anything.
    assert cut(graph(wavy, {0: 0.5, 2: 0.5, 5: -0.25})).pieces == []


def test_a_corner_cut_off_leaves_two_pieces_or_one_with_all_the_rest(graph: Graph) -> None:
    ridge = graph(lambda x, y: y * y, {4: 0.25})
    assert sorted(piece.integrals[3] for piece in cut(ridge).pieces) == pytest.approx([1, 1])
    assert [len(piece.loops) for piece in cut(graph(lambda x, y: y * y, {5: 0.25})).pieces] == [1]


@settings(max_examples=20)
@given(st.floats(0.05, 0.9))
def test_the_bulge_of_an_arc_is_the_segment_beyond_its_chord(graph: Graph, radius: float) -> None:
    # A quarter circle round a corner.
    face = cut(graph(lambda x, y: (x + 1) ** 2 + (y + 1) ** 2, {5: radius**2}))
    (arc,) = [arc for piece in face.pieces for loop in piece.loops for arc in loop if arc.curve >= 0]
    segment = (np.pi / 4 - 1 / 2) * radius**2
    # Seen from above it runs anticlockwise; from below the other way.
    assert face.bulge(arc, 0, 1) == pytest.approx(segment, abs=2e-6)
    assert face.bulge(arc, 1, 0) == pytest.approx(-segment, abs=2e-6)
    assert face.plane(arc) == 5


def test_many_faces_are_cut_as_one_by_one(graph: Graph) -> None:
    one = graph(wavy, {0: -0.3, 5: 0.12})
    many = FacesToCut(np.repeat(one.nets, 70, axis=0), one.weights, one.knots, np.repeat(one.levels, 70, axis=0))
    alone = sums(cut(one))
    for face in cut_faces(many, SIZE):
        np.testing.assert_allclose(sums(face), alone, atol=1e-12)
