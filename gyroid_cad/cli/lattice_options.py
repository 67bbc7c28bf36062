"""Options that describe a lattice, on the command line or in a TOML file, for every command that takes one."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import TYPE_CHECKING, Any

import click

from gyroid_cad.errors import ParameterError

if TYPE_CHECKING:
    from gyroid_cad.lattice import Lattice

__all__ = [
    "chosen_surface",
    "lattice_of",
    "lattice_options",
    "lattice_options_beside",
    "option_name",
    "options_given",
    "printed_options",
    "surface_option",
]

_CONFIG_ENDING = ".toml"
_OWN_OPTIONS = ("thickness", "density", "scale_field")
_PAPER_OPTIONS = ("thickness_factor", "bc_length", "scale")
_NOT_OF_THE_PAPER = (*_OWN_OPTIONS, "cell_size", "map", "trim", "keep_islands")
# Of how a command answers, not of what it makes: no keys of a file.
_NO_KEYS = {"config", "print_config", "as_json", "quiet", "help"}
# Of the files that "build" writes: other commands that take the same lattice pass over them.
_BUILD_KEYS, _BUILD_FLAGS = ("output", "schema", "deviation", "angle", "instances"), ("instances",)


def _defaults_from_file(context: click.Context, parameter: click.Parameter, path: str | None) -> str | None:
    """What a file says takes the place of defaults, so that options on the command line override it."""
    if path is not None and path.lower().endswith(_CONFIG_ENDING):
        from gyroid_cad.cli.config import read_config

        named = {p.name: p for p in context.command.params if p.name and p.name not in _NO_KEYS}
        flags = {name for name, option in named.items() if getattr(option, "is_flag", False)}
        values = read_config(path, {*named, *_BUILD_KEYS}, {*flags, *_BUILD_FLAGS})
        if isinstance(values.get("output"), str):
            values["output"] = [values["output"]]
        context.default_map = values
    return path


def printed_options() -> str:
    """What the command that runs was given, as TOML that it would read."""
    from gyroid_cad.cli.config import printed_config

    context = click.get_current_context()
    keys = [name for name in (p.name for p in context.command.params) if name in context.params]
    return printed_config({name: context.params[name] for name in keys if name not in _NO_KEYS})


def _known_surfaces(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
    """What a shell may complete the name of a surface to."""
    from gyroid_cad.surface.families import SURFACES

    return [name for name in SURFACES if name.startswith(incomplete)]


# Which surfaces there are is for the table of families to say; it is not read for --help alone.
surface_option = click.option(
    "--surface",
    metavar="NAME",
    shell_complete=_known_surfaces,
    help="gyroid, diamond or primitive; gyroid if left out.",
)
_OPTIONS = (
    surface_option,
    click.option("--cells", nargs=3, type=int, metavar="NX NY NZ", help="Cubic cells along x, y and z."),
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
    click.option(
        "--scale-field",
        metavar="EXPRESSION",
        help='Cells grow by it, such as "1 + 0.01*x": p is moved to scale-field(p) times p. It is not written into '
        "--cell-size, for that stays the length by which x, y, z and the tolerance are measured.",
    ),
    click.option(
        "--map",
        metavar="MAP",
        help="Of space: cylinder:radius=MM, sphere:radius=MM (both also angle=DEGREES), twist:angle=, bend:angle=.",
    ),
    click.option(
        "--thickness-factor", metavar="T", help="The paper's: whole wall in BC units, instead of --thickness."
    ),
    click.option("--bc-length", metavar="B", help="The paper's: length of a bounding cell, instead of --cell-size."),
    click.option("--scale", type=float, metavar="MM", help="Millimetres per unit of BC length; 1 if left out."),
    click.option(
        "--trim", metavar="SHAPE", help="box: cut to the block of cells, flat sides instead of whole patches."
    ),
    click.option(
        "--keep-islands",
        is_flag=True,
        help="Of a trimmed lattice: keep small pieces that the cut leaves unconnected, of less than a hundredth of "
        "what a cell holds.",
    ),
    click.option(
        "--tolerance",
        type=float,
        metavar="PART",
        help="Largest deviation in cell sizes; 1e-4 if left out where the lattice is graded.",
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
        type=click.Choice(["smooth", "paper"]),
        default="smooth",
        show_default=True,
        help="The paper's own leaves gaps between patches, and is refused with their size.",
    ),
)


def lattice_options(function: Callable[..., None]) -> Callable[..., None]:
    """Give a command the argument and the options that :func:`lattice_of` reads."""
    return lattice_options_beside("LATTICE.toml")(function)


def lattice_options_beside(files: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """The same, where the argument may be other files as well: those that this text shows."""

    def given_to(function: Callable[..., None]) -> Callable[..., None]:
        for option in reversed(_OPTIONS):
            function = option(function)
        argument = click.argument(
            "config", required=False, metavar=f"[{files}]", is_eager=True, callback=_defaults_from_file
        )
        return argument(function)

    return given_to


def options_given(but: Collection[str]) -> list[str]:
    """Options that stand on the command line itself, as they are called there, but for those named."""
    context, line = click.get_current_context(), click.core.ParameterSource.COMMANDLINE
    named = [name for name in context.params if name not in but and context.get_parameter_source(name) == line]
    return [option_name(name) for name in named]


def chosen_surface(name: str | None) -> dict[str, Any]:
    """The keyword for a surface, or none where none was asked for."""
    return {} if name is None else {"surface": name}


def lattice_of(given: dict[str, Any]) -> Lattice:
    """The lattice that the options describe, in millimetres or in the paper's units.

    Raises
    ------
    click.UsageError, ParameterError
    """
    from gyroid_cad.lattice import Lattice

    if given["config"] is not None and not given["config"].lower().endswith(_CONFIG_ENDING):
        raise click.UsageError(
            f"Got unexpected extra argument '{given['config']}'; a lattice in a file ends in {_CONFIG_ENDING}."
        )
    if given["cells"] is None:
        raise click.UsageError("Missing option '--cells'.")
    fit = _fit_settings(given["fit"], given["control_points"])
    surface = chosen_surface(given["surface"])
    if any(given[name] is not None for name in _PAPER_OPTIONS):
        mixed = [name for name in _NOT_OF_THE_PAPER if given[name] not in (None, False)]
        if mixed or given["thickness_factor"] is None:
            options = ", ".join(map(option_name, _PAPER_OPTIONS))
            raise click.UsageError(
                f"{options} are the paper's units: they need --thickness-factor, and not "
                + ", ".join(map(option_name, mixed or _NOT_OF_THE_PAPER))
            )
        units = {name: given[name] for name in _PAPER_OPTIONS if given[name] is not None}
        return Lattice.paper(given["cells"], **units, fit=fit, tolerance=given["tolerance"], **surface)
    if given["cell_size"] is None:
        raise click.UsageError("Missing option '--cell-size'.")
    if (given["thickness"] is None) == (given["density"] is None):
        raise click.UsageError("give exactly one of --thickness and --density")
    own = {name: given[name] for name in (*_OWN_OPTIONS, "map", "tolerance", "trim", "keep_islands")}
    return Lattice(given["cells"], given["cell_size"], **own, **surface, fit=fit)


def _fit_settings(fit: str, control_points: int) -> Any:
    from gyroid_cad.surface.fit import FitSettings

    if fit == "smooth":
        return FitSettings(control_points)
    settings = FitSettings.paper()
    if control_points != settings.control_points:
        raise ParameterError("control_points", control_points, "10, the paper's own, with --fit paper")
    return settings


def option_name(parameter: str) -> str:
    """How a parameter is called on the command line."""
    return {"output": "-o", "part": "PART"}.get(parameter, "--" + parameter.replace("_", "-"))
