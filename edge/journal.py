"""Writes down what a cycle did: telemetry, the ledger of writes and clamps, alarms, and readable log lines.

Rows need a date. While the clock cannot be trusted, telemetry waits in memory with its monotonic time and is dated
back once the clock is right; records are kept at once, without a date, as they may be all that a crash leaves.
"""

from __future__ import annotations

import logging
import math
from collections import deque
from collections.abc import Mapping, Sequence

from igrow.core.quantities import QUANTITIES
from igrow.edge.alarm_levels import Level
from igrow.edge.alarms import AlarmBoard
from igrow.edge.guard import Clamp, Finding, WriteOutcome
from igrow.edge.guard.readback import Outcome
from igrow.edge.image import Image, Value
from igrow.edge.ports import AlarmRecord, Store, WriteRecord
from igrow.edge.sensors.consequences import CONSEQUENCES
from igrow.edge.sentences import log_event

WAITING_ROWS = 20_000
"""Undated rows kept in memory: more than two days at one each 10 s."""
SHOWN_CLAMPS = 50
SILENT_CYCLES = 3
"""Cycles without any answer after which the line counts as down; a start or a hiccup is no alarm."""

log = logging.getLogger("igrow.edge")


class Journal:
    """The one place that talks to the store about what happened."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._waiting: deque[tuple[float, Mapping[str, Value]]] = deque(maxlen=WAITING_ROWS)
        self._standing: dict[str, tuple[str, str, float | None]] = {}
        """By point: the clamp (kind, source, request) that was last written down and still stands."""
        self._silent_cycles = 0
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

    def telemetry(self, image: Image) -> None:
        """Write down the values of one image, and those that waited for a date."""
        row = {name: value for name, value in image.values.items() if name in QUANTITIES}
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
        """Raise an alarm for each value that control cannot use, and clear those that are well again."""
        for name, value in image.values.items():
            usable = CONSEQUENCES[value.quality].control
            text = "" if usable or not image.link_ok else f"{name} is {value.quality.value}: {value.why}"
            self.alarm(f"sensor {name}", text)
        self._silent_cycles = 0 if image.link_ok else self._silent_cycles + 1
        silent = self._silent_cycles >= SILENT_CYCLES
        self.alarm("link", "no point of the PLC can be read: check cable, address and power" if silent else "")

    def findings(self, findings: Sequence[Finding], respect_hand: float) -> None:
        """Write down what the PLC showed of our writes and of other hands."""
        for found in findings:
            if found.outcome is Outcome.CONFIRMED:
                self._write(found.point, found.expected, found.shown, found.source, "", "confirmed")
                self.alarm(f"write {found.point}", "")
            elif found.outcome is Outcome.UNCONFIRMED:
                text = f"{found.expected:g} was written to {found.point}, but the PLC shows {_number(found.shown)}"
                self._write(found.point, found.expected, found.shown, found.source, text, "unconfirmed")
                self.alarm(f"write {found.point}", text)
            else:
                self._hand(found, respect_hand)

    def _hand(self, found: Finding, respect_hand: float) -> None:
        values = {"point": found.point, "expected": found.expected, "shown": found.shown}
        if found.outcome is Outcome.BY_HAND:
            self.event("changed_by_hand", **values, respected_for_seconds=respect_hand)
        elif found.outcome is Outcome.FALLBACK:
            self.event("plc_fell_back", **values)
        else:
            self.event("hand_no_longer_respected", **values)

    def ledger(self, clamps: Sequence[Clamp], outcomes: Sequence[WriteOutcome]) -> None:
        """Write down each clamp when it begins, and each write."""
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
            self.alarm(f"bus {write.point}", "" if outcome.error is None else f"{write.point}: {outcome.error}")

    def alarm(self, name: str, text: str, level: Level | None = None) -> None:
        """Raise the alarm, or clear it with an empty text."""
        self.alarms.set(name, text, self._monotonic, self._time, level)

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


def _number(value: float | None) -> str:
    return "nothing" if value is None else f"{value:g}"
