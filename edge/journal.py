"""Writes down what a cycle did: telemetry, the ledger of writes and clamps, alarms, and readable log lines.

Rows need a date. While the clock cannot be trusted, telemetry waits in memory with its monotonic time and is dated
back once the clock is right; records are kept at once, without a date, as they may be all that a crash leaves.
"""

from __future__ import annotations

import logging
import math
from collections import deque
from collections.abc import Collection, Mapping, Sequence

from igrow.core.quantities import QUANTITIES
from igrow.edge.alarm_levels import Level
from igrow.edge.alarms import AlarmBoard
from igrow.edge.guard import Clamp, Finding, Force, WriteOutcome
from igrow.edge.guard.findings import Outcome, Problem
from igrow.edge.image import Image, Value
from igrow.edge.ports import Store
from igrow.edge.records import AlarmRecord, WriteRecord
from igrow.edge.sensors.consequences import CONSEQUENCES
from igrow.edge.sentences import log_event

WAITING_ROWS = 20_000
"""Undated rows kept in memory: more than two days at one each 10 s."""
SHOWN_CLAMPS = 50
SILENT_CYCLES = 3
"""Cycles without any answer after which a unit counts as down; a start or a hiccup is no alarm."""
SENSOR_CALM = 900.0
"""Seconds for which a sensor must be well until its alarm ends, so that one at the edge of its range is one alarm."""
BUS_CALM = 60.0
"""Seconds for which nobody may have wanted a write that failed, until its alarm ends."""
_EVENTS = {
    Outcome.BY_HAND: "changed_by_hand",
    Outcome.FALLBACK: "plc_fell_back",
    Outcome.RESTARTED: "plc_restarted",
    Outcome.CROSSED: "setpoints_crossed",
    Outcome.HAND_ENDED: "hand_no_longer_respected",
}

log = logging.getLogger("igrow.edge")


class Journal:
    """The one place that talks to the store about what happened."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._waiting: deque[tuple[float, Mapping[str, Value]]] = deque(maxlen=WAITING_ROWS)
        self._standing: dict[str, tuple[str, str, float | None]] = {}
        """By point: the clamp (kind, source, request) that was last written down and still stands."""
        self._silent_cycles: dict[str, int] = {}
        self._senseless: set[str] = set()
        self._bus_alarms: set[str] = set()
        self._forces: set[str] = set()
        self._time: float | None = None
        self._monotonic = 0.0
        self.clamps: deque[WriteRecord] = deque(maxlen=SHOWN_CLAMPS)
        self.alarms = AlarmBoard(self._alarm)

    def begin(self, image: Image) -> None:
        """Date everything that follows by this image."""
        self._time, self._monotonic = image.true_time, image.monotonic

    def event(self, kind: str, **detail: object) -> None:
        """Write down an event."""
        self._store.record_event(self._time, kind, detail)
        log_event(kind, detail)

    def telemetry(self, image: Image, marks: Mapping[str, Value]) -> None:
        """Write down the values of one image with marks of our own, and those that waited for a date."""
        row = {name: value for name, value in {**image.values, **marks}.items() if name in QUANTITIES}
        if image.true_time is None:
            if image.link_ok:
                self._waiting.append((image.monotonic, row))
            return
        while self._waiting:
            monotonic, earlier = self._waiting.popleft()
            self._store.append(image.true_time - (image.monotonic - monotonic), earlier)
        if image.link_ok:
            self._store.append(image.true_time, row)

    def sensors(self, image: Image) -> None:
        """Raise an alarm for each value that control cannot use, and clear those that are well again.

        A unit that does not answer, or makes no sense, is one alarm, and not one for each of its points.
        """
        for name, value in image.values.items():
            usable = CONSEQUENCES[value.quality].control or value.in_doubt
            text = "" if usable or not image.reaches(name) else f"{name} is {value.quality.value}: {value.why}"
            self.alarm(f"sensor {name}", text, calm=SENSOR_CALM)
        self._links(image)
        self._understood(image)

    def _understood(self, image: Image) -> None:
        """Raise an alarm for each unit whose numbers make no sense, or are another one's."""
        self._senseless |= image.senseless.keys()
        for unit in self._senseless:
            lost, text = image.senseless.get(unit), ""
            if lost is not None:
                text = f"{lost.what}, so nothing is written there, no heartbeat either: {lost.question}"
            self.alarm(f"registers {unit}".strip(), text)

    def _links(self, image: Image) -> None:
        nobody = not any(image.answers(name) for name in image.values)
        silent = {"": frozenset(image.values)} if nobody else image.silent
        self._silent_cycles = dict.fromkeys(self._silent_cycles, 0) | {
            unit: self._silent_cycles.get(unit, 0) + 1 for unit in silent
        }
        for unit, cycles in self._silent_cycles.items():
            text = "no point of the PLC can be read: check cable, address and power"
            if unit:
                points = ", ".join(sorted(silent.get(unit, ())))
                text = f"unit {unit} does not answer: check cable, address and power; not known: {points}"
            self.alarm(f"link {unit}".strip(), text if cycles >= SILENT_CYCLES else "")

    def findings(self, findings: Sequence[Finding], respect_hand: float) -> None:
        """Write down what the PLC showed of our writes and of other hands."""
        for found in findings:
            if found.outcome in (Outcome.CONFIRMED, Outcome.UNCONFIRMED):
                self._write(found.point, found.expected, found.shown, found.source, found.text, found.outcome.value)
                continue
            detail = {"point": found.point, "expected": found.expected, "shown": found.shown}
            if found.outcome is Outcome.BY_HAND:
                detail["respected_for_seconds"] = respect_hand
            self.event(_EVENTS[found.outcome], **detail)

    def problems(self, problems: Mapping[str, Problem | None]) -> None:
        """Raise an alarm for each point that does not show what was written, and clear those that do again."""
        for name, problem in problems.items():
            level = Level.WARNING if problem is not None and problem.minor else None
            self.alarm(f"write {name}", "" if problem is None else problem.text, level)

    def interlocks(self, engaged: Sequence[Force], points: Collection[str]) -> None:
        """Raise an alarm while an interlock moves something that this PLC lets us write."""
        texts: dict[str, str] = {}
        for force in engaged:
            moved = [name for name in force.bounds if name in points]
            if moved:
                texts[force.name] = f"interlock {force.name} rules {', '.join(moved)}: {force.why}"
        for name in self._forces | texts.keys():
            self.alarm(f"interlock {name}", texts.get(name, ""))
        self._forces = set(texts)

    def ledger(self, clamps: Sequence[Clamp], outcomes: Sequence[WriteOutcome], pending: Collection[str] = ()) -> None:
        """Write down each clamp when it begins, and each write; `pending` points still wait for their reading."""
        standing: dict[str, tuple[str, str, float | None]] = {}
        for clamp in clamps:
            key = f"{clamp.point} {clamp.kind}"
            standing[key] = (clamp.kind, clamp.source, clamp.requested)
            if self._standing.get(key) != standing[key]:
                record = self._write(clamp.point, clamp.requested, clamp.applied, clamp.source, clamp.reason, "clamped")
                self.clamps.appendleft(record)
        self._standing = standing
        for outcome in outcomes:
            write = outcome.write
            sent = "written" if outcome.may_have_arrived else "failed"
            reason = write.reason if outcome.error is None else str(outcome.error)
            self._write(write.point, write.requested, write.value, write.source, reason, sent)
        self._buses(outcomes, pending)

    def _buses(self, outcomes: Sequence[WriteOutcome], pending: Collection[str]) -> None:
        """Raise an alarm for each write that the bus did not carry; it ends with the write, or when nobody wants it."""
        errors = {o.write.point: f"{o.write.point}: {o.error}" for o in outcomes if o.error is not None}
        written = {o.write.point for o in outcomes} - errors.keys()
        for name in self._bus_alarms - errors.keys():
            if name in written or name not in pending:
                # A ramp that is refused asks again and again, with cycles between in which it asks for nothing.
                self.alarm(f"bus {name}", "", calm=0.0 if name in written else BUS_CALM)
        self._bus_alarms &= {record.name.removeprefix("bus ") for record in self.alarms.active}
        for name, text in errors.items():
            self.alarm(f"bus {name}", text)
            self._bus_alarms.add(name)

    def alarm(self, name: str, text: str, level: Level | None = None, *, calm: float = 0.0) -> None:
        """Raise the alarm, or clear it with an empty text that has held for `calm` seconds."""
        self.alarms.set(name, text, self._monotonic, self._time, level, calm=calm)

    def _alarm(self, record: AlarmRecord) -> None:
        self._store.record_alarm(record)
        log.warning("%s: %s", "ALARM" if record.active else "over", record.text)

    def _write(
        self,
        point: str,
        requested: float | None,
        applied: float | None,
        source: str,
        reason: str,
        outcome: str,
    ) -> WriteRecord:
        if requested is not None and not math.isfinite(requested):
            requested = None
        record = WriteRecord(self._time, self._monotonic, point, requested, applied, source, reason, outcome)
        self._store.record_write(record)
        return record
