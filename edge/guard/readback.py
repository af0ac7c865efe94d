"""What stands in the PLC: confirms our writes by a later read, and notices hands that changed a setpoint there.

A reading that shows neither what stood there nor what became of a write of ours (`igrow.edge.guard.our_writes`) has
one of these causes, looked for in this order:

1. the point is the PLC's own (no source decides it): the PLC's control has moved it;
2. the PLC puts the value of one setpoint into another;
3. the PLC has started anew: its heartbeat register was cleared, or all setpoints show what memory holds at power-up;
4. the PLC fell back to its own safe setpoints: `plc_fallback` says so, or nothing was heard of us for long enough;
5. a hand. It is respected for a configured time, and its value is remembered: what moves the point away meanwhile
   (an interlock, a fallback, a restart) does not end it.

Whether a PLC could be heard is judged for each unit by itself. Units that have changed places are not read at all
(`igrow.edge.guard.exchanged`).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from types import MappingProxyType

from igrow.core.quantities import with_unit
from igrow.edge.guard.answers import matches, on_the_way
from igrow.edge.guard.causes import FALLBACK, Causes
from igrow.edge.guard.evidence import Questions, disturbed
from igrow.edge.guard.exchanged import Exchanged
from igrow.edge.guard.findings import Finding, Hand, Outcome, Problem
from igrow.edge.guard.heartbeat import HEARTBEAT
from igrow.edge.guard.our_writes import OurWrites
from igrow.edge.guard.point_memory import PointMemory
from igrow.edge.guard.power_up import Look
from igrow.edge.guard.rules import PointRule
from igrow.edge.guard.state import Write
from igrow.edge.image import Image
from igrow.edge.registers.look_alikes import LookAlikes

SILENCE = 30.0
"""Seconds without a word after which a PLC may have fallen back: three cycles of ten seconds."""


class Readback:
    """Remembers per point what was agreed, what is still to be confirmed and what is held by a hand."""

    def __init__(
        self,
        rules: Mapping[str, PointRule],
        *,
        confirm_within: float,
        respect_hand: float,
        silence: float = SILENCE,
        units: Mapping[str, str] | None = None,
        look_alikes: LookAlikes = MappingProxyType({}),
    ) -> None:
        """`confirm_within`, `respect_hand` and `silence` in seconds; `units` maps points to the unit that holds them.

        After `silence` without a word, or without our heartbeat, a PLC may have fallen back by itself. `look_alikes`
        are the units that could be taken for each other.
        """
        self._rules = rules
        self._respect_hand = respect_hand
        self._units = units or {}
        self.points = {name: PointMemory() for name in rules}
        self._beat_at: float | None = None
        self._causes = Causes(rules, self.points, self._units, silence)
        self._ours = OurWrites(
            rules, self.points, self._causes, confirm_within=confirm_within, respect_hand=respect_hand
        )
        self._questions = Questions(rules, self._units, confirm_within)
        self._exchanged = Exchanged(rules, self.points, self._units, look_alikes)

    def wrote(self, write: Write, now: float) -> None:
        """Remember a write that is about to leave; a later reading must show it."""
        self.points[write.point].sent_now(write, now)

    def not_sent(self, write: Write, *, refused: bool = False) -> None:
        """Forget the newest write to a point, which never left; one that was refused may show all the same."""
        self.points[write.point].taken_back(refused=refused)

    def beat(self, now: float) -> None:
        """Remember that the heartbeat went out."""
        self._beat_at = now

    def carry_over(self, before: Readback, same: Collection[str]) -> None:
        """Go on where the read-back before a reload stood; `same` are the points that are the same registers."""
        for name in self.points.keys() & before.points.keys() & set(same):
            self.points[name] = before.points[name]
        self._questions.carry_over(before._questions, self.points.keys() & set(same))
        if HEARTBEAT in same:
            self._beat_at = before._beat_at

    def tell_a_start(self, findings: Collection[Finding]) -> bool:
        """Tell whether by these findings the unit has started anew that holds the heartbeat's register."""
        return any(f.outcome is Outcome.RESTARTED and self._causes.same_unit(f.point, HEARTBEAT) for f in findings)

    def held(self, now: float) -> dict[str, float]:
        """Return the seconds that each point changed by hand is still respected."""
        return {name: hand.seconds for name, hand in self.hands(now).items()}

    def hands(self, now: float) -> dict[str, Hand]:
        """Return the hands that are respected."""
        hands = {}
        for name, memory in self.points.items():
            if memory.hand is not None and memory.held_until > now:
                stands = memory.stands is None or matches(self._rules[name], memory.stands, memory.hand)
                hands[name] = Hand(memory.hand, memory.held_until - now, stands)
        return hands

    def shown(self) -> dict[str, float | None]:
        """Return what stands in the PLC as far as we know: a write on its way counts until a read denies it.

        Where the device made something of its own of a write, the point counts as standing where we wanted it.
        """
        return {name: memory.shown for name, memory in self.points.items()}

    def pending(self, point: str) -> bool:
        """Tell whether a write to a point is still to be confirmed."""
        memory = self.points[point]
        return bool(memory.sent) and not memory.overdue

    def unseen(self, image: Image) -> set[str]:
        """Return the points to be read now, although they may not be due: something has happened to their PLC."""
        return disturbed(self.points, image).union(self._questions.wanted, self._exchanged.wanted)

    def cannot_be_read(self, name: str, image: Image) -> bool:
        """Tell whether no reading of a point is to be waited for."""
        return self._ours.cannot_be_read(name, image)

    @property
    def in_question(self) -> Collection[str]:
        """The points that have changed, nobody knows yet by whom; they are to be left alone."""
        return self._questions.names

    def settle(self, targets: Mapping[str, float | None]) -> Mapping[str, Problem | None]:
        """Return what is wrong with our writes by point, leaving out what is no longer wanted otherwise.

        `targets` is where the guard wants each point by now; None where it wants nothing.
        """
        for name, memory in self.points.items():
            memory.settle(self._rules[name], targets.get(name))
        return {name: memory.problem for name, memory in self.points.items()}

    def recognised(self, image: Image) -> Image:
        """Return the image in which units that have changed places are not read as themselves; before `observe`."""
        return self._exchanged.judge(image)

    def observe(self, image: Image, *, restarted: bool = False, patient: bool = False) -> list[Finding]:
        """Compare an image with what was written, before deciding; call again where `unseen` was read.

        `restarted`: the heartbeat's register was cleared. Who is `patient` waits until the rest of a unit is read.
        """
        now = image.monotonic
        self._listen(image, restarted)
        findings: list[Finding] = []
        looks = self._looks(self.points, image, findings)
        cleared = {name for name, memory in self.points.items() if memory.restarted}
        for start in self._questions.overtaken(self._decided(looks), cleared):
            changed = {name: look for name, look in start.items() if look.changed}
            findings.extend(self._explain(changed, changed, image))
            self._questions.judged(start)
            for name, look in changed.items():
                self.points[name].looked_at = look.at
            looks |= self._looks(changed, image, findings)
        decided = self._decided(looks)
        anew = self._questions.anew(decided)
        unclear = {name for name, look in decided.items() if look.changed and not self.points[name].restarted}
        self._questions.ask(decided, unclear if patient else (), image)
        looks = {name: look for name, look in looks.items() if name not in self.in_question}
        findings.extend(self._explain(looks, anew, image))
        for name, look in looks.items():
            self.points[name].was_looked_at(look.at, now)
        findings.extend(self._ended(now))
        return findings

    def _passes(self, name: str, shown: float) -> bool:
        """Tell whether a point may only pass its safe value, on its way to what was written."""
        memory = self.points[name]
        if not memory.sent or memory.stands is None:
            return False
        return on_the_way(self._rules[name], memory.stands, memory.sent[-1].value, shown)

    def _decided(self, looks: Mapping[str, Look]) -> dict[str, Look]:
        """Return the looks at setpoints; what the PLC moves by itself is no question."""
        return {name: look for name, look in looks.items() if self._rules[name].decided}

    def _looks(self, names: Collection[str], image: Image, findings: list[Finding]) -> dict[str, Look]:
        """Look at what new readings show; adds to `findings` what became of our writes."""
        looks: dict[str, Look] = {}
        for name in names:
            if not image.makes_sense(name):
                continue  # nobody knows what stands there
            memory, value = self.points[name], image.value_of(name)
            if not memory.is_new(value, image.monotonic):
                findings.extend(self._ours.unread(name, image))
                continue
            assert value.value is not None
            found = self._ours.shown_by(name, value.value, image)
            at, unapplied = image.monotonic - value.age, found is not None and self.pending(name)
            interrupted, since = memory.was_interrupted, at - memory.looked_at
            looks[name] = Look(value.value, found is None, at, since, interrupted, unapplied)
            findings.extend(found or ())
        return looks

    def _listen(self, image: Image, restarted: bool) -> None:
        """Note how long each point's unit could not be heard, or could not hear us, and what is too old by now."""
        now, fallback = image.monotonic, image.value_of(FALLBACK).says_yes
        beat_at = -math.inf if self._beat_at is None and HEARTBEAT in image.values else self._beat_at
        for name, memory in self.points.items():
            memory.grow_old(now)
            interrupted = any(name in points for points in image.interrupted.values())
            memory.hear(now, answers=image.reaches(name), interrupted=interrupted, beat_at=beat_at)
            if fallback:
                memory.fell_back_at = now
            if restarted and self._causes.same_unit(name, HEARTBEAT):
                memory.restarted_at = now

    def _ended(self, now: float) -> Iterator[Finding]:
        for name, memory in self.points.items():
            if memory.hand is not None and memory.held_until <= now:
                memory.hand = None
                yield Finding(name, Outcome.HAND_ENDED, None, memory.stands)

    def _explain(self, looks: Mapping[str, Look], anew: Collection[str], image: Image) -> Iterator[Finding]:
        """Say who changed what is not ours, and agree with it; `anew` are the setpoints that look like a start."""
        shows = {name: look.shown for name, look in looks.items()}
        crossed = {
            n: text
            for n, look in self._decided(looks).items()
            if look.changed and (text := self._causes.crossed(n, shows))
        }
        for name, look in looks.items():
            if not look.changed:
                continue
            rule, memory = self._rules[name], self.points[name]
            expected = memory.sent[-1].value if memory.sent else memory.stands
            source = memory.sent[-1].source if memory.sent else ""
            text = ""
            if not rule.decided:
                ours = memory.shown if memory.sent or memory.answers is not None else None
                memory.found(look.shown)
                if ours is not None:
                    wrote, moved = with_unit(name, ours), with_unit(name, look.shown)
                    text = f"{wrote} was written to {name}, but the PLC moves it to {moved}"
                    memory.problem = Problem(text)
                continue
            if name in crossed:
                outcome, text = Outcome.CROSSED, crossed[name]
            elif memory.restarted or name in anew:
                outcome = Outcome.RESTARTED
            elif self._causes.fell_back(name, look.shown, image):
                outcome = Outcome.FALLBACK
            else:
                outcome = Outcome.BY_HAND
                memory.hand, memory.held_until = look.shown, image.monotonic + self._respect_hand
            coming = memory.sent if outcome is Outcome.FALLBACK and self._passes(name, look.shown) else []
            memory.found(look.shown)
            memory.sent = coming
            memory.problem = Problem(text) if text else None
            yield Finding(name, outcome, expected, look.shown, source, text, look.since)
