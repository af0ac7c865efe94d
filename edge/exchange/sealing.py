"""What of the log is sealed when, whatever the clock does.

How far the log is sealed is counted in rows, never in what a clock showed: a clock that is years ahead for a moment
seals the present day early, and the rest of that day follows; rows that it dated in the future wait there and stand in
nobody's way. While the clock shows times that are sealed already, nothing is due; what was logged meanwhile is sealed
once that is over, or once it has lasted for a whole period and so is the truth.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from igrow.core.telemetry import concatenate
from igrow.core.whole_files import write_whole
from igrow.edge.exchange.outbox import ChainState, Outbox
from igrow.edge.store.store import first_row_time, newest_sequence, read_records_after, read_telemetry

NOTE = "sealed"
"""File beside the log: the chain, and the number of its newest segment."""
GRACE_SECONDS = 120
"""A period is sealed this long after its end, when its last batch has been committed."""
PARTLY_SECONDS = 3600
"""On a stop or for a report, what there is of a period is sealed when it is at least this long."""
SLACK_SECONDS = 3600
"""By how much what a clock did may have begun before a round saw it."""
SHORTEST_SECONDS = 60.0
"""A clock that was behind for less has logged nothing worth sealing."""
MOST_RECORDS = 20_000
"""In one segment; a longer ledger follows in the next ones."""
MOST_SEGMENTS = 64
"""In one round; the next one goes on."""


@dataclass(frozen=True)
class Span:
    """Rows with start <= time < end are due; `through` is where the log is sealed to after that."""

    start: int
    end: int
    moves: bool = True
    """False for rows from before `through`, which a clock that was behind has left."""


def notice(state: ChainState, times: Sequence[float]) -> ChainState:
    """Return the state after the clock showed these times: how far it went behind what is sealed."""
    if not state.through or not times or min(times) >= state.through - GRACE_SECONDS:
        return state
    known = state.behind or times
    return replace(state, behind=(min(*times, *known), min(max(*times, *known), state.through)))


def catch_up(state: ChainState, time: float, period: int) -> tuple[ChainState, Span | None]:
    """Return the state at `time`, and the span that a clock which was behind has left, if that is over."""
    through, behind = state.through, state.behind
    if behind is None:
        return state, None
    if time < through - GRACE_SECONDS:
        if behind[1] - behind[0] >= period:
            return replace(state, through=int(behind[0]) - SLACK_SECONDS, behind=None), None
        return state, None
    state = replace(state, behind=None)
    if behind[1] - behind[0] < SHORTEST_SECONDS:
        return state, None
    end = min(through, int(behind[1]) + SLACK_SECONDS)
    return state, Span(int(behind[0]) - SLACK_SECONDS, end, moves=False)


def due_span(first: int | None, through: int, time: float, period: int, *, partly: bool) -> Span | None:
    """Return the next span to seal where the first row that is not sealed is of time `first`."""
    if first is None:
        return None
    end = (first // period + 1) * period
    start = max(through, end - period)
    if time >= end + GRACE_SECONDS:
        return Span(start, end)
    now = int(time)
    return Span(start, now) if partly and now - first >= PARTLY_SECONDS else None


def seal_due(outbox: Outbox, store: Path, time: float, period: int, *, partly: bool = False) -> int:
    """Seal what is due at `time`; returns the number of new segments.

    Args:
        outbox: where segments go.
        store: folder of the log and the ledger.
        time: the plant's time, seconds since 1970 UTC.
        period: seconds that a segment covers.
        partly: seal also what there is of a period that is not over.

    Raises OSError, and StoreError where the log cannot be read.
    """
    _compare_with_log(outbox, store)
    before = outbox.state.number
    if not outbox.state.sealed_at:
        outbox.move(replace(outbox.state, sealed_at=time))
    outbox.move(notice(outbox.state, [time]))
    state, left = catch_up(outbox.state, time, period)
    if newest_sequence(store) < state.sequence:
        state = replace(state, sequence=0)  # the ledger was lost and began again
    if left is not None:
        _seal(outbox, store, left, time)
        state = replace(state, number=outbox.state.number, digest=outbox.state.digest, sequence=outbox.state.sequence)
    outbox.move(state)
    for span in _spans(outbox, store, time, period, partly):
        _seal(outbox, store, span, time)
    state = outbox.state
    if (
        state.number == before
        and (partly or abs(time - state.sealed_at) >= period)
        and read_records_after(store, state.sequence, 1)
    ):
        # Nothing was measured, and what happened is all the more worth knowing.
        _seal(outbox, store, Span(int(time), int(time)), time)
    return outbox.state.number - before


def _compare_with_log(outbox: Outbox, store: Path) -> None:
    """Begin another chain where the log's folder knows of more than the outbox: that was restored from a backup."""
    try:
        chain, number = (store / NOTE).read_text(encoding="utf-8").split()
        restored = chain == outbox.state.chain and int(number) > outbox.state.number
    except (FileNotFoundError, ValueError):
        return
    if restored:
        outbox.begin_again()


def _note_beside_log(outbox: Outbox, store: Path) -> None:
    note = f"{outbox.state.chain} {outbox.state.number}"
    path = store / NOTE
    if not path.exists() or path.read_text(encoding="utf-8") != note:
        write_whole(path, note.encode())


def _spans(outbox: Outbox, store: Path, time: float, period: int, partly: bool) -> Iterator[Span]:
    if outbox.state.behind is not None:
        return
    for _ in range(MOST_SEGMENTS):
        through = outbox.state.through
        span = due_span(first_row_time(store, through), through, time, period, partly=partly)
        if span is None:
            return
        yield span


def _seal(outbox: Outbox, store: Path, span: Span, time: float) -> None:
    telemetry = read_telemetry(store, span.start, span.end) if span.end > span.start else concatenate([])
    state = outbox.state
    records = read_records_after(store, state.sequence, MOST_RECORDS)
    events = [{"sequence": r.sequence, "category": r.category, "time": r.time, **r.body} for r in records]
    through = state.through
    if len(telemetry) and span.moves:
        through = int(telemetry.time[-1].astype(np.int64)) + 1
    outbox.seal(
        span.start,
        span.end,
        telemetry,
        events,
        through=through,
        sequence=records[-1].sequence if records else state.sequence,
        sealed_at=time,
    )
    _note_beside_log(outbox, store)
