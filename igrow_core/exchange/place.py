"""A place that holds files: what both sides need of a folder, an SFTP server or a bucket, and the folder itself."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from igrow.core.exchange.errors import ExchangeError
from igrow.core.whole_files import sync_folder, write_whole


@dataclass(frozen=True, slots=True)
class Entry:
    """One file of a folder."""

    name: str
    size: int


class Place(Protocol):
    """Files under names such as `greenhouse/segments/x.zip`. Every call may take long, and raises ExchangeError.

    A file appears whole or not at all. Names that begin with a dot are the place's own.
    """

    def entries(self, folder: str) -> list[Entry]:
        """Return the files directly in `folder`, by name; none where there is no such folder."""

    def get(self, path: str, largest: int) -> bytes | None:
        """Return a file's content, None where there is none; raises ExchangeError where it is above `largest` bytes."""

    def put(self, path: str, content: bytes) -> None:
        """Write a file in the place of an earlier one."""

    def delete(self, path: str) -> None:
        """Delete a file; one that is not there is no error."""


class FolderPlace:
    """A folder of this machine: a disk, a mounted share, a USB stick."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def __str__(self) -> str:
        return str(self.root)

    def entries(self, folder: str) -> list[Entry]:
        """Return the files directly in `folder`, by name."""
        try:
            found = [
                Entry(path.name, path.stat().st_size)
                for path in (self.root / folder).iterdir()
                if path.is_file() and not path.name.startswith(".")
            ]
        except FileNotFoundError:
            return []
        except OSError as error:
            raise self._away(folder, error) from None
        return sorted(found, key=lambda entry: entry.name)

    def folders(self) -> list[str]:
        """Return the names of the folders directly in it."""
        try:
            return sorted(path.name for path in self.root.iterdir() if path.is_dir() and not path.name.startswith("."))
        except FileNotFoundError:
            return []
        except OSError as error:
            raise self._away("", error) from None

    def get(self, path: str, largest: int) -> bytes | None:
        """Return a file's content, or None."""
        file = self.root / path
        try:
            # A pipe or a device would block or never end.
            if not file.is_file():
                return None
            with file.open("rb") as stream:
                content = stream.read(largest + 1)
        except OSError as error:
            raise self._away(path, error) from None
        if len(content) > largest:
            raise ExchangeError(f"{file}: more than {largest} bytes")
        return content

    def put(self, path: str, content: bytes) -> None:
        """Write a file, durably."""
        file = self.root / path
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            write_whole(file, content)
            sync_folder(file.parent)
        except OSError as error:
            raise self._away(path, error) from None

    def delete(self, path: str) -> None:
        """Delete a file."""
        try:
            (self.root / path).unlink(missing_ok=True)
        except OSError as error:
            raise self._away(path, error) from None

    def _away(self, path: str, error: OSError) -> ExchangeError:
        return ExchangeError(f"{self.root / path}: {error.strerror or error}")


class Below:
    """A folder of a place, as a place of its own."""

    def __init__(self, place: Place, folder: str) -> None:
        self._place = place
        self._folder = folder

    def __str__(self) -> str:
        return f"{self._place}/{self._folder}"

    def entries(self, folder: str) -> list[Entry]:
        """Return the files directly in `folder`, by name."""
        return self._place.entries(f"{self._folder}/{folder}")

    def get(self, path: str, largest: int) -> bytes | None:
        """Return a file's content, or None."""
        return self._place.get(f"{self._folder}/{path}", largest)

    def put(self, path: str, content: bytes) -> None:
        """Write a file in the place of an earlier one."""
        self._place.put(f"{self._folder}/{path}", content)

    def delete(self, path: str) -> None:
        """Delete a file."""
        self._place.delete(f"{self._folder}/{path}")
