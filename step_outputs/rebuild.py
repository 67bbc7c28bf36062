"""Rebuild the committed results and their manifest: ``python step_outputs/rebuild.py``.

STEP headers carry the date of SOURCE_DATE_EPOCH, which is fixed here, so that equal geometry makes equal files.
"""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import dataclass
from pathlib import Path

from gyroid_cad import FitSettings, Lattice

FOLDER = Path(__file__).parent
MANIFEST = FOLDER / "manifest.json"
EPOCH = "1640995200"  # 1 January 2022


@dataclass(frozen=True)
class Result:
    """One committed file and how it is made."""

    file: str
    lattice: Lattice
    schema: str = "ap214"
    deviation: float = 0.05


def rational_fit() -> FitSettings:
    """The paper's knots and weights over the smooth parameterisation."""
    paper = FitSettings.paper()
    return FitSettings(paper.control_points, paper.knots, paper.weights)


RESULTS = (
    Result("unit_cell.step", Lattice((1, 1, 1), 10, thickness=0.8)),
    Result("unit_cell_density_0.30_ap242.step", Lattice((1, 1, 1), 10, density=0.3), "ap242"),
    Result("unit_cell_rational.brep", Lattice((1, 1, 1), 10, thickness=0.8, fit=rational_fit())),
    Result("two_cells_cubed.brep", Lattice((2, 2, 2), 10, thickness=0.8)),
    Result("unit_cell_graded.step", Lattice((1, 1, 1), 10, "0.6 + 0.03*x", scale_field="1 + 0.02*y"), "ap242"),
    Result("diamond_cell.step", Lattice((1, 1, 1), 10, density=0.25, surface="diamond", fit=FitSettings(7))),
    Result("primitive_cell.step", Lattice((1, 1, 1), 10, density=0.25, surface="primitive")),
    Result("unit_cell.stl", Lattice((1, 1, 1), 10, thickness=0.8), deviation=0.1),
)


def main(folder: Path = FOLDER) -> None:
    """Write every result and the manifest into a folder.

    Parameters
    ----------
    folder : Path
    """
    os.environ["SOURCE_DATE_EPOCH"] = EPOCH
    entries = []
    for result in RESULTS:
        path = folder / result.file
        result.lattice.write(path, schema=result.schema, deviation=result.deviation, angle=25)
        report = result.lattice.report()
        entries.append(
            {
                "file": result.file,
                "cells": report.cells,
                "cell_size": report.cell_size,
                "thickness": report.thickness,
                "density": report.density,
                "rational": result.lattice.fit.weights is not None,
                "schema": result.schema if path.suffix == ".step" else None,
                "deviation": result.deviation if path.suffix == ".stl" else None,
                "faces": report.faces,
                "volume": report.volume,
                "volume_exact": report.volume_exact,
                "bytes": path.stat().st_size,
                "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
            }
        )
    (folder / MANIFEST.name).write_text(json.dumps(entries, indent=2) + "\n")


if __name__ == "__main__":
    main()
