"""Regions of space between offsets of the mid-surface, and the walls that bound them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gyroid_cad.errors import ParameterError
from gyroid_cad.fields.field import Field
from gyroid_cad.filling.wanted import CHANNELS, NETWORK_A, NETWORK_B, SHEET, SURFACE, regions_of
from gyroid_cad.surface.families import USUAL

TUBE = USUAL.tube

L = 10.0


@given(st.lists(st.floats(-5, 5), min_size=1, max_size=20), st.floats(0.1, 3.7))
def test_wall_and_channels_share_out_all_of_space(offsets: list[float], thickness: float) -> None:
    places, halves = np.array(offsets), np.full(len(offsets), thickness / 2)
    regions = [
        *regions_of(SHEET, L, thickness, None, TUBE).regions,
        *regions_of(CHANNELS, L, thickness, None, TUBE).regions,
    ]
    counts = np.sum([region.contains(places, halves) for region in regions], axis=0)
    assert np.all((counts == 1) | (np.abs(places) == halves))


@given(st.floats(0.05, 0.95))
def test_labyrinths_of_complementary_densities_share_out_all_of_space(density: float) -> None:
    a, b = regions_of(NETWORK_A, L, None, density, TUBE), regions_of(NETWORK_B, L, None, 1 - density, TUBE)
    places = np.linspace(-4, 4, 100)
    halves = [np.full(len(places), float(made.thickness) / 2) for made in (a, b)]  # type: ignore[arg-type]
    held = [made.regions[0].contains(places, half) for made, half in zip((a, b), halves, strict=True)]
    assert np.sum(held[0] == held[1]) <= 1


@given(st.floats(0.05, 0.9))
def test_a_density_is_that_of_the_wall_it_gives(density: float) -> None:
    made = regions_of(SHEET, L, None, density, TUBE)
    assert TUBE.density(float(made.thickness) / L) == pytest.approx(density)  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", [SHEET, CHANNELS, NETWORK_A, NETWORK_B])
def test_faces_that_bound_a_region_look_out_of_it(kind: str) -> None:
    made = regions_of(kind, L, None, 0.4, TUBE)
    half = float(made.thickness) / 2  # type: ignore[arg-type]
    for region in made.regions:
        for side, backwards in region.sides:
            place = half * (2 * side - 1)
            outwards = -1.0 if backwards else 1.0
            beside = np.array([place - 1e-3 * outwards, place + 1e-3 * outwards])
            assert region.contains(beside, np.full(2, half)).tolist() == [True, False]


def test_the_bare_surface_is_one_face_without_a_wall() -> None:
    made = regions_of(SURFACE, L, None, None, TUBE)
    assert made.regions[0].sides == [(1, False)]
    assert made.thickness == 0


@pytest.mark.parametrize("given", ["0.4", "0.2 + 0.2", 0.4, Field(lambda x, y, z: 0.4, "0.4", 0.4)])
def test_a_networks_density_is_one_number_in_whatever_form_a_door_hands_it_over(given: Any) -> None:
    assert regions_of(NETWORK_A, L, None, given, TUBE) == regions_of(NETWORK_A, L, None, 0.4, TUBE)


def test_a_network_has_no_thickness() -> None:
    with pytest.raises(ParameterError, match=r"thickness = 1.0: expected none of a network"):
        regions_of(NETWORK_A, L, 1.0, None, TUBE)


@pytest.mark.parametrize("given", ["0.01", "1.2", "nan", True, None])
def test_a_networks_density_that_leaves_its_range_is_refused_with_the_range(given: Any) -> None:
    with pytest.raises(ParameterError, match="density"):
        regions_of(NETWORK_B, L, None, given, TUBE)
