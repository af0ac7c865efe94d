"""The control cycle, in the order of its diagram: read, image, decide, guard, write, log, heartbeat.

One frozen image serves a whole cycle. A write is confirmed by the reading of a later cycle. The heartbeat goes out
last: it tells the PLC that a whole cycle was completed, and a lock-step plant that it may move on.
"""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Callable, Collection, Mapping, Sequence

from igrow.edge.bus.errors import RefusedError, SenselessUnitError
from igrow.edge.clock import Clock
from igrow.edge.cycle_result import CycleResult, ReadablePlc
from igrow.edge.guard import (
    GuardedWriter,
    GuardRules,
    GuardState,
    Readback,
    Request,
    Verdict,
    Write,
    WriteOutcome,
    guard,
)
from igrow.edge.guard.core import LONGEST_RAMP, begin_again, go_on, never_sent, postponed
from igrow.edge.guard.findings import moved_and_stood
from igrow.edge.guard.heartbeat import HEARTBEAT
from igrow.edge.guard.memory import note, recall
from igrow.edge.heart import Heart
from igrow.edge.held import Held
from igrow.edge.image import Image, Quality
from igrow.edge.journal import Journal
from igrow.edge.sensors import ImageBuilder, RawReading
from igrow.edge.setpoint_statuses import marks_of_tests, setpoint_statuses
from igrow.edge.sources import Decision, Source, decide
from igrow.edge.stopping import LOOK_SECONDS, STOP_SECONDS, StopReport, furthest_first, look_after, write_at_once

MANUAL = "plc_manual"
ASKED_AT_STOP = (MANUAL, "plc_fallback", HEARTBEAT)
"""What has to be known beside the setpoints themselves before a stop moves them."""


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
        marks_tests: bool = False,
        keep: Callable[[Image, Mapping[str, object]], None] | None = None,
        interval: float = 0.0,
    ) -> None:
        """`setpoints` are the points that sources decide; interlocks may force every point of `rules`.

        With `marks_tests` each row of the log says whether a separating test moved the plant. `keep` is handed what a
        restart must not forget, in each cycle before anything is written. `interval`: seconds from cycle to cycle.
        """
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
        self._marks_tests = marks_tests
        self._keep = keep
        self.state = GuardState()
        self._source = ""
        self._manual = False
        self._look_at: set[str] = set()
        """Points to be read in the next cycle although they are not due, since they wait to be written."""
        self._reading: asyncio.Future[Mapping[str, RawReading]] | None = None
        self._seen = self._giving_way = False
        self.held = Held(interval)
        self._heart = Heart(writer, readback, journal)
        self.unknown_until = -math.inf
        """Monotonic seconds until which it is not known what hands have set before a restart; all is left alone."""

    def give_way(self) -> None:
        """End the present cycle after the write that is under way, or now while it reads: the stop needs the line.

        `run` then raises CancelledError, or returns what it has done until then.
        """
        self._giving_way = True
        if self._reading is not None:
            self._reading.cancel()

    @property
    def _breaks_off(self) -> bool:
        """Tell whether nothing may be written any more in this cycle: the stop comes, or it began too long ago."""
        return self._giving_way or self.held.too_long

    def carry_over(self, before: ControlCycle, same: Collection[str]) -> None:
        """Go on where the cycle before a reload stood; `same` are the points that mean the same register as before."""
        self.state = before.state
        self._source, self._manual = before._source, before._manual
        self._seen, self.unknown_until = before._seen, before.unknown_until
        self._builder.carry_over(before._builder, same)
        self.readback.carry_over(before.readback, same)
        if HEARTBEAT in same:
            self._writer.beats.carry_over(before._writer.beats)

    def recall(self, content: Mapping[str, object], later: float, *, same: Collection[str], agree: bool) -> None:
        """Go on where the process before this one stood; see `igrow.edge.guard.memory`."""
        self.state = recall(content, self.readback, later, same=same, agree=agree)
        self._manual = content.get("manual") is True
        if HEARTBEAT in same:
            self._writer.beats.recall(content)

    async def run(self, names: Collection[str] | None = None) -> CycleResult:
        """Run one cycle. `names` None reads what is due."""
        began = time.perf_counter()
        self.held.begin()
        image = await self._read(names)
        decision = decide(self.sources, image, self._setpoints)
        requests = {name: Request(choice.value, choice.source) for name, choice in decision.choices.items()}
        verdict = await self._guard_and_write(requests, image)
        self._log(image, decision, verdict)
        if not self._breaks_off:
            await self._heart.beat(image)
        everything = dict.fromkeys(self._rules.points, self._respect_hand)
        held = everything if self._manual else self.readback.held(image.monotonic)
        statuses = setpoint_statuses(self._rules.points, decision.choices, image, verdict, self.state, held)
        return CycleResult(image, decision, verdict, statuses, time.perf_counter() - began)

    async def stop(self, seconds: float = STOP_SECONDS) -> StopReport:
        """Write the safe setpoints within so many seconds, through the guard, where no hand rules.

        The heartbeat then ends, and the PLC falls back by itself.
        """
        until = asyncio.get_running_loop().time() + seconds
        self._giving_way = False
        try:
            async with asyncio.timeout(min(LOOK_SECONDS, seconds)):
                image = await self._read(self._builder.names((*self._rules.points, *ASKED_AT_STOP)))
        except TimeoutError:
            # A PLC that is slower still: what was known before has to do.
            image = self._image({})
        if not self._seen:
            return StopReport(seen=False)
        outcomes = await self._stop_by(image, until)
        unshown = await look_after(self._plc, self._writer, self._rules.points, outcomes, until)
        held = () if self._manual else tuple(sorted(self.readback.held(image.monotonic)))
        settled = {*held, *(outcome.write.point for outcome in outcomes)}
        doubtful = () if self._manual else self._hands(image.monotonic)[0]
        alone = tuple(name for name in self._setpoints if name in doubtful and name not in settled)
        settled |= {*alone}
        unseen = [name for name in self._setpoints if image.value_of(name).age > 0.0 and name not in settled]
        return StopReport.after(
            outcomes, by_hand=held, left_alone=alone, unseen=unseen, unshown=unshown, manual=self._manual
        )

    async def _stop_by(self, image: Image, until: float) -> list[WriteOutcome]:
        """Write the guard's verdict on a stop, also to units that were silent lately."""
        before, points = self.state, self.readback.points
        # What is still on its way may arrive after all, or never.
        shown = {name: None if points[name].sent else stands for name, stands in self.readback.shown().items()}
        held = {**self._hands(image.monotonic)[0], **self.readback.held(image.monotonic)}
        verdict = guard({}, shown, held, image, before, self._rules, stopping=True, manual=self._manual)
        self.state = verdict.state
        writes = furthest_first([write for write in verdict.writes if image.makes_sense(write.point)], shown)
        self._about_to_write(writes, image)
        left = until - asyncio.get_running_loop().time()
        outcomes = await write_at_once(self._writer, writes, left)
        self._written(outcomes, before)
        for write in verdict.writes:
            if not image.makes_sense(write.point):
                self.state = never_sent(self.state, before, write.point)
                outcomes.append(WriteOutcome(write, SenselessUnitError(image.why_senseless(write.point))))
        self._remember(image)  # that which never left, too
        self._journal.ledger(verdict.clamps, outcomes, ())
        return outcomes

    async def _read(self, names: Collection[str] | None) -> Image:
        self._reading = asyncio.ensure_future(self._plc.read(names))
        try:
            readings = await self._reading
        finally:
            self._reading = None
        # Whoever operates the PLC by hand is not to be surprised, however seldom the switch is read otherwise.
        if names is None and (more := {*self._look_at, *self._builder.names((MANUAL,))} - readings.keys()):
            readings = {**readings, **await self._plc.read(sorted(more))}
        image = self._image(readings, patient=names is None)
        # Who has just not answered is not asked twice in a cycle.
        failed = {name for name, reading in readings.items() if reading.error is not None}
        if names is None and (unseen := self.readback.unseen(image) - failed):
            image = self._image(await self._plc.read(sorted(unseen)), patient=True)
        self._look_whether_by_hand(image)
        return image

    def _image(self, readings: Mapping[str, RawReading], *, patient: bool = False) -> Image:
        """Make the image of these readings, and look what it shows of our writes and of others' hands."""
        image = self._builder.build(readings, self._clock.monotonic(), self._clock.true_time())
        image = self.readback.recognised(image)
        self._seen |= image.link_ok and bool(readings)
        self._journal.begin(image)
        findings = self.readback.observe(image, restarted=self._heart.was_cleared(image), patient=patient)
        if self.readback.tell_a_start(findings):
            self._heart.meant_a_start(image)
        self._journal.findings(findings, self._respect_hand)
        moved, stood = moved_and_stood(findings, briefly=LONGEST_RAMP)
        self.state = go_on(begin_again(self.state, moved), stood)
        return image

    def _look_whether_by_hand(self, image: Image) -> None:
        """Keep what `plc_manual` last said, as long as nothing says otherwise."""
        flag = image.value_of(MANUAL)
        if flag.value is None or flag.quality not in (Quality.GOOD, Quality.STALE):
            return
        manual = flag.value >= 0.5
        if manual != self._manual:
            self._journal.event("plc_by_hand" if manual else "plc_by_hand_ended", point=MANUAL)
        self._manual = manual

    async def _guard_and_write(self, requests: Mapping[str, Request], image: Image) -> Verdict:
        now, before = image.monotonic, self.state
        held, restored = self._hands(now)
        shown = self.readback.shown()
        verdict = guard({**requests, **restored}, shown, held, image, before, self._rules, manual=self._manual)
        self.state = verdict.state
        writes = self._that_may_leave(verdict.writes, image, before)
        self._about_to_write(writes, image)
        outcomes: list[WriteOutcome] = []
        for position, write in enumerate(writes):
            if self._breaks_off:
                for unsent in writes[position:]:
                    self._never_sent(unsent, before)
                break
            outcomes += await self._writer.carry_out([write])
        self._written(outcomes, before)
        pending = [name for name in self._rules.points if self.readback.pending(name)]
        clamps = [clamp for clamp in verdict.clamps if image.reaches(clamp.point)]
        self._journal.ledger(clamps, outcomes, pending)
        targets = {name: memory.ramp for name, memory in verdict.state.points.items()}
        self._journal.problems(self.readback.settle(targets))
        return verdict

    def _about_to_write(self, writes: Sequence[Write], image: Image) -> None:
        """Note what is going to be written, so that neither a later look nor a restart takes it for somebody else's."""
        for write in writes:
            self.readback.wrote(write, image.monotonic)
        self._remember(image)

    def _remember(self, image: Image) -> None:
        # What is not known yet must not be replaced by what little is known until then.
        if self._keep is not None and image.monotonic >= self.unknown_until:
            content = {**note(self.state, self.readback), **self._writer.beats.note(), "manual": self._manual}
            self._keep(image, content)

    def _written(self, outcomes: Sequence[WriteOutcome], before: GuardState) -> None:
        """Forget what certainly never left."""
        for outcome in outcomes:
            if not outcome.may_have_arrived:
                self._never_sent(outcome.write, before, refused=isinstance(outcome.error, RefusedError))

    def _never_sent(self, write: Write, before: GuardState, *, refused: bool = False) -> None:
        self.readback.not_sent(write, refused=refused)
        self.state = never_sent(self.state, before, write.point)

    def _hands(self, now: float) -> tuple[dict[str, float], dict[str, Request]]:
        """Return the hands that stand, with the seconds that they are respected, and requests for those moved away."""
        held: dict[str, float] = {}
        restored: dict[str, Request] = {}
        for name, hand in self.readback.hands(now).items():
            if hand.stands:
                held[name] = hand.seconds
            else:
                restored[name] = hand.asked_back(name)
        held |= dict.fromkeys(self.readback.in_question, 0.0)
        if now < self.unknown_until:
            held |= {name: self.unknown_until - now for name in self._rules.points if name not in held}
        return held, restored

    def _that_may_leave(self, writes: Sequence[Write], image: Image, before: GuardState) -> list[Write]:
        """Keep back what nobody would see arrive, and what might undo a hand that nobody has looked for yet."""
        leaving: list[Write] = []
        self._look_at = set()
        for name in self._rules.points:
            if not image.reaches(name):
                # Nothing may be remembered as written, and no ramp may run on unseen.
                self.state = never_sent(self.state, before, name)
        for write in writes:
            if not image.reaches(write.point):
                continue
            unseen = image.value_of(write.point).age > 0.0 and not self.readback.cannot_be_read(write.point, image)
            if not write.urgent and unseen:
                self._look_at.add(write.point)
                self.state = postponed(self.state, before, write.point)
            else:
                leaving.append(write)
        return leaving

    def _log(self, image: Image, decision: Decision, verdict: Verdict) -> None:
        if decision.source != self._source:
            self._journal.event("source", now=decision.source, before=self._source or "none", why=decision.why)
            self._source = decision.source
        self._journal.sensors(image)
        self._journal.interlocks(verdict.engaged, self._rules.points)
        self._journal.telemetry(image, marks_of_tests(decision.choices, verdict.state) if self._marks_tests else {})
