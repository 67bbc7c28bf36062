"""Options that are one of a few words: one list of them, by which types, checks and the command line go."""

from __future__ import annotations

from inspect import Signature, signature
from typing import Any, get_type_hints

import click
import pytest

from gyroid_cad.bd_objects import Gyroid, GyroidFill
from gyroid_cad.cli.app import commands
from gyroid_cad.common.choices import (
    BLOCK_KINDS,
    FITS,
    KINDS,
    SCHEMAS,
    SURFACE_NAMES,
    TRIMS,
    Kind,
    Schema,
    SurfaceName,
    Trim,
)
from gyroid_cad.common.formats import require_schema
from gyroid_cad.cq_plugin import gyroid, gyroid_fill
from gyroid_cad.errors import ParameterError
from gyroid_cad.filling.fill import fill
from gyroid_cad.filling.filled import Filled
from gyroid_cad.filling.wanted import regions_of
from gyroid_cad.lattice import Lattice
from gyroid_cad.surface.families import SURFACES, USUAL

CONTEXT = click.Context(commands)
COMMANDS = {
    name: command for name in commands.list_commands(CONTEXT) if (command := commands.get_command(CONTEXT, name))
}


TYPES = {"kind": Kind, "surface": SurfaceName, "trim": Trim | None, "schema": Schema}
WORDS = {"kind": KINDS, "surface": SURFACE_NAMES, "trim": TRIMS, "schema": SCHEMAS, "fit": FITS}
DOORS = [
    *(Lattice, Lattice.paper, Lattice.write, fill, Filled.write),
    *(gyroid, gyroid_fill, Gyroid.__init__, GyroidFill.__init__),
]


@pytest.mark.parametrize("door", DOORS, ids=lambda door: door.__qualname__)
def test_a_parameter_that_is_one_of_a_few_words_has_their_type_and_one_of_them_if_left_out(door: Any) -> None:
    hints = get_type_hints(door)
    found = {name for name in TYPES if name in hints}
    assert found
    for name in found:
        assert hints[name] == TYPES[name]
        default = signature(door).parameters[name].default
        assert default is not Signature.empty
        assert default is None or default in WORDS[name]


def test_each_word_is_one_that_the_code_behind_it_knows() -> None:
    assert tuple(SURFACES) == SURFACE_NAMES
    assert signature(Lattice).parameters["surface"].default == USUAL.name
    for kind in KINDS:
        assert regions_of(kind, 10.0, None, None if kind == "surface" else 0.3, USUAL.tube).regions
    assert len({require_schema(schema) for schema in SCHEMAS}) == len(SCHEMAS)
    for trim in TRIMS:
        assert Lattice((1, 1, 1), 10, 0.8, trim=trim).trim == trim


def test_another_word_is_refused_with_those_there_are() -> None:
    with pytest.raises(ParameterError, match="kind = 'truss': expected sheet or network-a or network-b or"):
        regions_of("truss", 10.0, 1.0, None, USUAL.tube)  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="schema = 'ap203': expected ap214 or ap242"):
        require_schema("ap203")  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="trim = 'sphere': expected box, or none"):
        Lattice((1, 1, 1), 10, 0.8, trim="sphere")  # type: ignore[arg-type]


@pytest.mark.parametrize("name", COMMANDS)
def test_the_command_line_asks_for_one_of_the_same_words(name: str) -> None:
    for option in COMMANDS[name].params:
        if option.name in WORDS:
            assert isinstance(option.type, click.Choice)
            # The bare surface of a block bounds nothing.
            words = BLOCK_KINDS if option.name == "kind" and name != "fill" else WORDS[option.name]
            assert tuple(option.type.choices) == words
