"""What docs/ says is so: its code runs, prints what the page says, and its pictures and links are there.

``mkdocs build --strict`` checks the links anew, and the references to the API; CI calls it by itself.
"""

from __future__ import annotations

import ast
import re
from importlib import import_module
from math import atan2, degrees, sqrt
from pathlib import Path
from urllib.parse import unquote

import pytest
from documented import ROOT, blocks_of, missing, run_python, run_shell
from scipy.special import ellipk
from test_rooms import FOLDER, ROWS

import gyroid_cad
from gyroid_cad.surface.families import SURFACES
from gyroid_cad.surface.fit import FitSettings, fit_patch
from gyroid_cad.surface.fit_report import fit_report
from gyroid_cad.surface.weierstrass import CORNER

DOCS = ROOT / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
IMAGES = sorted((DOCS / "images").iterdir())
MOST_BYTES = 4_000_000


def name_of(path: Path) -> str:
    return path.relative_to(DOCS).as_posix()


def with_language(language: str) -> list[Path]:
    return [page for page in PAGES if any(block.language == language for block in blocks_of(page))]


@pytest.fixture
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("page", with_language("python"), ids=name_of)
def test_the_code_of_a_page_runs_from_top_to_bottom_and_prints_what_the_page_says(
    page: Path, in_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # In this process: CadQuery and build123d take seconds to load. Two tutorials take four to six seconds each, for
    # they cut real parts with the kernel; all the other pages together, as many besides what is loaded.
    blocks = blocks_of(page)
    (in_folder / "lattice.toml").write_text("\n".join(block.text for block in blocks if block.language == "toml"))
    namespace: dict[str, object] = {"__name__": "__main__"}
    for block in blocks:
        if block.language == "python":
            assert run_python(block, capsys, namespace) == (block.printed or "")


@pytest.mark.parametrize("page", with_language("sh"), ids=name_of)
def test_the_commands_of_a_page_run(page: Path, in_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for block in blocks_of(page):
        if block.language == "toml":
            (in_folder / "lattice.toml").write_text(block.text)
        elif block.language == "sh":
            assert missing(block.printed or "", run_shell(block, capsys)) == []


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_what_a_page_says_is_printed_stands_right_below_what_prints_it(page: Path) -> None:
    blocks = blocks_of(page)
    assert sum(block.language == "text" for block in blocks) == sum(block.printed is not None for block in blocks)


@pytest.mark.parametrize("tutorial", sorted((DOCS / "tutorials").glob("*.md")), ids=name_of)
def test_a_tutorial_says_what_its_code_prints(tutorial: Path) -> None:
    assert any(block.language == "python" and block.printed for block in blocks_of(tutorial))


@pytest.mark.parametrize("image", IMAGES, ids=lambda path: path.name)
def test_a_figure_is_a_png_or_svg_that_a_page_shows(image: Path) -> None:
    start = image.read_bytes()[:400]
    assert start.startswith(b"\x89PNG\r\n") if image.suffix == ".png" else b"<svg" in start
    assert any(f"images/{image.name})" in page.read_text() for page in PAGES)


def test_all_the_papers_figures_from_2_to_19_are_there_and_small() -> None:
    numbers = {int(found[1]) for image in IMAGES if (found := re.match(r"fig_(\d\d)", image.name))}
    assert numbers == set(range(2, 20))
    assert sum(image.stat().st_size for image in IMAGES) < MOST_BYTES


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_the_links_of_a_page_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text()):
        if target.startswith(("http://", "https://")):
            continue
        path, _, heading = unquote(target).partition("#")
        # The site has the README's pictures in its folder "gallery".
        if "gallery/" in path:
            assert (ROOT / "images" / Path(path).name).is_file(), target
            continue
        aim = (page.parent / path).resolve() if path else page
        assert aim.is_file(), target
        if heading:
            assert heading in {slug(line) for line in re.findall(r"^#+ (.*)$", aim.read_text(), flags=re.MULTILINE)}, (
                target
            )


def slug(title: str) -> str:
    """As Python-Markdown's toc makes them."""
    return re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", title).strip().lower())


def test_the_fits_table_is_what_fit_report_measures() -> None:
    page = (DOCS / "mathematics" / "fit.md").read_text()
    fits = {"the paper's, 10 \N{MULTIPLICATION SIGN} 10": FitSettings.paper()}
    fits |= {f"ours, {n} \N{MULTIPLICATION SIGN} {n}": FitSettings(n) for n in (10, 14, 20)}
    for name, settings in fits.items():
        found = fit_report(fit_patch(settings))
        gap = "below 1e-15" if found.edge_gap < 1e-15 else f"{found.edge_gap:.1e}"
        cells = [name, f"{found.max_distance:.1e}", f"{found.max_normal_angle:.3f}°"]
        cells += [f"{found.max_mean_curvature:.3g}", f"{found.rms_mean_curvature:.3g}", gap]
        assert f"| {' | '.join(cells)} |" in page


def test_the_level_set_is_as_far_from_the_gyroid_as_the_page_says(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(DOCS / "figures"))
    found = import_module("level_set").measures()
    row = [f"{found.max_mean_curvature:.3g}", f"{found.rms_mean_curvature:.3f}", f"{found.max_distance:.4f} L"]
    page = (DOCS / "mathematics" / "figures.md").read_text()
    assert f"| level set | {' | '.join(row)} |" in page
    assert f"up to {found.max_normal_angle:.2f}° off" in page


def test_the_papers_eq_1_is_wrong_by_what_the_errata_say() -> None:
    page = (DOCS / "mathematics" / "errata.md").read_text()
    # In the corner both integrals are complete: their arguments are 1.
    square = CORNER**2
    quartic = square**2 + 4 * square + 1
    assert 2 * sqrt(2) * CORNER / sqrt(quartic) == pytest.approx(1, rel=1e-14)
    assert (2 + sqrt(3)) * square == pytest.approx(4 * square / (square**2 + 1)) == pytest.approx(1, rel=1e-14)
    printed = 2 * sqrt(2) * CORNER / quartic, 4 * square / sqrt(square**2 + 1)
    assert f"as printed it is {printed[0]:.3f}" in page
    assert f"passes 1 in the corner, {printed[1]:.3f}" in page
    # Eq. (22) reads the second argument as the modulus, of which scipy takes the square.
    angles = [degrees(atan2(ellipk(m), ellipk(n))) for m, n in ((1 / 16, 9 / 16), (1 / 4, 3 / 4))]
    assert f"θ would be {angles[0]:.2f}°, not {angles[1]:.2f}°" in page


def test_the_families_table_is_the_codes() -> None:
    rows = {
        "patches per cell": lambda surface: f"{len(surface.cell)}",
        "area per cell": lambda surface: f"{surface.tube.area:.7f} L²",
        "Euler characteristic per cell": lambda surface: f"{surface.tube.euler_characteristic:.0f}",
        "wall below": lambda surface: f"{surface.tube.max_thickness:.5f} L",
    }
    page = (DOCS / "mathematics" / "families.md").read_text()
    for name, shown in rows.items():
        cells = [shown(SURFACES[surface]) for surface in ("diamond", "gyroid", "primitive")]
        assert f"| {name} | {' | '.join(cells)} |" in page


def test_every_public_name_has_its_place_in_the_reference() -> None:
    shown = "\n".join(page.read_text() for page in (DOCS / "reference").glob("*.md"))
    names = set(re.findall(r"^::: gyroid_cad\.(\w+)$", shown, flags=re.MULTILINE))
    assert names == set(gyroid_cad.__all__) - {"__version__"}
    for module in ("cq_plugin", "bd_objects"):
        public = import_module(f"gyroid_cad.{module}").__all__
        assert set(re.findall(rf"^::: gyroid_cad\.{module}\.(\w+)$", shown, flags=re.MULTILINE)) == set(public)


def test_the_house_s_page_shows_every_room_in_its_order_by_its_own_first_line() -> None:
    rooms = [room for row in ROWS for room in row if not room.startswith("__")]
    page = (DOCS / "development" / "house.md").read_text()
    shown = re.findall(r"^\| `(\w+)` \| (.*) \|$", page, flags=re.MULTILINE)
    assert shown == [(room, first_line(room)) for room in rooms]
    order = "\n".join(", ".join(room for room in row if room in rooms) for row in ROWS if set(row) & set(rooms))
    assert f"```\n{order}\n```" in page


def first_line(room: str) -> str:
    folder = FOLDER / room
    docstring = ast.get_docstring(
        ast.parse((folder / "__init__.py" if folder.is_dir() else folder.with_suffix(".py")).read_text())
    )
    assert docstring is not None
    return docstring.splitlines()[0].replace("``", "`")


def test_nothing_in_the_site_is_fetched_from_elsewhere() -> None:
    settings = (ROOT / "mkdocs.yml").read_text()
    assert "font: false" in settings
    assert "http" not in settings
    assert not re.findall(r"<(?:script|link|img|iframe)|!\[.*?\]\(http", "".join(page.read_text() for page in PAGES))
