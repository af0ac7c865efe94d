"""The log as the page draws it: the least, mean and greatest value of each of some hundred stretches of time.

The log of a month holds half a million rows; it is read in pieces, and a piece that is over is read once.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from igrow.core.arrays import Floats
from igrow.core.language import N_
from igrow.core.telemetry import Telemetry
from igrow.edge.store import read_telemetry

PIECE = 21_600
"""Seconds of the log that are read at once."""
OPEN = 7200.0
"""Seconds after its end until a piece is over: rows are committed some time after they were read."""
FRESH = 15.0
"""Seconds for which a piece that still grows serves all visitors."""


@dataclass(frozen=True)
class Span:
    """How far back a visitor looks."""

    title: str
    seconds: int
    bucket: int
    """Seconds that become one point."""


SPANS = {
    "day": Span(N_("24 hours"), 86_400, 300),
    "week": Span(N_("7 days"), 7 * 86_400, 1800),
    "month": Span(N_("30 days"), 30 * 86_400, 7200),
}


@dataclass(frozen=True)
class Course:
    """One quantity over time; buckets without a value are left out."""

    time: Floats
    """Middle of each bucket, seconds since 1970 UTC, (n,)."""
    low: Floats
    mean: Floats
    high: Floats


def reduce(log: Telemetry, bucket: int) -> dict[str, Course]:
    """Return least, mean and greatest value of each quantity in each bucket of so many seconds."""
    seconds = log.time.astype(np.int64)
    if not len(seconds):
        return {}
    cell = seconds // bucket
    begins = np.flatnonzero(np.diff(cell, prepend=cell[0] - 1))
    middle = np.asarray((cell[begins] + 0.5) * bucket, dtype=np.float64)
    courses = {}
    for name, values in log.columns.items():
        known = np.isfinite(values)
        count = np.add.reduceat(known.astype(np.float64), begins)
        some = count > 0
        if some.any():
            total = np.add.reduceat(np.where(known, values, 0.0), begins)
            low = np.minimum.reduceat(np.where(known, values, np.inf), begins)
            high = np.maximum.reduceat(np.where(known, values, -np.inf), begins)
            courses[name] = Course(middle[some], low[some], total[some] / count[some], high[some])
    return courses


def join(pieces: Sequence[Mapping[str, Course]]) -> dict[str, Course]:
    """Return courses that follow one another as one."""
    names = dict.fromkeys(name for piece in pieces for name in piece)
    joined = {}
    for name in names:
        found = [piece[name] for piece in pieces if name in piece]
        joined[name] = Course(
            *(np.concatenate([getattr(one, field) for one in found]) for field in ("time", "low", "mean", "high"))
        )
    return joined


class History:
    """Reads the log of a daemon that writes it; what is over is remembered. Safe to call from several threads."""

    def __init__(
        self,
        folder: Path,
        read: Callable[[Path, float, float], Telemetry] = read_telemetry,
        *,
        most_pieces: int = 400,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        """`folder` is that of the store."""
        self._folder = folder
        self._read = read
        self._most = most_pieces
        self._monotonic = monotonic
        self._lock = threading.Lock()
        self._pieces: dict[tuple[int, int], tuple[float, dict[str, Course]]] = {}
        """By number and bucket: until when it counts, on the monotonic clock, and what it holds."""

    def courses(self, span: Span, now: float) -> dict[str, Course]:
        """Return every quantity of the log over a span that ends now; raises StoreError where it cannot be read."""
        first, last = int(now - span.seconds) // PIECE, int(now) // PIECE
        with self._lock:
            pieces = [self._piece(number, span.bucket, now) for number in range(first, last + 1)]
        joined = join(pieces)
        return {name: _since(course, now - span.seconds) for name, course in joined.items()}

    def _piece(self, number: int, bucket: int, now: float) -> dict[str, Course]:
        key, asked = (number, bucket), self._monotonic()
        until, reduced = self._pieces.get(key, (-math.inf, {}))
        if asked < until:
            return reduced
        start = number * PIECE
        reduced = reduce(self._read(self._folder, float(start), float(start + PIECE)), bucket)
        over = bool(reduced) and start + PIECE + OPEN < now
        self._pieces.pop(key, None)
        while len(self._pieces) >= self._most:
            del self._pieces[next(iter(self._pieces))]
        self._pieces[key] = (math.inf if over else asked + FRESH, reduced)
        return reduced


def _since(course: Course, time: float) -> Course:
    kept = course.time >= time
    return Course(course.time[kept], course.low[kept], course.mean[kept], course.high[kept])
