"""Header of a STEP file: its schema, by whom and of when it is; and names as such files take them."""

from __future__ import annotations

import os
from dataclasses import dataclass
from datetime import UTC, datetime
from unicodedata import category

from gyroid_cad.common.choices import Schema
from gyroid_cad.common.formats import require_schema, stem_of
from gyroid_cad.errors import ParameterError
from gyroid_cad.step.text import quoted
from gyroid_cad.version import __version__

__all__ = ["DESCRIPTION", "PROGRAM", "StepHeader", "header_section", "product_name", "time_stamp"]

DESCRIPTION, PROGRAM = "gyroid lattice", f"gyroid_cad {__version__}"
# Of a string in FILE_NAME (ISO 10303-21, header section schema).
_LONGEST = 256
# Of Unicode: control characters, halves of characters, and separators of lines and paragraphs.
_NOT_TEXT = ("Cc", "Cs", "Zl", "Zp")


@dataclass(frozen=True, slots=True)
class StepHeader:
    """Schema, author and organisation of STEP files, and whether they hold curves in faces' parameters.

    Attributes
    ----------
    schema : {"ap214", "ap242"}
    author, organisation : str
        In any script; unnamed if left out.
    pcurves : bool
        Whether edges have curves in the parameters of their faces too, for receivers that do not make them.
    products : bool
        Whether several bodies are products of an assembly each, for receivers that show no names of bodies.

    Raises
    ------
    ParameterError
    """

    schema: Schema = "ap214"
    author: str = ""
    organisation: str = ""
    pcurves: bool = False
    products: bool = False

    def __post_init__(self) -> None:
        require_schema(self.schema)
        for parameter in ("author", "organisation"):
            text = getattr(self, parameter)
            if not (isinstance(text, str) and len(text) <= _LONGEST and all(map(_is_text, text))):
                accepted = f"text of at most {_LONGEST} characters in one line, no control characters"
                raise ParameterError(parameter, text, accepted)


def header_section(name: str, header: StepHeader, schema: str) -> str:
    """Write the header section of a file (ISO 10303-21, 8.2).

    Parameters
    ----------
    name : str
        Of the product.
    header : StepHeader
    schema : str
        As FILE_SCHEMA has it.
    """
    return (
        f"ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION(('{DESCRIPTION}'),'2;1');\n"
        f"FILE_NAME({quoted(name)},'{time_stamp()}',({quoted(header.author)}),({quoted(header.organisation)}),"
        f"'{PROGRAM}','{PROGRAM}','');\n"
        f"FILE_SCHEMA(('{schema}'));\nENDSEC;\n"
    )


def product_name(path: str | os.PathLike[str], name: str | None = None) -> str:
    """The name, or the file's stem; what is no text in it is replaced."""
    wanted = stem_of(path) if name is None else name
    return "".join(letter if _is_text(letter) else "_" for letter in wanted)


def time_stamp() -> str:
    """The time that a file bears: now, or that of ``SOURCE_DATE_EPOCH``, the convention for reproducible builds."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    moment = datetime.fromtimestamp(int(epoch), UTC) if epoch.isdigit() else datetime.now()
    return moment.strftime("%Y-%m-%dT%H:%M:%S")


def _is_text(letter: str) -> bool:
    return category(letter) not in _NOT_TEXT
