"""The place that an address names, as the gateway reaches it."""

from __future__ import annotations

from pathlib import Path

from igrow.core.exchange import FolderPlace, Place
from igrow.core.exchange.address import parse_address
from igrow.edge.exchange.sftp import SftpPlace


def open_place(text: str, *, known_hosts: str | None = None, identity: str | None = None) -> Place:
    """Return the place at an address; connects nothing yet.

    Raises IgrowError for what is no address, and where a package is missing that it needs.
    """
    address = parse_address(text)
    if address.scheme == "file":
        return FolderPlace(Path(address.path))
    if address.scheme == "sftp":
        pinned = Path(known_hosts) if known_hosts else Path.home() / ".ssh" / "known_hosts"
        return SftpPlace(address, known_hosts=pinned, identity=Path(identity) if identity else None)
    from igrow.core.exchange.remote import open_remote  # noqa: PLC0415  (an extra: igrow[s3])

    return open_remote(address)
