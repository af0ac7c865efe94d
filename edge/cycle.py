"""The control cycle, in the order of its diagram: read, image, decide, guard, write, log, heartbeat.

One frozen image serves a whole cycle. A write is confirmed by the reading of a later cycle. The heartbeat goes out
last: it tells the PLC that a whole cycle was completed, and a lock-step plant that it may move on.
"""

from __future__ import annotations

import time
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from igrow.edge.clock import Clock
from igrow.edge.guard import GuardedWriter, GuardRules, GuardState, Readback, Request, Verdict, guard
from igrow.edge.guard.core import begin_again, never_sent
from igrow.edge.guard.readback import Outcome
from igrow.edge.image import Image, Quality
from igrow.edge.journal import Journal
from igrow.edge.ports import SetpointStatus
from igrow.edge.sensors import ImageBuilder, RawReading
from igrow.edge.sources import Choice, Decision, Source, decide


class ReadablePlc(Protocol):
    """What the cycle needs of a PLC; writing is the guard's affair."""

    async def read(self, names: Collection[str] | None = None) -> Mapping[str, RawReading]:
        """Read the named points, or all that are due; each reading carries its own error."""


@dataclass(frozen=True, slots=True)
class CycleResult:
    """What one cycle did."""

    image: Image
    decision: Decision
    verdict: Verdict
    setpoints: Mapping[str, SetpointStatus]
    seconds: float
    """Wall-clock length of the cycle."""


class ControlCycle:
    """Everything that one cycle needs, and the little that it remembers."""

    def __init__(
        self,
        plc: ReadablePlc,
        clock: Clock,
        builder: ImageBuilder,
        sources: Sequence[Source],
        rules: GuardRules,
        readback: Readback,
        writer: GuardedWriter,
        journal: Journal,
        *,
        setpoints: Sequence[str],
        respect_hand: float,
        state: GuardState | None = None,
    ) -> None:
        """`setpoints` are the points that sources decide; interlocks may force every point of `rules`."""
        self._plc = plc
        self._clock = clock
        self._builder = builder
        self.sources = sources
        self._rules = rules
        self.readback = readback
        self._writer = writer
        self._journal = journal
        self._setpoints = tuple(setpoints)
        self._respect_hand = respect_hand
        self.state = state or GuardState()
        self._source = ""

    async def run(self, names: Collection[str] | None = None) -> CycleResult:
        """Run one cycle. `names` None reads what is due."""
        began = time.perf_counter()
        image = await self._read(names)
        decision = decide(self.sources, image, self._setpoints)
        requests = {name: Request(choice.value, choice.source) for name, choice in decision.choices.items()}
        verdict = await self._guard_and_write(requests, image)
        self._log(image, decision)
        error = await self._writer.heartbeat() if image.link_ok else None
        self._journal.alarm("heartbeat", "" if error is None else f"the heartbeat could not be written: {error}")
        statuses = self._statuses(decision.choices, image)
        return CycleResult(image, decision, verdict, statuses, time.perf_counter() - began)

    async def stop(self) -> bool:
        """Write the safe setpoints, through the guard; tell whether the PLC could be reached.

        The heartbeat then ends, and the PLC falls back by itself.
        """
        image = await self._read(None)
        await self._guard_and_write({}, image, stopping=True)
        return image.link_ok

    async def _read(self, names: Collection[str] | None) -> Image:
        readings = await self._plc.read(names)
        image = self._builder.build(readings, self._clock.monotonic(), self._clock.true_time())
        self._journal.begin(image)
        findings = self.readback.observe(image)
        self._journal.findings(findings, self._respect_hand)
        moved = {f.point for f in findings if f.outcome in (Outcome.FALLBACK, Outcome.BY_HAND, Outcome.UNCONFIRMED)}
        if moved:
            self.state = begin_again(self.state, moved)
        return image

    async def _guard_and_write(
        self, requests: Mapping[str, Request], image: Image, *, stopping: bool = False
    ) -> Verdict:
        held = self._held(image)
        shown = self.readback.shown()
        before = self.state
        verdict = guard(requests, shown, held, image, before, self._rules, stopping=stopping)
        self.state = verdict.state
        if not image.link_ok:
            # Nothing can be written, nothing may be remembered as written, and no ramp may run on unseen.
            for name in self._rules.points:
                self.state = never_sent(self.state, before, name)
            return verdict
        outcomes = await self._writer.carry_out(verdict.writes)
        for outcome in outcomes:
            if outcome.may_have_arrived:
                self.readback.wrote(outcome.write, image.monotonic)
            else:
                self.state = never_sent(self.state, before, outcome.write.point)
        self._journal.ledger(verdict.clamps, outcomes)
        return verdict

    def _held(self, image: Image) -> Mapping[str, float]:
        manual = image.value_of("plc_manual")
        if manual.quality is Quality.GOOD and manual.value is not None and manual.value >= 0.5:
            return dict.fromkeys(self._rules.points, self._respect_hand)
        return self.readback.held(image.monotonic)

    def _log(self, image: Image, decision: Decision) -> None:
        if decision.source != self._source:
            self._journal.event("source", now=decision.source, before=self._source or "none", why=decision.why)
            self._source = decision.source
        self._journal.sensors(image)
        self._journal.telemetry(image)

    def _statuses(self, choices: Mapping[str, Choice], image: Image) -> dict[str, SetpointStatus]:
        held = self._held(image)
        statuses = {}
        for name in self._rules.points:
            choice, memory = choices.get(name), self.state.points.get(name)
            statuses[name] = SetpointStatus(
                requested=choice.value if choice else None,
                applied=memory.written if memory else None,
                shown=image.value_of(name).value,
                source=choice.source if choice else "",
                why=choice.why if choice else "",
                held_until=image.monotonic + held[name] if name in held else None,
            )
        return statuses
