"""What control must know again after a restart, as plain values: hands, writes on their way, intervals, interlocks.

All times in it are the monotonic seconds of the process that noted them; `recall` moves them to those of this one.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import TypeGuard, overload

from igrow.edge.guard.point_memory import PointMemory, Sent
from igrow.edge.guard.readback import Readback
from igrow.edge.guard.state import GuardState, PointState

Entry = Mapping[str, object]


def note(state: GuardState, readback: Readback) -> dict[str, object]:
    """Return everything that a restart must not forget."""
    points = {
        name: _note_point(memory, state.points.get(name, PointState())) for name, memory in readback.points.items()
    }
    return {"engaged": sorted(state.engaged), "points": points}


def recall(content: Entry, readback: Readback, later: float, *, same: Collection[str], agree: bool) -> GuardState:
    """Give back to `readback` what was noted, and return the guard's part; what makes no sense is left out.

    `later` is what has to be added to a noted time. Only points in `same` still mean the same register. Without
    `agree` it was noted too long ago to tell a hand by it: what stands in the PLC is then taken as it is found.
    """
    points: dict[str, PointState] = {}
    entries = content.get("points")
    for name, entry in entries.items() if isinstance(entries, Mapping) else ():
        if name in readback.points and name in same and isinstance(entry, Mapping):
            _recall_point(readback.points[name], entry, later, agree=agree)
            points[name] = PointState(
                written=_number(entry, "written"),
                written_at=_number(entry, "written_at", -math.inf) + later,
                taken=_number(entry, "taken"),
                taken_by=str(entry.get("taken_by", "")),
            )
    engaged = content.get("engaged")
    names = [name for name in engaged if isinstance(name, str)] if isinstance(engaged, list) else []
    return GuardState(points, frozenset(names))


def _note_point(memory: PointMemory, state: PointState) -> Entry:
    entry = {
        "stands": memory.stands,
        "answers": memory.answers,
        "sent": _note_sent(memory.sent),
        "late": _note_sent(memory.late),
        "moved_at": memory.moved_at,
        "applied_last": memory.applied_last,
        "hand": memory.hand,
        "held_until": None if memory.hand is None else memory.held_until,
        "ceiling": memory.ceiling,
        "floor": memory.floor,
        "limited_until": memory.limited_until,
        "fell_back_at": memory.fell_back_at,
        "restarted_at": memory.restarted_at,
        "written": state.written,
        "written_at": state.written_at,
        "taken": state.taken,
        "taken_by": state.taken_by,
    }
    return {key: value for key, value in entry.items() if _says_something(value)}


def _recall_point(memory: PointMemory, entry: Entry, later: float, *, agree: bool) -> None:
    # Whatever happened to the PLC in the meantime, nobody looked.
    memory.absence, memory.was_silent, memory.was_interrupted = math.inf, True, True
    memory.hand = _number(entry, "hand")
    memory.held_until = _number(entry, "held_until", -math.inf) + later
    memory.ceiling, memory.floor = _number(entry, "ceiling", math.inf), _number(entry, "floor", -math.inf)
    if not agree:
        return
    memory.stands, memory.answers = _number(entry, "stands"), _number(entry, "answers")
    memory.limited_until = _number(entry, "limited_until", math.inf) + later
    # Seen, and not judged yet: by now the PLC may show no sign of it any more.
    memory.fell_back_at, memory.restarted_at = _time(entry, "fell_back_at", later), _time(entry, "restarted_at", later)
    memory.sent, memory.late = _recall_sent(entry.get("sent"), later), _recall_sent(entry.get("late"), later)
    # A value that stopped short of our write, by a limit of the PLC's or by a hand, is left alone: after a restart too.
    memory.moved_at = _number(entry, "moved_at", -math.inf) + later
    memory.applied_last = _number(entry, "applied_last")


def _note_sent(sent: Sequence[Sent]) -> list[list[object]]:
    return [[one.value, one.at, one.source, one.urgent] for one in sent]


def _recall_sent(rows: object, later: float) -> list[Sent]:
    sent = []
    for row in rows if isinstance(rows, list) else ():
        if isinstance(row, list) and len(row) == 4:
            value, at, source, urgent = row
            if _is_number(value) and _is_number(at):
                sent.append(Sent(float(value), float(at) + later, str(source), bool(urgent)))
    return sent


def _says_something(value: object) -> bool:
    return value not in (None, "", []) and not (isinstance(value, float) and not math.isfinite(value))


@overload
def _number(entry: Entry, key: str) -> float | None: ...
@overload
def _number(entry: Entry, key: str, otherwise: float) -> float: ...
def _number(entry: Entry, key: str, otherwise: float | None = None) -> float | None:
    value = entry.get(key)
    return float(value) if _is_number(value) else otherwise


def _time(entry: Entry, key: str, later: float) -> float | None:
    at = _number(entry, key)
    return None if at is None else at + later


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
