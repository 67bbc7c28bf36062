"""STEP files that are packed: by gzip, or as the one file of a ZIP archive (.stpz)."""

from __future__ import annotations

import gzip
import os
import shutil
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO
from zipfile import ZIP_DEFLATED, BadZipFile, ZipFile, ZipInfo

from gyroid_cad.common.files import replacing, temporary_folder
from gyroid_cad.common.formats import GZIPPED, ZIPPED, stem_of
from gyroid_cad.errors import ExportError

__all__ = ["replacing_step", "unpacked"]

_PART_21 = (".stp", ".step", ".p21")
# Of what is read and written at once. Beyond level 4 numbers become no smaller, but take several times as long.
_BLOCK, _LEVEL = 1 << 20, 4
# Of a file's bytes at most: text in which all is alike, as nobody's solid is, packs by as much.
_MOST_TIMES = 500
# That of every ZIP entry, so that one text gives one archive.
_FIRST_DATE = (1980, 1, 1, 0, 0, 0)


@contextmanager
def replacing_step(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary name for the text of a STEP file; pack it if its ending says so, and move it to ``path``.

    Parameters
    ----------
    path : path-like
        As of :func:`gyroid_cad.common.files.replacing`. An archive holds one file, which is called as it is, ending in
        ``.stp`` (recommended practice of the CAx Implementor Forum for compressed STEP files).

    Raises
    ------
    ExportError
        If the file could not be written or moved.
    """
    name = str(path).lower()
    if not name.endswith((ZIPPED, *GZIPPED)):
        with replacing(path) as temporary:
            yield temporary
        return
    with replacing(path) as temporary, temporary_folder() as folder:
        text = folder / "text.stp"
        yield text
        with text.open("rb") as plain:
            (_zip if name.endswith(ZIPPED) else _gzip)(plain, temporary, f"{stem_of(path)}.stp")


def _zip(plain: IO[bytes], target: Path, name: str) -> None:
    entry = ZipInfo(name, _FIRST_DATE)
    entry.compress_type, entry._compresslevel = ZIP_DEFLATED, _LEVEL  # type: ignore[attr-defined]
    with ZipFile(target, "w") as archive, archive.open(entry, "w", force_zip64=True) as packed:
        shutil.copyfileobj(plain, packed, _BLOCK)


def _gzip(plain: IO[bytes], target: Path, name: str) -> None:
    with target.open("wb") as out, gzip.GzipFile(name, "wb", _LEVEL, out, mtime=0) as packed:
        shutil.copyfileobj(plain, packed, _BLOCK)


@contextmanager
def unpacked(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give the path of a file's text: its own, or that of a temporary file into which it was unpacked.

    Raises
    ------
    ExportError
        If it is not packed as its ending says, is damaged, or an archive does not hold exactly one STEP file.
    """
    name = str(path).lower()
    if not name.endswith((ZIPPED, *GZIPPED)):
        yield Path(path)
        return
    with TemporaryDirectory() as folder:
        text = Path(folder, f"{'archived' if name.endswith(ZIPPED) else 'gzipped'}.stp")
        try:
            if name.endswith(ZIPPED):
                _unzip(path, text)
            else:
                with gzip.open(path) as packed:
                    _copy(path, packed, text)
        # OSError is that of a file which gzip did not write, too, and RuntimeError that of one with a password.
        except (OSError, EOFError, BadZipFile, zlib.error, RuntimeError, NotImplementedError) as problem:
            if isinstance(problem, ExportError):
                raise
            raise ExportError(f"{path} could not be unpacked: {problem}") from None
        yield text


def _unzip(path: str | os.PathLike[str], text: Path) -> None:
    with ZipFile(path) as archive:
        entries = [entry for entry in archive.infolist() if not entry.is_dir()]
        if len(entries) != 1 or not entries[0].filename.lower().endswith(_PART_21):
            names = ", ".join(entry.filename for entry in entries[:3]) or "none"
            raise ExportError(
                f"{path} could not be unpacked: it holds {len(entries)} files ({names}), where exactly one is needed, "
                f"ending in {' or '.join(_PART_21)}"
            )
        with archive.open(entries[0]) as packed:
            _copy(path, packed, text)


def _copy(path: str | os.PathLike[str], packed: IO[bytes] | gzip.GzipFile, text: Path) -> None:
    left = _MOST_TIMES * Path(path).stat().st_size
    with text.open("wb") as out:
        while block := packed.read(_BLOCK):
            left -= len(block)
            if left < 0:
                raise ExportError(f"{path} could not be unpacked: it holds over {_MOST_TIMES} times its own size")
            out.write(block)
