"""Whether the disk or share of the exchange is mounted: its empty mount point takes everything, and nobody reads it."""

from __future__ import annotations

from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.core.exchange import FolderPlace, Place


def file_system_of(place: Place, url: str, folder: Path, before: str) -> str:
    """Return `url` for an exchange on a file system of its own, and nothing for one on the gateway's or on a server.

    Args:
        place: the exchange.
        url: its address.
        folder: of the gateway's own disk.
        before: what this returned in the round before.

    Raises:
        IgrowError: it was on a file system of its own, and is not any more.
        OSError: the disk fails.
    """
    if not isinstance(place, FolderPlace):
        return ""
    near = place.root.absolute()
    while not near.exists():
        near = near.parent
    if near.stat().st_dev != folder.stat().st_dev:
        return url
    if before == url:
        raise IgrowError(
            "its disk or share is not mounted, as it was before: what is to be sent waits. An exchange that is to be "
            "on the gateway's own disk needs a folder of another name"
        )
    return ""
