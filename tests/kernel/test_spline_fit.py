"""Splines through points that are computed: as near as they are asked to be, or refused."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from gyroid_cad.errors import KernelError
from gyroid_cad.kernel.spline_fit import fitted_curve, fitted_plane_curve, fitted_surface

Floats = NDArray[np.float64]


def helix(t: Floats) -> Floats:
    return np.stack([np.cos(t), np.sin(t), t / 3], axis=1)


def dome(u: Floats, v: Floats) -> Floats:
    x, y = np.meshgrid(u, v, indexing="ij")
    return np.stack([x, y, np.sqrt(4 - x**2 - np.abs(y) ** 3)], axis=-1)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9])
def test_a_fitted_curve_is_as_near_as_asked(tolerance: float) -> None:
    places = np.linspace(0, 5, 333)
    curve, flat = (
        fitted_curve(helix, [0, 5], tolerance),
        fitted_plane_curve(lambda t: helix(t)[:, :2], [0, 5], tolerance),
    )
    points = [curve.Value(t) for t in places]
    assert np.abs([(p.X(), p.Y(), p.Z()) for p in points] - helix(places)).max() < 2 * tolerance
    points = [flat.Value(t) for t in places]
    assert np.abs([(p.X(), p.Y()) for p in points] - helix(places)[:, :2]).max() < 2 * tolerance


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
def test_a_fitted_surface_is_as_near_as_asked_and_breaks_where_the_given_one_does(tolerance: float) -> None:
    surface = fitted_surface(dome, [-1, 1], [-1, 0, 1], tolerance)
    u, v = np.linspace(-1, 1, 37), np.linspace(-1, 1, 41)
    points = [[surface.Value(a, b) for b in v] for a in u]
    off = np.array([[(p.X(), p.Y(), p.Z()) for p in row] for row in points]) - dome(u, v)
    assert np.abs(off).max() < 2 * tolerance


def test_a_surface_with_a_kink_is_followed_where_the_kink_is_told() -> None:
    def roof(u: Floats, v: Floats) -> Floats:
        x, y = np.meshgrid(u, v, indexing="ij")
        return np.stack([x, y, np.abs(y) + x**2], axis=-1)

    surface = fitted_surface(roof, [-1, 1], [-1, 0, 0, 1], 1e-9)
    assert surface.NbVPoles() == 7
    assert surface.Value(0.5, 1e-6).Z() == pytest.approx(0.25 + 1e-6, abs=1e-9)


def test_what_no_spline_comes_near_is_refused() -> None:
    with pytest.raises(KernelError, match="no spline comes within 1e-05 mm of a curve"):
        fitted_curve(lambda t: np.stack([t, np.sign(t - 0.3), t], axis=1), [0, 1], 1e-5)
    with pytest.raises(KernelError, match="of a surface"):
        fitted_surface(lambda u, v: np.sign(dome(u, v) - 0.3), [0, 1], [0, 1], 1e-5)
