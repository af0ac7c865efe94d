"""Exports that come as a zip archive: unpacked into a folder beside it, which every command then reads."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path, PurePosixPath

from igrow.core.errors import IgrowError
from igrow.trainer.data.cells import ARCHIVE, may_be_table

LARGEST = 4_000_000_000
"""Bytes that are unpacked at most."""


def unpack(archive: Path, into: Path) -> Path:
    """Unpack the tables of an archive into a folder; returns the folder.

    Raises:
        IgrowError: it is no archive, holds no table, is encrypted or damaged, or would become too large.
    """
    try:
        with zipfile.ZipFile(archive) as opened:
            tables = [one for one in opened.infolist() if _is_table(one.filename)]
            if not tables:
                held = ", ".join(opened.namelist()[:5]) or "nothing"
                raise IgrowError(f"{archive}: no table in it (CSV, Excel or Parquet): it holds {held}")
            if sum(one.file_size for one in tables) > LARGEST:
                raise IgrowError(f"{archive}: unpacked it has more than {LARGEST / 1e9:g} GB: unpack it by hand")
            for one in tables:
                opened.extract(one, into)
    except (zipfile.BadZipFile, zlib.error, EOFError):
        raise IgrowError(f"{archive}: is no whole zip archive") from None
    except (RuntimeError, NotImplementedError) as error:
        raise IgrowError(f"{archive}: cannot be unpacked: {error}") from None
    except OSError as error:
        raise IgrowError(f"{archive}: cannot be unpacked: {error.strerror or error}") from None
    return into


def is_archive(path: Path) -> bool:
    """Tell whether a file is called an archive."""
    return path.is_file() and path.name.lower().endswith(ARCHIVE)


def _is_table(name: str) -> bool:
    """Tell whether a name in an archive is that of a table; a Mac adds files that are none."""
    parts = PurePosixPath(name).parts
    return bool(parts) and "__MACOSX" not in parts and may_be_table(parts[-1])
