"""What can go wrong between gateway and trainer, by what the caller can do about it."""

from __future__ import annotations

from igrow.core.errors import IgrowError


class ExchangeError(IgrowError):
    """The exchange cannot be reached or used now; another attempt may succeed."""


class DamagedError(IgrowError):
    """A file is not the one that was sent; the sender has it still and sends it again."""


class SegmentError(IgrowError):
    """A segment arrived as it was sealed, and what it holds cannot be used; sending it again changes nothing."""
