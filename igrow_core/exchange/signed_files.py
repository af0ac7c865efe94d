"""Which files of a signed repository a timestamp leads to, by their names alone: nothing is verified here.

A listing may show a part of what is there. Who must not miss a file goes by this instead.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from igrow.core.errors import IgrowError
from igrow.core.exchange.documents import LARGEST_DOCUMENT, parse_object
from igrow.core.exchange.errors import ExchangeError
from igrow.core.exchange.place import Place

_NAME = re.compile(r"[0-9A-Za-z][0-9A-Za-z._-]{0,200}")
_DIGEST = re.compile(r"[0-9a-f]{64}")
LARGEST_VERSION = 10**9


@dataclass(frozen=True)
class SignedFiles:
    """What one timestamp stands for."""

    snapshot: int
    """Version of the snapshot."""
    targets: int
    """Version of the targets."""
    metadata: Mapping[str, bytes]
    """Of the folder `metadata`: name -> content."""
    archives: Mapping[str, int]
    """Of the folder `targets`: name -> length in bytes."""


def signed_files(place: Place, timestamp: bytes) -> SignedFiles:
    """Return what `timestamp` leads to at a place; raises ExchangeError where a file on the way is missing or none."""
    try:
        snapshot = _version(parse_object(timestamp, "timestamp.json"), "snapshot.json")
        upper = _read(place, f"{snapshot}.snapshot.json")
        targets = _version(parse_object(upper, f"{snapshot}.snapshot.json"), "targets.json")
        lower = _read(place, f"{targets}.targets.json")
        named = parse_object(lower, f"{targets}.targets.json")["signed"]["targets"]
        archives = {_archive(path, one): int(one["length"]) for path, one in named.items()}
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ExchangeError(f"{place}: no signed repository: {type(error).__name__}: {error}") from None
    except ExchangeError:
        raise
    except IgrowError as error:
        raise ExchangeError(f"{place}: no signed repository: {error}") from None
    metadata = {f"{snapshot}.snapshot.json": upper, f"{targets}.targets.json": lower}
    return SignedFiles(snapshot, targets, metadata, archives)


def _read(place: Place, name: str) -> bytes:
    content = place.get(f"metadata/{name}", LARGEST_DOCUMENT)
    if content is None:
        raise ExchangeError(f"{place}/metadata/{name}: is named by the signed metadata and not there")
    return content


def _version(document: Mapping[str, Any], name: str) -> int:
    version = document["signed"]["meta"][name]["version"]
    if type(version) is not int or not 0 < version < LARGEST_VERSION:
        raise ValueError(f"{name} has no version")
    return version


def _archive(path: object, target: Mapping[str, Any]) -> str:
    digest = target["hashes"]["sha256"]
    if not isinstance(path, str) or not _NAME.fullmatch(path) or not _DIGEST.fullmatch(digest):
        raise ValueError(f"{path!r} is no name of an archive")
    return f"{digest}.{path}"
