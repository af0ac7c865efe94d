"""Exports that come as a zip archive: unpacked into a folder beside it, which every command then reads."""

from __future__ import annotations

import io
import zipfile
import zlib
from pathlib import Path, PurePosixPath

from igrow.core.errors import IgrowError
from igrow.trainer.data.cells import ARCHIVE, may_be_table

LARGEST = 4_000_000_000
"""Bytes that are unpacked at most."""
DEEPEST = 3
"""Archives that may lie within each other."""


def unpack(archive: Path, into: Path) -> Path:
    """Unpack the tables of an archive, and of archives in it, into a folder; returns the folder.

    Raises:
        IgrowError: it is no archive, holds no table, is encrypted or damaged, or would become too large.
    """
    try:
        with zipfile.ZipFile(archive) as opened:
            if not _unpacked(archive, opened, into, LARGEST, DEEPEST):
                held = ", ".join(opened.namelist()[:5]) or "nothing"
                raise IgrowError(f"{archive}: no table in it (CSV, Excel or Parquet): it holds {held}")
    except (zipfile.BadZipFile, zlib.error, EOFError):
        raise IgrowError(f"{archive}: is no whole zip archive, or one in it is none") from None
    except (RuntimeError, NotImplementedError) as error:
        raise IgrowError(f"{archive}: cannot be unpacked: {error}") from None
    except OSError as error:
        raise IgrowError(f"{archive}: cannot be unpacked: {error.strerror or error}") from None
    return into


def _unpacked(archive: Path, opened: zipfile.ZipFile, into: Path, room: int, depth: int) -> int:
    """Unpack tables and the archives that lie among them, each of these into a folder of its name; returns bytes."""
    tables = [one for one in opened.infolist() if may_be_table(_own(one.filename))]
    inner = [one for one in opened.infolist() if _own(one.filename).lower().endswith(ARCHIVE)] if depth > 1 else []
    size = sum(one.file_size for one in tables)
    if size + max((one.file_size for one in inner), default=0) > room:
        raise IgrowError(f"{archive}: unpacked it has more than {LARGEST / 1e9:g} GB: unpack it by hand")
    for one in tables:
        opened.extract(one, into)
    for one in inner:
        with zipfile.ZipFile(io.BytesIO(opened.read(one))) as within:
            folder = into.joinpath(*_inside(one.filename)).with_suffix("")
            size += _unpacked(archive, within, folder, room - size, depth - 1)
    return size


def _own(name: str) -> str:
    """Return a file's own name by its name in an archive; empty for files that a Mac adds."""
    parts = PurePosixPath(name).parts
    return parts[-1] if parts and "__MACOSX" not in parts else ""


def _inside(name: str) -> list[str]:
    """Return the parts of a name in an archive that lead nowhere outside the folder."""
    return [part for part in PurePosixPath(name).parts if part not in ("/", "..")]
