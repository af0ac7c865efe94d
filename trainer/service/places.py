"""The exchange's place as the trainer reaches it: a folder by itself, everything else through fsspec."""

from __future__ import annotations

from pathlib import Path

from igrow.core.exchange import FolderPlace, Place
from igrow.core.exchange.address import parse_address
from igrow.core.exchange.remote import open_remote


def open_place(
    text: str, *, base: Path | None = None, known_hosts: str | None = None, identity: str | None = None
) -> Place:
    """Return the place at an address; a relative folder is below `base`. Raises IgrowError."""
    address = parse_address(text, base)
    if address.scheme == "file":
        return FolderPlace(Path(address.path))
    return open_remote(
        address,
        known_hosts=Path(known_hosts) if known_hosts else None,
        identity=Path(identity) if identity else None,
    )
