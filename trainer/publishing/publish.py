"""The road's last step: a bundle, signed, in the exchange of its site."""

from __future__ import annotations

from pathlib import Path

from igrow.core.bundle import Bundle, read_bundle
from igrow.core.exchange import Below, Place
from igrow.core.exchange.remote import open_place
from igrow.trainer.publishing.repository import publish_in


def publish(bundle: Bundle | Path | str, exchange: Place | Path | str, keys: Path | str) -> Bundle:
    """Test, sign and publish a bundle for the site that its manifest names.

    Args:
        bundle: it, or its folder.
        exchange: a folder, an address such as sftp://user@host/folder, or an open place.
        keys: folder of the signing keys (`igrow-trainer keys create`).

    Raises:
        IgrowError: the bundle fails its self-test, or keys or exchange cannot be used.
    """
    read = bundle if isinstance(bundle, Bundle) else read_bundle(Path(bundle))
    place = open_place(str(exchange)) if isinstance(exchange, Path | str) else exchange
    return publish_in(read.folder, repository_of(place, read.manifest.site), Path(keys))


def repository_of(exchange: Place, site: str) -> Place:
    """Return where the signed bundles of a site are in an exchange."""
    return Below(exchange, f"{site}/bundles")
