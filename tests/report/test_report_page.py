"""gyroid-cad report: a page that needs nothing else, with the numbers of its JSON, and refusals in one line."""

from __future__ import annotations

import contextlib
import io
import json
import re
import shutil
import subprocess
from collections.abc import Callable, Iterator
from html import unescape
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cadquery as cq
import pytest
import trimesh

from gyroid_cad.builds.meshes import mesh_quality
from gyroid_cad.cli.app import main
from gyroid_cad.lattice import Lattice
from gyroid_cad.report.page import page_of, write_page
from gyroid_cad.report.sections import FILE_SECTIONS, LATTICE_SECTIONS, Report, report_on_file, report_on_lattice

Captured = pytest.CaptureFixture[str]

CELL = ["--cells", "1", "1", "1", "--cell-size", "10", "--thickness", "0.8"]
# Attributes whose value a browser fetches, or goes to.
ADDRESSES = {"src", "href", "srcset", "data", "action", "poster", "xlink:href"}
# Of a page without pictures and charts.
FRAME_TAGS = {"html", "head", "meta", "link", "title", "style", "body", "main", "header", "footer", "section"}
PLAIN_TAGS = FRAME_TAGS | {"h1", "h2", "h3", "p", "table", "tbody", "tr", "th", "td", "data"}


class Page(HTMLParser):
    """Numbers, addresses and headings of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.numbers: dict[str, str] = {}
        self.addresses: list[str] = []
        self.tags: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.tags.append(tag)
        if tag == "data":
            self.numbers[str(given["data-key"])] = str(given["value"])
        self.addresses += [str(value) for name, value in attrs if name in ADDRESSES]


@pytest.fixture(scope="module", autouse=True)
def small() -> Iterator[None]:
    """Small pictures and few places: both are looked at in tests of their own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("gyroid_cad.report.page._LARGE", 120)
        patch.setattr("gyroid_cad.report.page._SMALL", 80)
        patch.setattr("gyroid_cad.report.pores._PLACES", 4000)
        yield


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, small: None) -> SimpleNamespace:
    """One run of the command: the page and the JSON."""
    folder = tmp_path_factory.mktemp("report")
    page = folder / "a.html"
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        status = main(["report", "-o", str(page), *CELL, "--subdivisions", "4", "--json"])
    assert status == 0
    return SimpleNamespace(path=page, text=page.read_text(encoding="utf-8"), json=json.loads(printed.getvalue()))


def looked_up(values: Any, key: str) -> Any:
    for part in key.split("."):
        values = values[int(part)] if isinstance(values, list) else values[part]
    return values


def scalars(values: Any, key: str = "") -> dict[str, Any]:
    """Every single number and yes or no of some JSON, by where it is."""
    if isinstance(values, dict):
        return {k: v for name, inner in values.items() for k, v in scalars(inner, f"{key}{name}.").items()}
    return {} if isinstance(values, str | list) or values is None else {key.rstrip("."): values}


def test_every_number_on_the_page_is_the_json_s_and_every_one_of_the_json_is_on_the_page(made: SimpleNamespace) -> None:
    numbers = Page(made.text).numbers
    for key, value in numbers.items():
        assert json.loads(value) == looked_up(made.json, key), key
    told = {section: made.json[section] for section in LATTICE_SECTIONS}
    # Of a mesh's measures those that the table has; the rest is for machines.
    left_out = re.compile(r"quality\.measures\..*\.(undefined|worst_element)$")
    missing = {key for key in scalars(told) if not left_out.match(key)} - set(numbers)
    assert not missing


def test_numbers_are_those_that_python_gives(made: SimpleNamespace) -> None:
    lattice = Lattice((1, 1, 1), 10.0, 0.8)
    measures = made.json["measures"]
    assert measures["volume"] == lattice.wall().volume()
    assert measures["volume_exact"] == lattice.exact_volume
    assert measures["density"] == lattice.volume_fraction
    assert measures["faces_area_exact"] == pytest.approx(200 * lattice.minimal_surface.tube.face_area(0.08), rel=1e-7)
    assert made.json["fit"]["max_normal_angle"] == lattice.report().max_normal_angle
    expected = mesh_quality(lattice.hexahedra(4)).as_dict()
    assert made.json["quality"]["measures"] == json.loads(json.dumps(expected["measures"]))


def test_the_page_holds_all_it_shows_and_runs_nothing(made: SimpleNamespace) -> None:
    page = Page(made.text)
    assert page.tags.count("img") == 4
    assert page.tags.count("svg") == 3
    assert all(address.startswith("data:") for address in page.addresses)
    assert not {"script", "iframe", "object", "embed"} & set(page.tags)
    assert not re.search(r"https?://|url\(|@import", made.text)


def test_what_a_user_wrote_is_text_on_the_page() -> None:
    nasty = "<script>alert(\"x\")</script> & 'more'"
    values = {"thickness": nasty, nasty: 1.0, "map": {"none": nasty}}
    page = page_of(Report(nasty, "lattice", {"parameters": values}, None, {}))
    assert "<script" not in page
    assert set(Page(page).tags) == PLAIN_TAGS


def test_a_section_the_page_does_not_know_is_shown_as_a_table(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(
        LATTICE_SECTIONS,
        "print_check",
        lambda subject: {
            "printer": "resin",
            "fits": True,
            "walls": [{"min_thickness": 0.5, "fine": False}],
            "layers": 3,
        },
    )
    for name in ("measures", "wall", "pores", "fit", "quality"):
        monkeypatch.delitem(LATTICE_SECTIONS, name)
    report = report_on_lattice(Lattice((1, 1, 1), 10.0, 0.8))
    page = page_of(report)
    assert "<h2>Print check</h2>" in page
    assert "resin" in page
    assert Page(page).numbers["print_check.walls.0.min_thickness"] == "0.5"
    assert Page(page).numbers["print_check.fits"] == "true"
    assert report.as_dict()["print_check"]["layers"] == 3


def test_a_lattice_that_varies_and_one_that_is_cut_are_reported_on(capsys: Captured, tmp_path: Path) -> None:
    varying = ["--cells", "1", "1", "1", "--cell-size", "10", "--density", "0.2 + 0.01*x", "--tolerance", "1e-3"]
    cut = [*CELL, "--trim", "box", "--control-points", "6"]
    for options, key in ((varying, "fit.max_wall_error"), (cut, "measures.valid")):
        capsys.readouterr()
        assert main(["report", "-o", str(tmp_path / "a.html"), *options, "--subdivisions", "2", "--json"]) == 0
        numbers = Page((tmp_path / "a.html").read_text(encoding="utf-8")).numbers
        assert json.loads(numbers[key]) == looked_up(json.loads(capsys.readouterr().out), key)


def test_a_lattice_and_its_page_may_stand_in_a_file(capsys: Captured, tmp_path: Path) -> None:
    page, lattice = tmp_path / "a.html", tmp_path / "lattice.toml"
    lattice.write_text(f'output = "{page}"\ncells = [1, 1, 1]\ncell_size = 10\nthickness = 0.8\nsubdivisions = 2\n')
    assert main(["report", str(lattice)]) == 0
    assert str(page) in capsys.readouterr().out
    assert Page(page.read_text(encoding="utf-8")).numbers["quality.subdivisions"] == "2"


@pytest.mark.parametrize("ending", ["step", "brep", "stl", "3mf"])
def test_a_file_of_a_part_is_told_by_its_size_its_faces_or_triangles_and_whether_it_closes(
    capsys: Captured, tmp_path: Path, ending: str
) -> None:
    part, page = tmp_path / f"part.{ending}", tmp_path / "part.html"
    if ending in ("stl", "3mf"):
        trimesh.creation.box(extents=(1, 2, 3)).export(part)
    else:
        shape = cq.Workplane().box(1, 2, 3)
        cq.exporters.export(shape, str(part), exportType=ending.upper())
    assert main(["report", str(part), "-o", str(page), "--json"]) == 0
    values = json.loads(capsys.readouterr().out)
    found = values["file"]
    assert set(FILE_SECTIONS) <= set(values)
    assert (found["volume"], found["area"]) == (pytest.approx(6), pytest.approx(22))
    assert found["extent"] == pytest.approx([1, 2, 3])
    assert found["closed"] is True
    assert found["bytes"] == part.stat().st_size
    assert (found["triangles"] == 12) if ending in ("stl", "3mf") else (found["faces"] == 6 and found["valid"])
    assert all(json.loads(value) == looked_up(values, key) for key, value in Page(page.read_text()).numbers.items())
    assert Page(page.read_text()).tags.count("img") == 4


def hollow_ball() -> trimesh.Trimesh:
    void = trimesh.creation.icosphere(1, 1.0)
    void.invert()
    return trimesh.util.concatenate([trimesh.creation.icosphere(1, 3.0), void])


def cubes_that_touch_in_a_vertex() -> trimesh.Trimesh:
    corners = ([[0, 0, 0], [1, 1, 1]], [[1, 1, 1], [2, 2, 2]])
    return trimesh.util.concatenate([trimesh.creation.box(bounds=bounds) for bounds in corners])


def open_face() -> trimesh.Trimesh:
    return trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [3, 3, 1]], [[0, 1, 2], [1, 3, 2]])


@pytest.mark.parametrize(("part", "pieces"), [(hollow_ball, 1), (cubes_that_touch_in_a_vertex, 2), (open_face, 1)])
def test_a_file_s_pieces_are_one_number_on_the_whole_page(
    tmp_path: Path, part: Callable[[], trimesh.Trimesh], pieces: int
) -> None:
    part().export(tmp_path / "part.stl")
    sections = report_on_file(str(tmp_path / "part.stl")).sections
    checked = [row["finding"] for row in sections["print_check"]["findings"] if row["of"] == "pieces"]
    assert [sections["file"]["pieces"], *checked] == [pieces, str(pieces)]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([*CELL], "Missing option '-o'"),
        ([*CELL, "-o", "a.pdf"], "ending in .html"),
        ([*CELL, "-o", "nowhere/a.html"], "existing folder"),
        ([*CELL, "-o", "a.html", "-o", "b.html"], "one file"),
        ([*CELL, "-o", "a.html", "--subdivisions", "0"], "--subdivisions = 0"),
        ([*CELL, "-o", "a.html", "--density", "0.3"], "exactly one of --thickness, --density"),
        (["-o", "a.html", "--cells", "1", "1", "1", "--cell-size", "10", "--thickness", "9"], "curvature limit"),
        (["part.dwg", "-o", "a.html"], "input file = 'part.dwg': expected a lattice in a .toml file, or"),
        (["missing.step", "-o", "a.html"], "a file that exists"),
        (["broken.stl", "-o", "a.html"], "a file of triangles, binary or text STL, 3MF, OBJ or PLY"),
        (["broken.step", "-o", "a.html"], "could not be read as STEP"),
        (["broken.stl", "-o", "a.html", "--cell-size", "10"], "nothing to choose: without --cell-size"),
        (["-o", "a.html"], "Missing option '--cells'"),
    ],
)
def test_bad_input_is_one_line_and_leaves_no_file(
    capsys: Captured, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("broken.stl", "broken.step"):
        Path(name).write_text("nothing of the kind")
    assert main(["report", *arguments]) in (1, 2)
    out, err = capsys.readouterr()
    assert not out
    assert len(err.splitlines()) == 1
    assert words in err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["broken.step", "broken.stl"]


def test_a_page_that_cannot_be_drawn_leaves_the_old_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.html").write_text("old")
    monkeypatch.setattr("gyroid_cad.report.page._facts", lambda report: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        write_page(Report("a", "file", {}, None, {}), tmp_path / "a.html")
    assert [path.name for path in tmp_path.iterdir()] == ["a.html"]
    assert (tmp_path / "a.html").read_text() == "old"


# Written into a copy of the page: what the browser fetched for it, and whether every picture came out.
PROBE = """<script>addEventListener("load", () => { document.title = "probe " + JSON.stringify({
  fetched: performance.getEntriesByType("resource")
    .map(entry => entry.name).filter(name => !name.startsWith("data:")),
  drawn: [...document.images].filter(image => image.complete && image.naturalWidth > 0).length });
  });</script></body>"""


def in_chromium(page: Path, folder: Path) -> tuple[dict[str, Any], list[str]]:
    """What the probe found in a page, and what the browser wrote on its console."""
    program = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if program is None:
        pytest.skip("needs Chromium: apt-get install chromium")
    probed = folder / "probed.html"
    probed.write_text(page.read_text(encoding="utf-8").replace("</body>", PROBE), encoding="utf-8")
    switches = ["--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr"]
    # No name is found, so that nothing leaves the machine.
    switches += ["--host-resolver-rules=MAP * ~NOTFOUND", f"--user-data-dir={folder / 'profile'}"]
    command = [program, *switches, "--dump-dom", probed.as_uri()]
    run = subprocess.run(command, capture_output=True, encoding="utf-8", check=True, timeout=60)
    title = re.search(r"<title>probe (.*?)</title>", run.stdout)
    assert title is not None, run.stderr[-2000:]
    return json.loads(unescape(title[1])), [line for line in run.stderr.splitlines() if "CONSOLE" in line]


def test_the_page_opens_in_chromium_without_a_request_or_a_word_on_the_console(
    made: SimpleNamespace, tmp_path: Path
) -> None:
    probe, console = in_chromium(made.path, tmp_path)
    assert probe == {"fetched": [], "drawn": 4}
    assert console == []


def test_a_page_that_does_fetch_and_complain_is_found_out(tmp_path: Path) -> None:
    page = tmp_path / "bad.html"
    page.write_text(
        '<html><head><title>bad</title></head><body><img src="http://example.invalid/a.png">'
        '<script>console.error("alas")</script></body></html>'
    )
    probe, console = in_chromium(page, tmp_path)
    assert probe["fetched"] == ["http://example.invalid/a.png"]
    assert any("alas" in line for line in console)
