"""The run of an approved separating test: a source between the grower's override and the plan.

`tick` looks at the approval after each cycle and begins or ends the test; `offer`, in the cycle, says only what the
course asks for now. A test that a cycle offers but nobody then watches ends with the next one, so that a fault in here
gives the plant back. It runs on the monotonic clock, and never twice: see `igrow.edge.separating_tests.approval`.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

from igrow.core.agronomy import Place
from igrow.core.separating_tests import SOURCE, Condition, SeparatingTest
from igrow.edge.cycle_result import CycleResult
from igrow.edge.hand_off import LateError
from igrow.edge.image import Image
from igrow.edge.moment import Moment
from igrow.edge.records import AlarmRecord
from igrow.edge.separating_tests.approval import Approval, approval_of, to_plain
from igrow.edge.separating_tests.hindrances import by_cycle, by_image, by_sun, does_not_follow
from igrow.edge.sources.decision import Offer
from igrow.edge.state_file import StateFile

COMPLETED = "it ran to its end"
BEGAN_ANEW = "control began anew while it ran: the daemon was started, or read its configuration, again"
UNREAD = 600.0
"""Seconds for which a test runs on while nobody can read whether it was withdrawn."""


@dataclass(frozen=True)
class _Run:
    test: SeparatingTest
    asked: int
    began: float
    """Monotonic seconds."""

    def minutes(self, image: Image) -> float:
        return (image.monotonic - self.began) / 60.0


class SeparatingTests:
    """Waits for the approved test's weather, runs it once, and says what became of it."""

    name = SOURCE

    def __init__(
        self,
        file: StateFile,
        tests: Mapping[str, SeparatingTest],
        conditions: Mapping[str, Sequence[Condition]],
        setpoints: Collection[str],
        place: Place,
        boot: str,
        tell: Callable[..., None],
    ) -> None:
        """Prepare to look.

        Args:
            file: where the approval is left.
            tests: those that this site can run, by name.
            conditions: of each of them, with the crop's.
            setpoints: points that sources decide; all others are the PLC's own.
            place: for sunset and sunrise.
            boot: names this start of the machine, while its monotonic clock is the daemon's.
            tell: takes the kind of an event, and its details by name.
        """
        self._file = file
        self._tests = tests
        self._conditions = conditions
        self._setpoints = frozenset(setpoints)
        self._place = place
        self._boot = boot
        self._tell = tell
        self._looked_at: float | None = None
        self._approval: Approval | None = None
        self._told: int | None = None
        """The approval that was last told of."""
        self._beginning: int | None = None
        """The approval that is noted as begun by this very run of the daemon."""
        self._ended: tuple[int, str] | None = None
        """The approval that has ended here, and how, also while the file cannot say so."""
        self._run: _Run | None = None
        self._watched = False
        self._waits_for = ""

    # in the cycle

    def offer(self, image: Image) -> Offer:
        """Return what the course asks for now."""
        run = self._run
        if run is None:
            return Offer("")
        values = run.test.at(run.minutes(image))
        if values is None:
            self._end(run.asked, COMPLETED, image)
        elif not self._watched:
            self._end(run.asked, "nobody watched over it", image)
        elif fault := by_image(run.test, self._conditions[run.test.name], image, beginning=False):
            self._end(run.asked, fault, image)
        else:
            self._watched = False
            left = run.test.minutes - run.minutes(image)
            return Offer(
                f"the separating test {run.test.name}, for {left:.0f} min more",
                {name: value for name, value in values.items() if name in self._setpoints},
                {name: value for name, value in values.items() if name not in self._setpoints},
            )
        return Offer("")

    # after the cycle

    def tick(self, result: CycleResult, alarms: Sequence[AlarmRecord]) -> None:
        """Look at the approval, and begin or end the test; never blocks.

        Args:
            result: of the cycle.
            alarms: that are active.
        """
        image = result.image
        self._look(image)
        approval = self._approval
        if self._run is not None:
            self._watch(self._run, result, alarms)
        elif approval is None:
            self._waits_for = ""
        elif approval.is_over:
            self._gone(approval)
        elif self._ended is not None and self._ended[0] == approval.asked:
            self._write(replace(approval, ended=self._ended[1]))
        elif approval.begun is not None and approval.asked != self._beginning:
            self._end(approval.asked, BEGAN_ANEW, image)
        elif approval.test not in self._tests:
            self._end(approval.asked, "this site cannot run it any more", image)
        elif approval.seen is None:
            self._greet(approval, image)
        else:
            self._wait(approval, approval.seen, result, alarms)

    def _watch(self, run: _Run, result: CycleResult, alarms: Sequence[AlarmRecord]) -> None:
        approval, image = self._approval, result.image
        ended = "it was withdrawn"
        if approval is not None and approval.asked == run.asked:
            ended = approval.ended
        unread = self._looked_at is None or image.monotonic - self._looked_at > UNREAD
        fault = (
            ended
            or ("nobody can read whether it was withdrawn" if unread else "")
            or by_cycle(run.test, result, alarms)
            or does_not_follow(run.test, result)
        )
        if fault:
            self._end(run.asked, fault, image)
        else:
            self._watched = True

    def _gone(self, approval: Approval) -> None:
        """Tell of an approval that was withdrawn before its test began."""
        self._waits_for = ""
        if self._told == approval.asked and (self._ended is None or self._ended[0] != approval.asked):
            self._ended = (approval.asked, approval.ended)
            self._tell("separating_test_ended", test=approval.test, why=approval.ended, minutes=0.0)

    def _greet(self, approval: Approval, image: Image) -> None:
        """Tell of a new approval, and date it."""
        if self._told != approval.asked:
            self._told = approval.asked
            self._tell("separating_test_approved", test=approval.test, by=approval.by, waits_seconds=approval.seconds)
        self._write(replace(approval, seen=self._now(image)))

    def _wait(self, approval: Approval, seen: Moment, result: CycleResult, alarms: Sequence[AlarmRecord]) -> None:
        image, test = result.image, self._tests[approval.test]
        self._told = approval.asked
        passed = self._now(image).since(seen)
        if passed is None or passed > approval.seconds:
            since = (
                "nobody knows how long ago it was approved" if passed is None else "its weather did not come in time"
            )
            self._end(approval.asked, since, image)
            return
        self._waits_for = self._hindrance(test, result, alarms)
        if approval.begun is None:
            if not self._waits_for:
                self._beginning = approval.asked
                self._write(replace(approval, begun=self._now(image)))
        elif self._waits_for:
            self._end(approval.asked, self._waits_for, image)
        else:
            # The file says that it has begun, whatever happens from here on.
            self._run = _Run(test, approval.asked, image.monotonic)
            self._watched = True
            self._tell("separating_test_began", test=test.name, by=approval.by, minutes=test.minutes)

    def _hindrance(self, test: SeparatingTest, result: CycleResult, alarms: Sequence[AlarmRecord]) -> str:
        image = result.image
        if image.true_time is None:
            return "the clock is wrong"
        return (
            by_sun(test, self._place, image.true_time)
            or by_image(test, self._conditions[test.name], image, beginning=True)
            or by_cycle(test, result, alarms)
        )

    def _end(self, asked: int, why: str, image: Image) -> None:
        run, self._run = self._run, None
        self._waits_for = ""
        self._ended = (asked, why)
        approval = self._approval
        name = run.test.name if run is not None else approval.test if approval is not None else ""
        minutes = round(run.minutes(image), 1) if run is not None else 0.0
        self._tell("separating_test_ended", test=name, why=why, minutes=minutes)
        if approval is not None and approval.asked == asked and not approval.is_over:
            self._write(replace(approval, ended=why))

    def describe(self) -> Mapping[str, object]:
        """Return what the status shows: the approved test and how it stands."""
        approval, run = self._approval, self._run
        if approval is None:
            return {}
        ended = approval.ended
        if self._ended is not None and self._ended[0] == approval.asked:
            ended = self._ended[1]
        return {
            "test": approval.test,
            "by": approval.by,
            "running": run is not None,
            "waits_for": self._waits_for,
            "ended": ended,
        }

    # the file

    def _look(self, image: Image) -> None:
        """Take over what the file holds when it has changed."""
        with contextlib.suppress(LateError):
            content = self._file.news()
            if not self._file.unread:
                self._looked_at = image.monotonic
            if content is not None:
                self._approval = approval_of(content)

    def _write(self, approval: Approval) -> None:
        self._file.answer(to_plain(approval))

    def _now(self, image: Image) -> Moment:
        return Moment(self._boot, image.monotonic, image.true_time)
