"""``gyroid-cad fill``: a part from a file goes in, the same part filled with gyroid comes out."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from gyroid_cad.cli.check import checked_files, print_made
from gyroid_cad.cli.console import shown_progress
from gyroid_cad.cli.lattice_options import (
    PAPER_OPTIONS,
    described_by,
    fit_of,
    infill_options,
    lattice_of,
    listed,
    printed_options,
    take_defaults,
)
from gyroid_cad.cli.options import (
    HEADER_KEYS,
    angle_option,
    author_options,
    check_option,
    deviation_option,
    file_paths,
    json_option,
    order_option,
    output_option,
    printer_option,
    quiet_option,
    regions_option,
    schema_option,
)
from gyroid_cad.cli.print_check import check_by
from gyroid_cad.common.choices import KINDS, ROUTES, Route
from gyroid_cad.common.files import file_sizes
from gyroid_cad.common.formats import (
    MESH_FORMATS,
    PART_FORMATS,
    TOML,
    TRIANGLE_FORMATS,
    format_of,
    listed_endings,
    require_formats,
    require_regions,
    require_settings,
)
from gyroid_cad.common.memory import require_libraries
from gyroid_cad.errors import KernelError, ParameterError
from gyroid_cad.step.header import StepHeader

__all__ = ["fill_command"]

BREP, TRIANGLES = ROUTES
BODIES, SURFACE = KINDS[-2:]
# Of the part and of how it is filled, whatever lattice fills it.
_OWN = (
    *("kind", "skin", "plug", "core", "origin", "rotation", "drop_islands", "keep_islands"),
    *("fillet", "repair", "material_density", "partial"),
)


def _take_files(context: click.Context, parameter: click.Parameter, files: tuple[str, ...]) -> str | None:
    """Return the part among the files, or the one that the TOML file among them names."""
    parts = [file for file in files if format_of(file) is not TOML]
    configs = [file for file in files if format_of(file) is TOML]
    if len(parts) > 1 or len(configs) > 1:
        raise click.UsageError(f"Got {' '.join(files)}; expected one part and at most one TOML file.")
    if configs:
        take_defaults(context, configs[0])
        if not parts and (named := context.lookup_default("part")):
            parts = [named]
    return parts[0] if parts else None


@click.command("fill")
@click.argument(
    "part",
    nargs=-1,
    metavar="[PART.step|PART.brep|PART.stl] [FILL.toml]",
    is_eager=True,
    callback=_take_files,
    shell_complete=file_paths,
)
@output_option(f"{listed_endings(PART_FORMATS + MESH_FORMATS)}; may be repeated.")
@infill_options
@click.option(
    "--cells",
    nargs=3,
    type=int,
    metavar="NX NY NZ",
    help="Fill with a block of so many cells, which --map and --scale-field may carry; it goes on as far as they do.",
)
@click.option(
    "--kind",
    type=click.Choice(KINDS),
    metavar="KIND",
    default="sheet",
    show_default=True,
    help="sheet, the wall; network-a or network-b, one of the two that it parts; channels, both of them without it; "
    "bodies, wall and both as solids that share their faces; surface, the mid-surface alone. "
    "Density is that of the wall, of channels too, but of a network its own.",
)
@click.option("--skin", type=float, metavar="MM", help="Keep a solid shell of the part, fused with the infill.")
@click.option(
    "--opening",
    multiple=True,
    metavar="FACE",
    help="Leave the skin open at a face: >Z, <X and the like for the one furthest that way, or a point X,Y,Z on it; of "
    "bodies for one fluid, as a:>Z or b:<X; may be repeated.",
)
@click.option(
    "--plug",
    type=float,
    metavar="MM",
    help="Where one fluid flows in, how thick the wall is that closes channels of the other; as the skin if left out.",
)
@click.option(
    "--core",
    metavar="FILE",
    shell_complete=file_paths,
    help="Instead of --skin, the inner solid that is filled, of a STEP or BREP file: the skin is the part less it.",
)
@click.option("--fillet", type=float, metavar="MM", help="Round the corners where infill and skin meet, of triangles.")
@click.option(
    "--solid",
    multiple=True,
    metavar="NAME",
    help="Fill only the solids of the part that have this name, or this number; may be repeated.",
)
@click.option("--partial", is_flag=True, help="Fill what --cells with --map reach, even if it is not all of the part.")
@click.option(
    "--drop-islands",
    is_flag=True,
    help="Drop all pieces not connected to the largest one; small ones, of less than a hundredth of what a cell holds, "
    "are dropped anyway.",
)
@click.option("--keep-islands", is_flag=True, help="Keep small ones too.")
@click.option(
    "--route",
    type=click.Choice(ROUTES),
    help="Through exact solids, or through triangles alone, which serves every part and is faster; if left out, "
    "triangles where all files that are written hold triangles.",
)
@click.option("--repair", is_flag=True, help="Close a part of triangles that is open, and say what was done.")
@click.option("--material-density", type=float, metavar="G/CM3", help="For the masses in the report.")
@schema_option
@author_options
@regions_option
@deviation_option
@angle_option
@click.option("--element-size", type=float, metavar="MM", help="Length of the edges of tetrahedra, in files of meshes.")
@click.option(
    "--elements-through",
    type=float,
    metavar="N",
    help="Instead, how many tetrahedra there are through the wall, about; 2 if neither is given.",
)
@order_option("Tetrahedra of 4 nodes, or of 10 that follow the faces.")
@check_option
@printer_option("Check as well whether it can make this, such as form2.")
@click.option("--print-config", is_flag=True, help="Print all of this as TOML, ready for FILL.toml; fill nothing.")
@json_option
@quiet_option
def fill_command(
    part: str | None,
    output: tuple[str, ...],
    printer: str | None,
    print_config: bool,
    as_json: bool,
    quiet: bool,
    **given: Any,
) -> None:
    """Fill the solids of a STEP or BREP file, or what an STL, 3MF, OBJ or PLY file bounds, with gyroid.

    A TOML file has these options as keys, with underscores, and the part as "part"; options given as well override it.

    \b
    gyroid-cad fill part.step -o light.step --cell-size 7 --density 0.30
    gyroid-cad fill part.step -o light.step --cell-size 7 --density 0.30 --skin 1 --opening ">Z"
    gyroid-cad fill part.step -o light.step --cell-size 7 --density 0.30 --core inner.step
    gyroid-cad fill machine.step -o light.step --cell-size 7 --density 0.30 --solid bracket
    gyroid-cad fill part.step -o fluids.step --cell-size 7 --thickness 0.6 --kind channels
    gyroid-cad fill part.step -o bodies.msh --cell-size 7 --thickness 0.6 --kind bodies --elements-through 3
    gyroid-cad fill scan.stl -o light.3mf --cell-size 7 --density 0.30
    gyroid-cad fill part.step -o core.step --cells 3 3 3 --cell-size 7 --density 0.3 --map twist:angle=20
    gyroid-cad fill fill.toml
    gyroid-cad fill other.step fill.toml -o other_light.step --density 0.25
    """
    start = time.perf_counter()
    require_libraries()
    from gyroid_cad.filling import fill, tetrahedra

    if part is None:
        raise click.UsageError("Missing argument 'PART.step': a file, or the key part of FILL.toml.")
    if not (output or print_config):
        raise click.UsageError("Missing option '-o' / '--output'.")
    settings = _settings(given)
    if print_config:
        click.echo(printed_options(), nl=False)
        return
    for read in filter(None, (part, given["core"])):
        _require_another_file(read, output)
    header, limits = ({name: given[name] for name in names} for names in (HEADER_KEYS, ("deviation", "angle")))
    StepHeader(**header)
    require_settings((1, 1, 1), **limits)
    elements = {name: given[name] for name in ("element_size", "elements_through", "order")}
    meshes = [path for path in output if format_of(path) in MESH_FORMATS]
    tetrahedra.require_elements(**elements, wanted=bool(meshes))
    written = {**header, **limits, "regions": given["regions"]}
    checked = None if printer is None else check_by(printer)
    settings["route"] = _route(part, given, output)
    if settings["route"] == TRIANGLES:
        settings["deviation"], written = given["deviation"], {}
    with shown_progress(not quiet, lines=True) as progress:
        try:
            filled = fill.fill(part, progress=progress, **settings)
        except KernelError as failed:
            raise KernelError(str(failed).replace('route="triangles"', "--route triangles")) from failed
        # What can fail comes before the first file.
        mesh = filled.mesh(**elements, progress=progress) if meshes else None
        if others := [path for path in output if path not in meshes]:
            filled.write(*others, **written, progress=progress)
        if mesh is not None:
            mesh.write(*meshes, progress=progress)
        check = None if checked is None else checked(filled, given["deviation"], progress)
        of_files = checked_files(others if given["check"] else (), progress)
    summary = filled.report.as_dict()
    summary["seconds"] = {**summary["seconds"], "total": time.perf_counter() - start}
    summary["files"] = file_sizes(output)
    rows = filled.report.rows()
    if mesh is not None:
        summary["mesh"], rows = mesh.as_dict(), [*rows, *mesh.rows()]
    print_made(rows, summary, check, of_files, as_json, quiet)


def _route(part: str, given: dict[str, Any], output: Sequence[str]) -> Route:
    """Return the route to take: the one that was chosen, or triangles where nothing but triangles is written.

    Raises
    ------
    ParameterError
        If it does not lead from the part, with what else is given, to the files.
    """
    formats = {format_of(path) for path in output}
    require_regions(given["kind"], output, given["regions"])
    of_triangles = given["kind"] != BODIES and formats <= set(TRIANGLE_FORMATS)
    route: Route = given["route"] or (TRIANGLES if of_triangles else BREP)
    if route == TRIANGLES:
        require_formats(output, TRIANGLE_FORMATS)
        return route
    if format_of(part) in TRIANGLE_FORMATS:
        accepted = f"a STEP or BREP file; triangles fill by --route triangles, into {listed_endings(TRIANGLE_FORMATS)}"
        raise ParameterError("part", part, accepted)
    if given["kind"] == SURFACE:
        require_formats(output, [form for form in PART_FORMATS if form not in TRIANGLE_FORMATS])
    if given["fillet"] is not None:
        accepted = "none at --route brep, whose solids have sharp corners there; --route triangles rounds them"
        raise ParameterError("fillet", given["fillet"], accepted)
    return route


def _require_another_file(read: str, output: Sequence[str]) -> None:
    """Check the files to be written: none of them may be one that is read.

    Raises
    ------
    ParameterError
    """
    for path in require_formats(output, (*PART_FORMATS, *MESH_FORMATS)):
        if path.exists() and Path(read).exists() and path.samefile(read):
            raise ParameterError("output", str(path), "another file than the part that is filled and its core")


def _settings(given: dict[str, Any]) -> dict[str, Any]:
    """Arguments of :func:`gyroid_cad.fill` that the options mean.

    Raises
    ------
    click.UsageError, ParameterError
    """
    own = {name: given[name] for name in _OWN}
    own["openings"] = [_face(opening) for opening in given["opening"]]
    own["solids"] = given["solid"]
    if given["cells"] is not None:
        return {**own, "lattice": lattice_of(given)}
    of_blocks = [name for name in (*PAPER_OPTIONS, "scale_field", "map") if given[name] is not None]
    if of_blocks:
        raise click.UsageError(
            f"give {listed(['cells'])} with {listed(of_blocks)}: only a block of cells is scaled or mapped"
        )
    endless = {name: given[name] for name in ("tolerance", "surface", "compact")}
    return {**own, **endless, **described_by(given, bare=given["kind"] == SURFACE), "fit": fit_of(given)}


def _face(opening: str) -> str | list[float] | tuple[str, list[float]]:
    """A selector as it stands, or the coordinates of a point, with the fluid that it may name."""
    fluid, colon, place = opening.rpartition(":")
    try:
        point = [float(number) for number in place.split(",")]
    except ValueError:
        return opening
    return (fluid, point) if colon else point
