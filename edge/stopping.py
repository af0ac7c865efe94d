"""The stop: the safe setpoints within seconds, first those that stand elsewhere, and the truth about the rest.

A slow PLC answers one request at a time. So nothing is asked any more once the setpoints were looked at; the writes
leave together, each as soon as its line is free, and what was not confirmed is written again while there is time. What
then still stands elsewhere, since the PLC takes it later or not at all, is written once more, and named.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from igrow.core.quantities import with_unit
from igrow.edge.bus.errors import BusError, RefusedError, UnitBusyError, UnknownPointError, ValueDoesNotFitError
from igrow.edge.cycle_result import ReadablePlc
from igrow.edge.guard import GuardedWriter, PointRule, Write, WriteOutcome
from igrow.edge.guard.answers import takes

STOP_SECONDS = 10.0
"""Longest time that the safe setpoints may take on the way out."""
LOOK_SECONDS = 3.8
"""How much of that the look at the setpoints may take: a hand may have been there since the last cycle. Three answers
of a PLC that needs 1.2 s for each; four writes then fit in behind it."""
LOOKS_AFTER = 3
"""How often it is looked whether what was written stands there."""
BETWEEN_LOOKS = 1.0
"""Seconds for a PLC that takes what is written in its next scan."""
SPARE_SECONDS = 0.5
"""What the looks leave of the time of the stop."""
ROUNDS = 3
"""How often a write is sent at the most that nobody has confirmed."""
BETWEEN_ROUNDS = 0.3
"""Seconds for a line that was lost to be opened again."""


class OutOfTimeError(BusError):
    """The time of the stop was over before the write was confirmed; it may have been done."""

    sent = True


@dataclass(frozen=True)
class StopReport:
    """What a stop left behind."""

    seen: bool
    """Something of the PLC was read since the start."""
    manual: bool = False
    """Somebody operates it by hand, so nothing was written."""
    by_hand: tuple[str, ...] = ()
    """The points that were left as a hand has set them."""
    left_alone: tuple[str, ...] = ()
    """The points that a hand may have set, which nobody could know yet."""
    written: Mapping[str, float] = field(default_factory=dict)
    """What the PLC has confirmed."""
    failed: Mapping[str, str] = field(default_factory=dict)
    """By point: why its safe value was not written, or not confirmed."""
    unseen: tuple[str, ...] = ()
    """The points that stood at their safe value when they were last seen, and could not be looked at now."""
    unshown: Mapping[str, float] = field(default_factory=dict)
    """By point: what the PLC shows although it has confirmed the safe value."""

    @staticmethod
    def after(
        outcomes: Sequence[WriteOutcome],
        *,
        by_hand: Sequence[str],
        left_alone: Sequence[str],
        unseen: Sequence[str],
        unshown: Mapping[str, float],
        manual: bool,
    ) -> StopReport:
        """Return the report on what became of the writes of a stop."""
        return StopReport(
            seen=True,
            manual=manual,
            by_hand=tuple(by_hand),
            left_alone=tuple(left_alone),
            unseen=tuple(unseen),
            unshown=unshown,
            written={o.write.point: o.write.value for o in outcomes if o.error is None},
            failed={o.write.point: str(o.error) for o in outcomes if o.error is not None},
        )

    def words(self) -> str:
        """Return in one line how the setpoints were left."""
        if not self.seen:
            return "the PLC does not answer, so its own safe setpoints rule after its timeout"
        if self.manual:
            return "nothing was written, as somebody operates the PLC by hand"
        notes = f", but for {', '.join(self.by_hand)}, which a hand has set" if self.by_hand else ""
        if self.left_alone:
            notes += f", but for {', '.join(self.left_alone)}, which a hand may have set"
        if self.unseen:
            notes += f"; {', '.join(self.unseen)} stood there already when last seen, and cannot be looked at now"
        for name, shown in self.unshown.items():
            notes += f"; {name} was taken, but the PLC still shows {with_unit(name, shown)}"
        if not self.failed:
            return f"the safe setpoints were written{notes}"
        begin = f"written: {', '.join(self.written)}" if self.written else "nothing was written"
        failed = "; ".join(f"{name}: {why}" for name, why in self.failed.items())
        rule = "not confirmed, so there the PLC's own safe setpoints rule after its timeout"
        return f"{begin}{notes}; {rule}: {failed}"


def furthest_first(writes: Sequence[Write], shown: Mapping[str, float | None]) -> list[Write]:
    """Return the writes in the order in which they matter: what is known to stand elsewhere before what is unknown."""

    def rank(write: Write) -> int:
        stands = shown.get(write.point)
        return 1 if stands is None else 2 if stands == write.value else 0

    return sorted(writes, key=rank)


async def write_at_once(writer: GuardedWriter, writes: Sequence[Write], seconds: float) -> list[WriteOutcome]:
    """Write all values within so many seconds; the lines work side by side, each in the order of `writes`."""
    loop = asyncio.get_running_loop()
    until = loop.time() + seconds
    outcomes: dict[str, WriteOutcome] = {}
    pending = list(writes)
    for _ in range(ROUNDS):
        if not pending or loop.time() >= until:
            break
        if outcomes:
            await asyncio.sleep(min(BETWEEN_ROUNDS, until - loop.time()))
        outcomes |= await _one_round(writer, pending, until - loop.time(), seconds)
        pending = [write for write in pending if _worth_another_try(outcomes[write.point])]
    return [outcomes[write.point] for write in writes if write.point in outcomes]


async def look_after(
    plc: ReadablePlc,
    writer: GuardedWriter,
    rules: Mapping[str, PointRule],
    outcomes: Sequence[WriteOutcome],
    until: float,
) -> dict[str, float]:
    """Return what the PLC shows elsewhere than where it confirmed a write, after one more try.

    `until` is when the stop has to be over, on the loop's clock. What cannot be read is left out.
    """
    loop, unshown = asyncio.get_running_loop(), dict[str, float]()
    asked = {outcome.write.point: outcome.write for outcome in outcomes if outcome.error is None}
    until -= SPARE_SECONDS
    for attempt in range(LOOKS_AFTER):
        if attempt:
            await asyncio.sleep(max(0.0, min(BETWEEN_LOOKS, until - loop.time())))
            await write_at_once(writer, [asked[name] for name in unshown], until - loop.time())
        try:
            async with asyncio.timeout_at(until):
                readings = await plc.read(sorted(asked))
        except TimeoutError:
            break
        shown = {name: reading.value for name, reading in readings.items() if reading.value is not None}
        right = {name for name, value in shown.items() if takes(rules[name], asked[name].value, value)}
        asked = {name: write for name, write in asked.items() if name not in right}
        unshown = {name: value for name, value in {**unshown, **shown}.items() if name not in right}
        if not asked:
            break
    return unshown


async def _one_round(
    writer: GuardedWriter, writes: Sequence[Write], left: float, seconds: float
) -> dict[str, WriteOutcome]:
    tasks = {write.point: asyncio.ensure_future(writer.carry_out([write])) for write in writes}
    await asyncio.wait(tasks.values(), timeout=max(0.0, left))
    outcomes = {}
    for write in writes:
        task = tasks[write.point]
        if task.done():
            (outcomes[write.point],) = task.result()
        else:
            task.cancel()
            error = OutOfTimeError(f"no answer within the {seconds:.0f} s that were left")
            outcomes[write.point] = WriteOutcome(write, error)
    return outcomes


def _worth_another_try(outcome: WriteOutcome) -> bool:
    """Tell whether a write may succeed when it is sent again."""
    error = outcome.error
    if isinstance(error, RefusedError):
        return isinstance(error, UnitBusyError)
    return isinstance(error, BusError) and not isinstance(
        error, OutOfTimeError | UnknownPointError | ValueDoesNotFitError
    )
