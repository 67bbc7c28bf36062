"""``gyroid-cad mesh`` and ``volumes``: a lattice for analysis, as structured elements or as trivariate patches."""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import click

from gyroid_cad.cli.console import print_report, print_table, shown_progress
from gyroid_cad.cli.lattice_options import lattice_of, lattice_options
from gyroid_cad.cli.options import json_option, one_of, order_option, output_option, quiet_option
from gyroid_cad.common.files import file_sizes, require_distinct
from gyroid_cad.common.formats import MESH_FORMATS, VOLUME_FORMATS, listed_formats, require_formats
from gyroid_cad.common.progress import timed

__all__ = ["mesh_command", "volumes_command"]


@click.command("mesh")
@output_option(f"{listed_formats(MESH_FORMATS)}; may be repeated.")
@lattice_options
@click.option(
    "--subdivisions", type=int, metavar="N", help="Elements along each side of a patch, of 24 a gyroid's cell."
)
@click.option(
    "--layers",
    type=int,
    default=1,
    show_default=True,
    metavar="M",
    help="Of hexahedra across the wall; 0 for quadrilaterals of the mid-surface.",
)
@order_option("Linear or quadratic elements.")
@click.option("--full", is_flag=True, help="Quadratic hexahedra of 27 nodes instead of 20, quadrilaterals of 9 not 8.")
@click.option("--quality", is_flag=True, help="Measure every element, as Verdict defines the measures.")
@click.option("--histogram", metavar="FILE.png", help="Draw the measures' histograms; needs matplotlib.")
@json_option
@quiet_option
def mesh_command(
    output: tuple[str, ...],
    subdivisions: int | None,
    layers: int,
    order: int,
    full: bool,
    quality: bool,
    histogram: str | None,
    as_json: bool,
    quiet: bool,
    **given: Any,
) -> None:
    """Mesh a lattice with structured hexahedra, straight from its control nets, and write them.

    The lattice is described as for "build", by options or in a TOML file.

    \b
    gyroid-cad mesh -o cell.inp --cells 1 1 1 --cell-size 10 --density 0.3 --subdivisions 4 --order 2
    gyroid-cad mesh -o paper.vtu --cells 4 3 2 --cell-size 10 --thickness 1 --subdivisions 20 --layers 3 --quality
    gyroid-cad mesh -o shell.bdf --cells 2 2 2 --cell-size 10 --thickness 1 --subdivisions 8 --layers 0
    """
    start = time.perf_counter()
    from gyroid_cad.mesh.finite_elements.files import require_mesh_format

    if subdivisions is None:
        raise click.UsageError("Missing option '--subdivisions'.")
    lattice = lattice_of(given)
    if not output:
        raise click.UsageError("Missing option '-o' / '--output'.")
    require_distinct(output, lambda path: require_mesh_format(path, full))
    if histogram is not None:
        from gyroid_cad.mesh.finite_elements.summaries import draw_quality, require_histogram

        require_histogram(histogram)
    with shown_progress(sys.stderr.isatty() and not quiet) as progress:
        # The wall first, so that its progress is told.
        lattice.fitted(progress)
        with timed({}, "elements", progress):
            made = (
                lattice.quadrilaterals(subdivisions, order, full)
                if layers == 0
                else lattice.hexahedra(subdivisions, layers, order, full)
            )
            pairs = lattice.periodic_pairs(made) if made.layers else None
        measured = None
        if quality or histogram:
            from gyroid_cad.builds.meshes import mesh_quality

            measured = mesh_quality(made)
        made.write(*output, pairs=pairs, progress=progress)
        if measured is not None and histogram is not None:
            draw_quality(measured, histogram)
    files = file_sizes([*output, *([histogram] if histogram else [])])
    seconds = time.perf_counter() - start
    summary = {
        "element": made.element.name,
        "elements": len(made.cells),
        "nodes": len(made.points),
        "patches": made.complex.patch_count,
        "subdivisions": made.subdivisions,
        "layers": made.layers,
        "sets": {name: len(some) for name, some in {**made.node_sets(), **made.element_sets()}.items()},
        "periodic_pairs": 0 if pairs is None else len(pairs),
        "quality": None if measured is None else measured.as_dict(),
        "files": files,
        "seconds": seconds,
    }
    if as_json:
        click.echo(json.dumps(summary))
    elif not quiet:
        rows = made.rows() if pairs is None else [*made.rows(), ("periodic pairs", f"{len(pairs):,}")]
        print_report(rows, files, seconds)
        if measured is not None:
            print_table(measured.header(), measured.rows())


@click.command("volumes")
@output_option(f"{listed_formats(VOLUME_FORMATS)}; may be repeated.")
@lattice_options
@click.option(
    "--degree",
    type=int,
    default=1,
    show_default=True,
    metavar="1|3",
    shell_complete=one_of("1", "3"),
    help="Across the wall; 3 along it.",
)
@json_option
@quiet_option
def volumes_command(output: tuple[str, ...], degree: int, as_json: bool, quiet: bool, **given: Any) -> None:
    """Write a lattice as conforming trivariate NURBS patches, for isogeometric analysis.

    The lattice is described as for "build", by options or in a TOML file.

    \b
    gyroid-cad volumes -o cell.mesh -o cell.xml --cells 1 1 1 --cell-size 10 --density 0.3 --degree 3
    """
    start = time.perf_counter()

    lattice = lattice_of(given)
    if not output:
        raise click.UsageError("Missing option '-o' / '--output'.")
    require_formats(output, VOLUME_FORMATS)
    with shown_progress(sys.stderr.isatty() and not quiet) as progress:
        lattice.fitted(progress)
        with timed({}, "volumes", progress):
            made = lattice.volumes(degree)
        made.write(*output, progress=progress)
    files, seconds = file_sizes(output), time.perf_counter() - start
    summary = {
        "patches": len(made),
        "degrees": list(made.degrees),
        "control_points": len(made.control_points),
        "interfaces": len(made.interfaces),
        "files": files,
        "seconds": seconds,
    }
    if as_json:
        click.echo(json.dumps(summary))
    elif not quiet:
        print_report(made.rows(), files, seconds)
