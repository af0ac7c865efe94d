"""The seal of a segment: what it holds, of which site, when, and which segment came before it."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from igrow.core.errors import IgrowError
from igrow.core.exchange.errors import SegmentError

FORMAT = 1
LATEST_YEAR = 9999
"""No calendar of Python's goes further."""
MOST_GIVEN_UP = 100_000
"""Segments: eleven years of hours."""
_NAME = re.compile(r"([0-9a-f]{12})-([0-9]{8})-([0-9a-f]{64})\.zip")
_DIGEST = re.compile(r"[0-9a-f]{64}")


@dataclass(frozen=True, slots=True)
class SegmentName:
    """A segment's file name: with the digest in it, a listing tells what is there, whole or not."""

    chain: str
    """12 hexadecimal digits, drawn when a gateway begins to keep a log."""
    number: int
    """From 1, without gaps."""
    digest: str
    """SHA-256 of the whole file."""

    def __str__(self) -> str:
        return f"{self.chain}-{self.number:08d}-{self.digest}.zip"

    def is_of(self, content: bytes) -> bool:
        """Tell whether a file's content is what this name was given to."""
        return hashlib.sha256(content).hexdigest() == self.digest

    @classmethod
    def parse(cls, text: str) -> SegmentName | None:
        """Return what a file name says, None where it is no segment's."""
        found = _NAME.fullmatch(text)
        return None if found is None else cls(found[1], int(found[2]), found[3])


@dataclass(frozen=True)
class Seal:
    """What stands in `seal.json`. Times are seconds since 1970 UTC on the clock that the log is dated by."""

    site: str
    chain: str
    number: int
    previous: str
    """Digest of the segment before; empty for the first."""
    start: float
    """Rows from this time on are in this segment and in none before it."""
    end: float
    """No row is of this time or later."""
    through: float
    """The log is sealed up to this time: the newest row that any segment so far holds is before it."""
    igrow_version: str
    columns: Mapping[str, str]
    """Quantity -> the unit it was written in."""
    rows: int
    telemetry_digest: str
    records: int
    """Events, writes and alarms."""
    events_digest: str
    last_sequence: int
    """Of the ledger: all records up to this one are in this segment or in one before it."""
    given_up: tuple[tuple[int, int], ...] = ()
    """Numbers (first, last) of segments that were deleted for want of space before a receipt came."""

    def to_json(self) -> dict[str, Any]:
        """Return the document."""
        return {
            "format": FORMAT,
            "site": self.site,
            "chain": self.chain,
            "number": self.number,
            "previous": self.previous,
            "start": format_time(self.start),
            "end": format_time(self.end),
            "through": format_time(self.through),
            "igrow_version": self.igrow_version,
            "telemetry": {"rows": self.rows, "sha256": self.telemetry_digest, "units": dict(self.columns)},
            "events": {"records": self.records, "sha256": self.events_digest, "last_sequence": self.last_sequence},
            "given_up": [list(one) for one in self.given_up],
        }


def read_seal(document: Mapping[str, Any]) -> Seal:
    """Return the seal in a document; raises SegmentError that says what is wrong with it."""
    if document.get("format") != FORMAT:
        raise SegmentError(f"format {document.get('format')!r}, this igrow reads {FORMAT}: update the trainer")
    try:
        telemetry, events = document["telemetry"], document["events"]
        seal = Seal(
            site=_text(document["site"]),
            chain=_text(document["chain"]),
            number=_count(document["number"], least=1),
            previous=_text(document["previous"]),
            start=parse_time(document["start"]),
            end=parse_time(document["end"]),
            through=parse_time(document["through"]),
            igrow_version=_text(document["igrow_version"]),
            columns={_text(name): _text(unit) for name, unit in telemetry["units"].items()},
            rows=_count(telemetry["rows"]),
            telemetry_digest=_text(telemetry["sha256"]),
            records=_count(events["records"]),
            events_digest=_text(events["sha256"]),
            last_sequence=_count(events["last_sequence"]),
            given_up=_ranges(document["given_up"]),
        )
    except (KeyError, TypeError, AttributeError, ValueError, IgrowError) as error:
        raise SegmentError(f"its seal cannot be read: {type(error).__name__}: {error}") from None
    if any(not 0 < first <= last < seal.number for first, last in seal.given_up) or (
        sum(last - first + 1 for first, last in seal.given_up) > MOST_GIVEN_UP
    ):
        raise SegmentError("its seal cannot be read: given_up names no segments before it")
    if seal.previous and not _DIGEST.fullmatch(seal.previous):
        raise SegmentError("its seal cannot be read: previous is no SHA-256")
    return seal


def format_time(seconds: float) -> str:
    """Return ISO 8601 in milliseconds."""
    return f"{np.datetime64(round(seconds * 1000), 'ms')}Z"


def parse_time(text: object) -> float:
    """Return the seconds since 1970 of a time as `format_time` writes it; raises IgrowError."""
    if not isinstance(text, str) or not text.endswith("Z"):
        raise IgrowError(f"{text!r}: a time needs the form 2020-01-31T12:05:00Z")
    try:
        moment = np.datetime64(text[:-1], "ms")
    except ValueError:
        raise IgrowError(f"{text!r}: a time needs the form 2020-01-31T12:05:00Z") from None
    if np.isnat(moment) or not 1 <= moment.astype("datetime64[Y]").astype(int) + 1970 <= LATEST_YEAR:
        raise IgrowError(f"{text!r}: a time needs the form 2020-01-31T12:05:00Z")
    return float(moment.astype(np.int64)) / 1000.0


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{value!r} is no text")
    value.encode()  # half of a surrogate pair is a letter in JSON and in no file
    return value


def _count(value: object, least: int = 0) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or value < least:
        raise TypeError(f"{value!r} is no count")
    return value


def _ranges(value: Sequence[Sequence[int]]) -> tuple[tuple[int, int], ...]:
    return tuple((_count(first), _count(last)) for first, last in value)
