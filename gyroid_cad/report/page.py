"""One page of HTML that holds all it needs: style, charts and pictures; no script, no address but of itself.

Every number stands in a ``<data>`` element whose ``value`` is the number in full and whose ``data-key`` is where it is
in the JSON; what is shown is rounded. Every text is escaped.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from gyroid_cad.common.files import replacing
from gyroid_cad.common.formats import HTML, require_output
from gyroid_cad.mesh.finite_elements.summaries import shown_name
from gyroid_cad.render.drawing import draw, snug_size
from gyroid_cad.render.facets import COLOURS, Facets
from gyroid_cad.render.picture import VIEWS, data_uri, png
from gyroid_cad.report.charts import NOTES, STYLE, TITLES, histogram, label_of
from gyroid_cad.report.sections import NONE, Report
from gyroid_cad.version import __version__

__all__ = ["page_of", "require_page", "write_page"]

Values = Mapping[str, Any]

# In pixels: of the first picture and of the others.
_LARGE, _SMALL = 640, 400
_SIGNIFICANT = 6
# Numbers smaller than this are shown with a power of ten.
_SMALLEST_PLAIN = 1e-3
_BEYOND = {
    "endless": "one cell is measured, among endless others like it",
    "continued": "the lattice is taken to go on",
    "open": "open: no wall follows, and spheres on the border may be too large",
}
_DISTRIBUTION = ("smallest", "tenth", "median", "mean", "ninetieth", "largest")
_IN_WORDS = {"tenth": "10 % below", "ninetieth": "90 % below"}
# Shown large at the top: section, value, label.
_FACTS = (
    ("measures", "density", "density"),
    ("measures", "wall_thickness", "wall"),
    ("pores", "sizes.median", "median pore"),
    ("pores", "sizes.largest", "largest pore"),
    ("measures", "volume", "volume"),
    ("measures", "area_per_volume", "area / volume"),
    ("file", "extent", "extent"),
    ("file", "volume", "volume"),
    ("file", "area", "area"),
    ("file", "closed", "closed"),
)
# In the order of their colours.
_FACES = ("face B", "face A", "rim")
_FACT_UNITS = {"median pore": "mm", "largest pore": "mm"}


def require_page(path: str | os.PathLike[str]) -> Path:
    """Check, before anything is measured, that a page can be put at a path.

    Raises
    ------
    ParameterError
    """
    return require_output(path, [HTML])


def write_page(report: Report, path: str | os.PathLike[str]) -> Path:
    """Write a report as one HTML file, whole or not at all.

    Raises
    ------
    ParameterError, ExportError
    """
    target = require_page(path)
    page = page_of(report)
    with replacing(target) as temporary:
        # A file's name may hold bytes that are no text.
        temporary.write_text(page, encoding="utf-8", errors="backslashreplace")
    return target


def page_of(report: Report) -> str:
    """A report as HTML.

    Parameters
    ----------
    report : Report
    """
    title = escape(report.title)
    body = [
        f"<header><h1>{title}</h1><p>Lengths in millimetres, angles in degrees.</p></header>",
        _facts(report),
        _pictures(report.facets),
        *(_section(name, values) for name, values in report.sections.items()),
        f"<footer>gyroid-cad {escape(__version__)}</footer>",
    ]
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        # Without an icon of its own a browser asks for one where the page came from.
        f'<link rel="icon" href="data:,">\n<title>{title}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<main>\n'
        + "\n".join(body)
        + "\n</main>\n</body>\n</html>\n"
    )


def _facts(report: Report) -> str:
    cards = []
    for section, path, label in _FACTS:
        value: Any = report.sections.get(section, {})
        for key in path.split("."):
            value = value.get(key) if isinstance(value, Mapping) else None
        if value is not None:
            unit = _FACT_UNITS.get(label, label_of(path)[1])
            shown = _shown(value, f"{section}.{path}", digits=4)
            cards.append(
                f'<div class="fact"><b>{shown}</b><span>{escape(label)}{", " + unit if unit else ""}</span></div>'
            )
    return f'<div class="facts">{"".join(cards)}</div>' if cards else ""


def _pictures(facets: Facets | None) -> str:
    if facets is None:
        return '<section><h2>Pictures</h2><p class="note">There is nothing to be seen.</p></section>'
    figures = []
    for index, (name, camera) in enumerate(VIEWS.items()):
        width, height = snug_size([facets], camera, _SMALL if index else _LARGE)
        image = data_uri(png(draw([facets], (width, height), camera)))
        figures.append(
            f'<figure><img src="{image}" width="{width}" height="{height}" '
            f'alt="{escape(name)}"><figcaption>{escape(name)}</figcaption></figure>'
        )
    # What is no lattice has one colour.
    several = bool(np.ptp(facets.colours, axis=(0, 1)).any())
    key = f'<p class="note">{"".join(map(_swatch, _FACES, COLOURS))}</p>' if several else ""
    views = f'<div class="views">{"".join(figures)}</div>'
    return f"<section><h2>From the corner and from three sides</h2>{key}{views}</section>"


def _swatch(name: str, colour: tuple[float, float, float]) -> str:
    mixed = ",".join(str(round(255 * part)) for part in colour)
    return f'<span class="key" style="background:rgb({mixed})"></span>{escape(name)}'


def _section(name: str, values: Values) -> str:
    title = TITLES.get(name, name.replace("_", " ").capitalize())
    note = f'<p class="note">{escape(NOTES[name])}</p>' if name in NOTES else ""
    if NONE in values:
        content = f"<p>None: {escape(str(values[NONE]))}.</p>"
    else:
        content = {"wall": _wall, "pores": _pores, "quality": _quality}.get(name, _table)(values, name)
    return f'<section id="{escape(name)}"><h2>{escape(title)}</h2>{note}{content}</section>'


def _table(values: Values, key: str) -> str:
    """Values one below the other; those that hold others get a heading, and long lists are for the JSON only."""
    rows, below = [], []
    for name, value in values.items():
        label, unit = label_of(name)
        where = f"{key}.{name}"
        if isinstance(value, Mapping):
            below.append(
                f"<h3>{escape(label[:1].upper() + label[1:])}</h3>"
                + (f"<p>None: {escape(str(value[NONE]))}.</p>" if NONE in value else _table(value, where))
            )
        elif isinstance(value, list) and value and all(isinstance(row, Mapping) for row in value):
            below.append(f"<h3>{escape(label[:1].upper() + label[1:])}</h3>{_rows(value, where)}")
        elif not (isinstance(value, list) and len(value) > _SIGNIFICANT):
            rows.append(f"<tr><th>{escape(label)}</th><td>{_shown(value, where)} {escape(unit)}</td></tr>")
    table = f'<table class="facts-table"><tbody>{"".join(rows)}</tbody></table>' if rows else ""
    return table + "".join(below)


def _rows(items: list[Any], key: str) -> str:
    """A list of things that have the same values, as a table."""
    names = list(dict.fromkeys(name for item in items for name in item))
    head = "".join(f"<th>{escape(', '.join(filter(None, label_of(name))))}</th>" for name in names)
    body = "".join(
        "<tr>" + "".join(f"<td>{_shown(item.get(name), f'{key}.{index}.{name}')}</td>" for name in names) + "</tr>"
        for index, item in enumerate(items)
    )
    return f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'


def _wall(values: Values, key: str) -> str:
    thickness, error = values["thickness"], values["error"]
    # A wall that is the same everywhere has no histogram worth looking at, but its error has.
    varies = thickness["largest"] - thickness["smallest"] > 1e-2 * thickness["mean"]
    parts = [
        _distribution("Thickness", thickness, f"{key}.thickness", "mm", chart=varies),
        _distribution("Error: measured less asked for", error, f"{key}.error", "µm"),
    ]
    return f'<div class="columns">{"".join(parts)}</div>'


def _pores(values: Values, key: str) -> str:
    rest = {name: value for name, value in values.items() if name not in ("sizes", "beyond")}
    beyond = escape(_BEYOND.get(values["beyond"], str(values["beyond"])))
    chart = _distribution("By volume", values["sizes"], f"{key}.sizes", "mm")
    table = f"<div><h3>Inscribed spheres</h3><p>Beyond the block: {beyond}.</p>{_table(rest, key)}</div>"
    return f'<div class="columns">{chart}{table}</div>'


def _distribution(title: str, values: Values, key: str, unit: str, chart: bool = True) -> str:
    marks = [("median", values["median"])]
    picture = histogram(values["edges"], values["shares"], f"{title.lower()}, {unit}", marks) if chart else ""
    rows = "".join(
        f"<tr><th>{escape(_IN_WORDS.get(name, name))}</th><td>{_shown(values[name], f'{key}.{name}')} {unit}</td></tr>"
        for name in _DISTRIBUTION
    )
    table = f'<table class="facts-table"><tbody>{rows}</tbody></table>'
    return f"<div><h3>{escape(title)}</h3>{picture}{table}</div>"


def _quality(values: Values, key: str) -> str:
    rest = {name: value for name, value in values.items() if name != "measures"}
    columns = ("smallest", "mean", "largest", "standard_deviation", "bound", "beyond")
    head = "".join(f'<th class="number">{escape(name.replace("_", " "))}</th>' for name in columns)
    body = "".join(
        f"<tr><th>{escape(shown_name(measure))}</th>"
        + "".join(
            f'<td class="number">{_shown(summary[name], f"{key}.measures.{measure}.{name}", digits=4)}</td>'
            for name in columns
        )
        + "</tr>"
        for measure, summary in values["measures"].items()
    )
    table = f'<div class="scroll"><table><thead><tr><th></th>{head}</tr></thead><tbody>{body}</tbody></table></div>'
    chart = _jacobians(values["measures"]["scaled_jacobian"])
    return f'<div class="columns"><div>{chart}</div><div>{_table(rest, key)}</div></div>{table}'


def _jacobians(summary: Values) -> str:
    """The histogram of the scaled Jacobian, without the bins that are empty at both ends."""
    counts, edges = summary["counts"], summary["edges"]
    used = [index for index, count in enumerate(counts) if count]
    first, last = max(used[0] - 1, 0), min(used[-1] + 2, len(counts))
    shares = [count / sum(counts) for count in counts[first:last]]
    return histogram(edges[first : last + 1], shares, "scaled Jacobian", [("bound", summary["bound"])])


def _shown(value: Any, key: str, digits: int = _SIGNIFICANT) -> str:
    """A value as HTML: numbers rounded, and in full for whoever reads the page by machine."""
    if value is None:
        return ""
    if isinstance(value, bool):
        word = "yes" if value else "no"
        return f'<data class="{word}" value="{str(value).lower()}" data-key="{escape(key)}">{word}</data>'
    if isinstance(value, int | float):
        return f'<data value="{value!r}" data-key="{escape(key)}">{escape(_rounded(value, digits))}</data>'
    if isinstance(value, list):
        joined = " x " if key.endswith(("cells", "extent")) else ", "
        return joined.join(_shown(part, f"{key}.{index}", digits) for index, part in enumerate(value))
    return escape(str(value))


def _rounded(value: float, digits: int) -> str:
    if isinstance(value, int):
        return f"{value:,}"
    if value and (abs(value) < _SMALLEST_PLAIN or abs(value) >= 10.0**9):
        return f"{value:.2e}"
    return f"{value + 0.0:.{digits}g}" if abs(value) < 10.0**digits else f"{value:,.0f}"
