"""Thickness of the fitted wall, against the fields that were asked for."""

from __future__ import annotations

import numpy as np
import pytest

from gyroid_cad.lattice import Lattice
from gyroid_cad.report.wall_thickness import wall_thickness
from gyroid_cad.surface.fit import FitSettings


def test_the_wall_s_error_falls_with_the_fourth_order_of_the_control_points_spacing() -> None:
    found = [wall_thickness(Lattice((1, 1, 1), 10.0, 0.8, fit=FitSettings(n)).fitted()).error for n in (10, 20)]
    worst = [max(-error.smallest, error.largest) for error in found]
    order = np.log(worst[0] / worst[1]) / np.log(17 / 7)
    assert 3.5 < order < 5.5


def test_a_wall_that_grows_evenly_has_the_thicknesses_asked_for() -> None:
    found = wall_thickness(Lattice((2, 1, 1), 10.0, "0.8 + 0.02*x").fitted()).thickness
    low, high = 0.8 + 0.02 * -2.5, 0.8 + 0.02 * 22.5
    assert found.smallest == pytest.approx(low, abs=1e-3)
    assert found.largest == pytest.approx(high, abs=1e-3)
    # The lattice is symmetric about its middle.
    assert found.mean == pytest.approx(1.0, abs=1e-4)
    assert found.median == pytest.approx(1.0, abs=1e-2)


def test_a_lattice_cut_to_its_block_is_measured_inside_it() -> None:
    found = wall_thickness(Lattice((1, 1, 1), 10.0, "0.8 + 0.02*x", trim="box").fitted()).thickness
    # To the tolerance of the fit.
    assert 0.7995 < found.smallest < 0.81
    assert 0.99 < found.largest < 1.0005
