"""The README's pictures, images/*.png, as gallery/*.png of the site: one copy serves both."""

from __future__ import annotations

from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

PICTURES = Path(__file__).parents[2] / "images"


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pictures to what the site is built of."""
    for picture in sorted(PICTURES.glob("*.png")):
        files.append(File.generated(config, f"gallery/{picture.name}", abs_src_path=str(picture)))
    return files
