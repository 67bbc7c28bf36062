"""Options that describe a lattice, on the command line or in a TOML file, for every command that takes one."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from typing import TYPE_CHECKING, Any

import click

from gyroid_cad.cli.config import Config, printed_config, read_config
from gyroid_cad.cli.messages import config_of, label, remember_config
from gyroid_cad.cli.options import HEADER_KEYS, Decorator, file_paths
from gyroid_cad.common.choices import BLOCK_KINDS, FITS, SURFACE_NAMES, TARGETS, TRIMS
from gyroid_cad.common.formats import TOML, format_of
from gyroid_cad.errors import ParameterError

if TYPE_CHECKING:
    from gyroid_cad.lattice import Lattice
    from gyroid_cad.surface.fit import FitSettings

__all__ = [
    "PAPER_OPTIONS",
    "described_by",
    "fit_of",
    "infill_options",
    "lattice_of",
    "lattice_options",
    "lattice_options_beside",
    "listed",
    "options_given",
    "printed_options",
    "quantity_options",
    "require_given",
    "take_defaults",
]

_WALL_OPTIONS = ("thickness", "density", "porosity")
_SOLVED_OPTIONS = TARGETS[1:]
_OWN_OPTIONS = (*_WALL_OPTIONS, *_SOLVED_OPTIONS, "scale_field", "cell_size", "map")
# Of a block of cells that is built. One that fills a part is placed and cut by the filling.
_CUT_OPTIONS, _PLACE_OPTIONS = ("trim", "keep_islands", "kind"), ("origin", "rotation")
PAPER_OPTIONS = ("thickness_factor", "bc_length", "scale")
# Of how a command answers, not of what it makes: no keys of a file.
_NO_KEYS = {"config", "print_config", "as_json", "quiet", "allow_outside"}
# Of the files that "build" writes: other commands that take the same lattice pass over them.
_BUILD_FLAGS = ("instances", "kernel_check", "check")
_BUILD_KEYS = ("output", *HEADER_KEYS, "deviation", "angle", "regions", *_BUILD_FLAGS)
# Keys that name files, which a command writes or reads: in the folder of the file that names them.
_WRITTEN, _READ = ("output", "histogram", "screenshot"), ("part", "core", "printer")


def take_defaults(
    context: click.Context, path: str, passed_over: Collection[str] = (), flags: Collection[str] = ()
) -> None:
    """Put a file's values in the place of defaults, so that options on the command line override them.

    Parameters
    ----------
    context : click.Context
    path : str
    passed_over : collection of str
        Keys that mean nothing to this command, and are no mistake.
    flags : collection of str
        Those among them that are true or false.

    Raises
    ------
    ParameterError
    """

    options = {p.name: p for p in context.command.params if p.name and p.expose_value and p.name not in _NO_KEYS}
    own_flags = {name for name, option in options.items() if getattr(option, "is_flag", False)}
    config = read_config(path, {*options, *passed_over}, {*own_flags, *flags})
    multiple = [name for name, option in options.items() if getattr(option, "multiple", False)]
    remember_config(context, config, {key: _default(context, config, key, key in multiple) for key in config.values})


def _defaults_from_file(context: click.Context, parameter: click.Parameter, path: str | None) -> str | None:
    if path is not None and format_of(path) is TOML:
        take_defaults(context, path, _BUILD_KEYS, _BUILD_FLAGS)
    return path


def _default(context: click.Context, config: Config, key: str, multiple: bool) -> Callable[[], Any]:
    """Value that a file gives a key, taken only where the command line says nothing of it."""

    def value() -> Any:
        given = config.values[key]
        parts = [given] if isinstance(given, str) else given
        if key in _WRITTEN:
            parts = [config.output(key, part, context.params["allow_outside"]) for part in parts]
        elif key in _READ:
            # A printer that is known has no ending.
            parts = [config.beside(part) if format_of(part) is not None else part for part in parts]
        return parts if multiple or not isinstance(given, str) else parts[0]

    return value


def printed_options() -> str:
    """Options of the command that runs, as TOML that it would read."""

    context = click.get_current_context()
    keys = [name for name in (p.name for p in context.command.params) if name in context.params]
    return printed_config({name: context.params[name] for name in keys if name not in _NO_KEYS})


surface_option = click.option(
    "--surface",
    type=click.Choice(SURFACE_NAMES),
    default="gyroid",
    show_default=True,
    help="The minimal surface that the wall follows.",
)
porosity_option = click.option(
    "--porosity", metavar="P", help="Empty part of the volume instead: 1 - density; may be an expression too."
)
# Two of these, and of cell size, thickness and density, describe a lattice that is uniform.
_TARGET_OPTIONS = tuple(
    click.option(name, type=float, metavar=unit, help=meaning)
    for name, unit, meaning in (
        ("--pore-size", "MM", "Diameter of the largest sphere in the pores. Any two of these describe a lattice."),
        ("--throat", "MM", "Diameter of the largest sphere that can travel through the pores."),
        ("--hydraulic-diameter", "MM", "Of the pores: four times their volume by their area."),
        ("--area-per-volume", "1/MM", "Area of all faces by the volume of the lattice."),
        ("--curvature-radius", "MM", "The smallest of the faces."),
    )
)
_INFILL_OPTIONS = (
    surface_option,
    click.option(
        "--cell-size", type=float, metavar="MM", help="Period of the cubic cell, before it is scaled or mapped."
    ),
    click.option(
        "--thickness",
        metavar="MM",
        help='Whole wall: a number, below 0.37647 of the cell size, or an expression such as "0.8 + 0.02*x".',
    ),
    click.option(
        "--density",
        metavar="RHO",
        help="Volume fraction instead of thickness, below 0.94033; may be an expression too.",
    ),
    porosity_option,
    *_TARGET_OPTIONS,
    click.option(
        "--scale-field",
        metavar="EXPRESSION",
        help='Cells grow by it, such as "1 + 0.01*x": p is moved to scale-field(p) times p. It is not written into '
        "--cell-size, for that stays the length by which x, y, z and the tolerance are measured.",
    ),
    click.option(
        "--map",
        metavar="MAP",
        help="Of space: cylinder:radius=MM, sphere:radius=MM (both also angle=DEGREES), bend:angle=, twist:angle= "
        "(also x=MM and y=MM, where its axis stands).",
    ),
    click.option(
        "--thickness-factor", metavar="T", help="The paper's: whole wall in BC units, instead of --thickness."
    ),
    click.option("--bc-length", metavar="B", help="The paper's: length of a bounding cell, instead of --cell-size."),
    click.option("--scale", type=float, metavar="MM", help="Millimetres per unit of BC length; 1 if left out."),
    click.option(
        "--tolerance",
        type=float,
        metavar="PART",
        help="Largest deviation in cell sizes; 1e-4 if left out where the lattice is graded.",
    ),
    click.option(
        "--compact",
        type=float,
        metavar="MM",
        help="Largest deviation in mm instead, met by as few control points as can be, from 5 a side: for small files.",
    ),
    click.option(
        "--control-points",
        type=int,
        default=10,
        show_default=True,
        metavar="N",
        help="Of a patch, along a side; more are taken where the tolerance asks for them.",
    ),
    click.option(
        "--fit",
        type=click.Choice(FITS),
        default="smooth",
        show_default=True,
        help="The paper's own leaves gaps between patches, and is refused with their size.",
    ),
    click.option(
        "--origin",
        nargs=3,
        type=float,
        metavar="X Y Z",
        help="Where the lattice's own origin is placed, in mm; fields and maps go with it. Left out it is 0 0 0, or "
        "in a part a little beside where edges would be too short.",
    ),
    click.option(
        "--rotation",
        nargs=3,
        type=float,
        default=(0, 0, 0),
        metavar="A B C",
        help="Turns of the lattice about x, y and z, one after the other, in degrees.",
    ),
)
_OPTIONS = (
    click.option("--cells", nargs=3, type=int, metavar="NX NY NZ", help="Cubic cells along x, y and z."),
    *_INFILL_OPTIONS,
    click.option(
        "--trim", type=click.Choice(TRIMS), help="Cut to the block of cells: flat sides instead of whole patches."
    ),
    click.option(
        "--keep-islands",
        is_flag=True,
        help="Of a trimmed lattice: keep small pieces that the cut leaves unconnected, of less than a hundredth of "
        "what a cell holds.",
    ),
    click.option(
        "--kind",
        type=click.Choice(BLOCK_KINDS),
        metavar="KIND",
        default=BLOCK_KINDS[0],
        show_default=True,
        help="Of a trimmed lattice: sheet, the wall; network-a or network-b, one of the two that it parts, of the "
        "given density; channels, both of them without it; bodies, wall and both as solids that share their faces.",
    ),
)
_outside_option = click.option(
    "--allow-outside",
    is_flag=True,
    is_eager=True,
    help="Let a TOML file name files to be written that are not in its own folder.",
)


def quantity_options(function: Callable[..., None]) -> Callable[..., None]:
    """Give a command the quantities that describe a lattice which is alike throughout, each as one number."""
    own = [
        click.option(f"--{name}", type=float, metavar=unit, help=meaning)
        for name, unit, meaning in (
            ("cell-size", "MM", "Period of the cubic cell."),
            ("thickness", "MM", "Whole wall."),
            ("density", "RHO", "Solid part of the volume."),
            ("porosity", "P", "Empty part of the volume: 1 - density."),
        )
    ]
    for option in reversed((*own, *_TARGET_OPTIONS)):
        function = option(function)
    return function


def infill_options(function: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of a lattice without end."""
    return _with_options(function, _INFILL_OPTIONS)


def lattice_options(function: Callable[..., None]) -> Callable[..., None]:
    """Give a command the argument and the options that :func:`lattice_of` reads."""
    return lattice_options_beside("LATTICE.toml")(function)


def lattice_options_beside(files: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Add a lattice's options where the argument may be other files as well: those that this text shows."""

    def given_to(function: Callable[..., None]) -> Callable[..., None]:
        function = _with_options(function, _OPTIONS)
        argument = click.argument(
            "config",
            required=False,
            metavar=f"[{files}]",
            is_eager=True,
            callback=_defaults_from_file,
            shell_complete=file_paths,
        )
        return argument(function)

    return given_to


def _with_options(function: Callable[..., None], options: Sequence[Decorator]) -> Callable[..., None]:
    for option in reversed((_outside_option, *options)):
        function = option(function)
    return function


def options_given(but: Collection[str]) -> list[str]:
    """Options that stand on the command line itself, as they are called there, but for those named."""
    context, line = click.get_current_context(), click.core.ParameterSource.COMMANDLINE
    named = [name for name in context.params if name not in but and context.get_parameter_source(name) == line]
    return [label(context, name) for name in named]


def lattice_of(given: dict[str, Any]) -> Lattice:
    """The lattice that the options describe, in millimetres or in the paper's units.

    Raises
    ------
    click.UsageError, ParameterError
    """
    from gyroid_cad.lattice import Lattice

    config = given.get("config")
    if config is not None and format_of(config) is not TOML:
        raise click.UsageError(f"Got unexpected extra argument '{config}'; a lattice in a file ends in .toml.")
    fit = fit_of(given)
    require_given(given, "cells")
    built = "trim" in given
    cut = {name: given[name] for name in _CUT_OPTIONS if built}
    place = {name: given[name] for name in _PLACE_OPTIONS if built and given[name] is not None}
    if any(given[name] is not None for name in PAPER_OPTIONS):
        own_options = (*_OWN_OPTIONS, *cut)
        mixed = [name for name in own_options if given[name] not in (None, False, BLOCK_KINDS[0])]
        if mixed or given["thickness_factor"] is None:
            raise click.UsageError(
                f"{listed(PAPER_OPTIONS)} are the paper's units: they need {listed(PAPER_OPTIONS[:1])}, and not "
                f"{listed(mixed or own_options)}"
            )
        units = {name: given[name] for name in PAPER_OPTIONS if given[name] is not None}
        common = {name: given[name] for name in ("tolerance", "surface", "compact")}
        return Lattice.paper(given["cells"], **units, fit=fit, **common, **place)
    described = described_by(given)
    own = {name: given[name] for name in ("scale_field", "map", "tolerance", "surface", "compact")}
    return Lattice(given["cells"], **described, **own, **cut, **place, fit=fit)


def described_by(given: dict[str, Any], bare: bool = False) -> dict[str, Any]:
    """Cell size, wall, pores and whatever else is given of these.

    Raises
    ------
    click.UsageError
        If a wall is described twice, or not at all unless it is of the bare surface; or there is no cell size.
    """
    if all(given[name] is None for name in _SOLVED_OPTIONS):
        require_given(given, "cell_size")
        named = [name for name in _WALL_OPTIONS if given[name] is not None]
        if len(named) != 1 and not (bare and not named):
            raise click.UsageError(f"give exactly one of {listed(named or _WALL_OPTIONS)}")
    return {name: given[name] for name in ("cell_size", "thickness", "density", *TARGETS)}


def require_given(given: dict[str, Any], name: str) -> None:
    """Refuse to go on without an option.

    Raises
    ------
    click.UsageError
    """
    if given[name] is None:
        config = config_of(click.get_current_context())
        nor = "" if config is None else f", and {config.path} has no key {name}"
        raise click.UsageError(f"Missing option '{listed([name])}'{nor}.")


def listed(names: Iterable[str]) -> str:
    """Return options as the user gave them, or would."""
    context = click.get_current_context()
    return ", ".join(label(context, name) for name in names)


def fit_of(given: dict[str, Any]) -> FitSettings:
    """Return how the patch is to be fitted.

    Raises
    ------
    ParameterError
    """
    from gyroid_cad.surface.fit import FitSettings

    control_points = given["control_points"]
    if given["compact"] is not None and (own := listed(["control_points"])) in options_given(()):
        raise click.UsageError(f"give {own} or {listed(['compact'])}, which chooses them itself, not both")
    if given["fit"] == "smooth":
        return FitSettings(control_points)
    settings = FitSettings.paper()
    if control_points != settings.control_points:
        raise ParameterError("control_points", control_points, "10, the paper's own, with --fit paper")
    return settings
