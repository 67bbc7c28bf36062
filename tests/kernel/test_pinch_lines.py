"""Lines in which two pieces of a lattice's border touch: the kernel cuts, fuses and fillets there as elsewhere."""

from __future__ import annotations

import build123d as bd
import numpy as np
import pytest

from gyroid_cad.lattice import Lattice
from gyroid_cad.surface.fit import FitSettings

CELL = 10.0


def test_cut_fuse_and_fillet_are_valid_across_a_pinch_line() -> None:
    made = Lattice((2, 2, 2), CELL, 0.8, fit=FitSettings(4))
    complex, lattice, volume = made.wall().complex, bd.Solid(made.solid()), made.report().volume
    pinched = np.flatnonzero(np.bincount(complex.fan_corner) > 1)
    assert len(pinched) == complex.non_manifold_edges > 0
    place = complex.corner_quarters[pinched[0]] * CELL / 4
    # With a corner in the middle of the line, so that it is cut.
    box = bd.Pos(*place) * bd.Box(2.5, 2.2, 2, align=3 * [bd.Align.MIN])
    cut, common, fused = lattice - box, lattice & box, lattice + box
    assert all(shape.is_valid for shape in (cut, common, fused))
    assert common.volume > 0.1
    assert cut.volume + common.volume == pytest.approx(volume, rel=1e-5)
    assert fused.volume + common.volume == pytest.approx(volume + box.volume, rel=1e-5)
    nearest = min(fused.edges().filter_by(bd.GeomType.LINE), key=lambda edge: edge.distance_to(tuple(place)))
    rounded = fused.fillet(0.05, [nearest])
    assert rounded.is_valid
    assert 0 < abs(fused.volume - rounded.volume) < 0.05
