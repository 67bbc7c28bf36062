"""Declarations of options that several commands share: files, triangles, printers, how a command answers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, TypeVar

import click
from click.shell_completion import CompletionItem

from gyroid_cad.common.choices import BODY_NAMES, SCHEMAS
from gyroid_cad.version import __version__

__all__ = [
    "HEADER_KEYS",
    "angle_option",
    "author_options",
    "check_option",
    "deviation_option",
    "file_paths",
    "json_option",
    "one_of",
    "order_option",
    "output_option",
    "printer_option",
    "quiet_option",
    "regions_option",
    "schema_option",
    "version_option",
]

# Of the headers of STEP files.
HEADER_KEYS = ("schema", "author", "organisation", "pcurves", "products")
Declared = TypeVar("Declared", bound=Callable[..., object])


class Decorator(Protocol):
    """Declares an option of a command."""

    def __call__(self, function: Declared, /) -> Declared: ...


def file_paths(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Leave the completion of a path to the shell."""
    return [CompletionItem(incomplete, type="file")]


def _printers(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Printers that are known, and files of one's own."""
    from gyroid_cad.printing.printers import printers

    known = [CompletionItem(key, help=printer.name) for key, printer in printers().items()]
    return [item for item in known if item.value.startswith(incomplete)] or file_paths(context, parameter, incomplete)


def one_of(*words: str) -> Callable[[click.Context, click.Parameter, str], list[CompletionItem]]:
    """Complete to these words, where the type of an option cannot say which they are."""
    return lambda context, parameter, incomplete: [CompletionItem(w) for w in words if w.startswith(incomplete)]


def printer_option(help: str, default: str | None = None) -> Decorator:
    """Declare ``--printer``, by name or by a file of one's own."""
    return click.option(
        "--printer",
        metavar="NAME|FILE.toml",
        default=default,
        show_default=default is not None,
        shell_complete=_printers,
        help=help,
    )


def output_option(endings: str, required: bool = False) -> Decorator:
    """Declare ``-o``, for files with these endings."""
    return click.option(
        "-o", "--output", multiple=True, metavar="FILE", shell_complete=file_paths, help=endings, required=required
    )


def order_option(help: str) -> Decorator:
    """Declare ``--order``, of elements."""
    return click.option(
        "--order",
        type=int,
        default=1,
        show_default=True,
        metavar="1|2",
        shell_complete=one_of("1", "2"),
        help=help,
    )


schema_option = click.option(
    "--schema", type=click.Choice(SCHEMAS), default="ap214", show_default=True, help="Of STEP files."
)


def author_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command the options of by whom a STEP file is, and what else it holds."""
    function = click.option(
        "--products",
        is_flag=True,
        help="Write STEP with several bodies as an assembly of a product each, for programs that show the names of "
        "products and none of solids, as Gmsh does.",
    )(function)
    function = click.option(
        "--pcurves",
        is_flag=True,
        help="Write STEP with edges' curves in the parameters of faces too: half as large again.",
    )(function)
    for name in reversed(HEADER_KEYS[1:3]):
        function = click.option(f"--{name}", metavar="NAME", default="", help="For the headers of STEP files.")(
            function
        )
    return function


regions_option = click.option(
    "--regions",
    type=click.Choice(BODY_NAMES),
    metavar="BODY",
    help="Write .stl of bodies as text, faces of each name as a region, as meshers of OpenFOAM take them: those of "
    "wall, fluid-a, fluid-b or skin, or of all, each face once.",
)
deviation_option = click.option(
    "--deviation",
    type=float,
    metavar="MM",
    help="Of the triangles in .stl, .3mf, .obj and .ply; if left out a thousandth of the cell size or a tenth of a "
    "thin wall; where a part is filled by triangles alone, four thousandths or a twentieth.",
)
angle_option = click.option(
    "--angle",
    type=float,
    default=15.0,
    show_default=True,
    metavar="DEGREES",
    help="Between triangles of a solid that is cut; those of whole patches keep to the deviation alone.",
)
check_option = click.option(
    "--check",
    is_flag=True,
    help="Check each file that was written, as the command check does; the status is 1 if a limit is broken.",
)
json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of the table.")
quiet_option = click.option("--quiet", is_flag=True, help="Print no table and no progress.")


def _print_version(context: click.Context, parameter: click.Parameter, requested: bool) -> None:
    if requested:
        from gyroid_cad.cli.installation import kernel_version

        click.echo(f"{context.info_name} {__version__}, {kernel_version()}")
        context.exit()


def version_option(function: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command the option ``--version``, which tells the kernel's version too and does not load it."""
    option = click.option(
        "--version",
        is_flag=True,
        expose_value=False,
        is_eager=True,
        callback=_print_version,
        help="Show the version, and the kernel's, and exit.",
    )
    return option(function)
