"""A bundle that was let in, and the errors of those that were not.

Apart from `signed_source.py`, so that who only speaks of updates does not load The Update Framework, which takes longer
than most commands need for all other modules together.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from igrow.core.errors import IgrowError

LARGEST_BUNDLE = 512 * 2**20
"""Bytes."""


class UpdateError(IgrowError):
    """A bundle that was not let in, and why; another attempt may succeed."""


class BundleRefusedError(UpdateError):
    """A bundle that is not meant for this gateway, whenever it is tried."""


@dataclass(frozen=True)
class Fetched:
    """A packed bundle whose signatures hold."""

    archive: Path
    identity: str
    """The identity that the publisher signed for it; empty where it named none."""
