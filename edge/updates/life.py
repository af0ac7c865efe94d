"""The life of a bundle on the gateway: candidate, shadow, adopted, on probation, kept or taken back."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING

from igrow.core.bundle import Bundle, BundleError
from igrow.core.telemetry import TelemetryError
from igrow.edge.planning.graph_process import ProcessError
from igrow.edge.updates.bundles import WENT_DOWN, Bundles, identity_of
from igrow.edge.updates.fetched import BundleRefusedError, Fetched, UpdateError
from igrow.edge.updates.rules import Graphs, UpdateRules
from igrow.edge.updates.shadow import Comparison, Predictor
from igrow.edge.updates.telling import Teller, Verdict
from igrow.edge.updates.wishes import Wishes

if TYPE_CHECKING:
    from igrow.edge.updates.signed_source import SignedSource

HOUR = 3600.0
FIRST_LOOK = 25 * HOUR
"""Into the probation: long enough for a free run of a day to have ended."""
KEPT_ERRORS = 400
JUDGE_SECONDS = 900.0
"""Longest time for one comparison on the log."""
_JUDGING = "igrow.edge.updates.judging"


class BundleLife:
    """What is due, and doing it (in the updates' thread); graphs run in the process for them."""

    def __init__(
        self,
        site: str,
        bundles: Bundles,
        source: SignedSource | None,
        graphs: Graphs,
        predictor: Predictor,
        log_folder: Path,
        teller: Teller,
        rules: UpdateRules,
    ) -> None:
        """`log_folder` is the store's."""
        self._site = site
        self._bundles = bundles
        self._source = source
        self._graphs = graphs
        self._predictor = predictor
        self._log_folder = log_folder
        self._teller = teller
        self._rules = rules
        self.wishes = Wishes()
        self._next_check = self._next_errors = self._next_watch = 0.0
        self.last_refusal = ""

    def keep_up(self, time: float) -> None:
        """Let nothing wait for a time that only a clock that was ahead has set."""
        rules = self._rules
        self._bundles.state.keep_up(time)
        self._next_check = min(self._next_check, time + HOUR * rules.check_hours)
        self._next_errors = min(self._next_errors, time + HOUR * rules.live_error_hours)
        self._next_watch = min(self._next_watch, time + 24 * HOUR)

    def is_due(self, time: float) -> bool:
        """Tell whether there is work at this time (plant's clock, seconds since 1970 UTC)."""
        state = self._bundles.state
        if state.attempt is not None or self._is_to_go_back() or (self.is_pinned and self._has_plans()):
            return True
        if self._shadow_is_over(time) or self._look_is_due(time):
            return True
        waits = state.candidate is None and state.watch_since is None and not self.is_pinned
        if waits and self._source and time >= self._next_check:
            return True
        return state.active is not None and time >= self._next_errors

    def work(self, time: float) -> None:
        """Do what is due."""
        state = self._bundles.state
        try:
            if state.attempt is not None:
                self._reject_what_went_down(time, state.attempt)
            if self._is_to_go_back():
                self._take_back(time)
            if self.is_pinned:
                self._bundles.settle(self.wishes.pinned or "")
            elif state.candidate is not None:
                if self._shadow_is_over(time):
                    self._judge_shadow(time)
            elif state.watch_since is not None:
                if self._look_is_due(time):
                    self._judge_probation(time)
            elif time >= self._next_check:
                self._next_check = time + HOUR * self._rules.check_hours
                self._look_for_candidate(time)
            if state.active is not None and time >= self._next_errors:
                self._next_errors = time + HOUR * self._rules.live_error_hours
                self._compute_live_error(time)
        finally:
            self._bundles.save()

    @property
    def is_pinned(self) -> bool:
        """The operator wants the bundle in force to stay."""
        return self.wishes.pinned is not None and self.wishes.pinned == self._bundles.state.active

    def _has_plans(self) -> bool:
        """Tell whether another bundle waits to rule, or the one in force is on probation."""
        return self._bundles.state.candidate is not None or self._bundles.state.watch_since is not None

    def _is_to_go_back(self) -> bool:
        """Tell whether the operator wants the earlier bundle; a wish that was fulfilled is over."""
        state = self._bundles.state
        return self.wishes.taken_back is not None and self.wishes.taken_back == state.active and bool(state.previous)

    def _take_back(self, time: float) -> None:
        active = self._bundles.active
        if active is not None:
            self._go_back(time, active, "taken back by the operator", None, {})

    def _shadow_is_over(self, time: float) -> bool:
        state = self._bundles.state
        return state.candidate is not None and time >= state.candidate_since + HOUR * self._rules.shadow_hours

    def _look_is_due(self, time: float) -> bool:
        since = self._bundles.state.watch_since
        return since is not None and time >= max(self._next_watch, since + FIRST_LOOK)

    def _reject_what_went_down(self, time: float, identity: str) -> None:
        self._bundles.state.attempt = None
        self._bundles.reject(time, Verdict("rejected", identity, identity, WENT_DOWN))

    def _look_for_candidate(self, time: float) -> None:
        if self._source is None:
            return
        fetched: Fetched | None = None
        try:
            fetched = self._source.fetch(self._site, self._bundles.settled)
            bundle = None if fetched is None else self._bundles.take(fetched)
        except (UpdateError, BundleError, ProcessError) as error:
            if fetched is not None and isinstance(error, BundleRefusedError | BundleError | ProcessError):
                identity = identity_of(fetched)
                self._bundles.reject(time, Verdict("rejected", identity, identity, str(error)))
            if str(error) != self.last_refusal:
                self.last_refusal = str(error)
                self._teller.event(time, "update_refused", {"reason": str(error)})
            return
        self.last_refusal = ""
        if bundle is None:
            return
        if self._bundles.active is None:
            self._adopt(time, bundle, None, "the first bundle; there was none to compare it with")
            return
        self._bundles.shadow(bundle, time)
        effects = [effect.name for effect in bundle.manifest.effects]
        self._teller.event(
            time, "shadow_began", {"bundle": bundle.label, "hours": self._rules.shadow_hours, "effects": effects}
        )

    def _judge_shadow(self, time: float) -> None:
        state, rules = self._bundles.state, self._rules
        assert state.candidate is not None
        candidate = self._bundles.known[state.candidate]
        try:
            with self._bundles.attempt(candidate.identity):
                comparison = self._compare(candidate, self._bundles.active, state.candidate_since, time)
        except (BundleError, ProcessError) as error:
            reason = f"cannot predict: {error}"
            self._bundles.reject(time, Verdict("rejected", candidate.identity, candidate.label, reason))
            return
        if not any(pair.count for pair in comparison.pairs):
            # A log full of gaps says nothing about the candidate; it waits for a better day.
            state.candidate_since = time - HOUR * (rules.shadow_hours - 6.0)
        elif comparison.not_worse(rules.tolerance, rules.worst):
            reason = f"errors in the shadow run are {comparison.score:.2f} times those before"
            self._adopt(time, candidate, comparison, reason)
        else:
            reason = f"worse in the shadow run: {comparison.words()}"
            self._bundles.reject(time, Verdict("rejected", candidate.identity, candidate.label, reason, comparison))

    def _judge_probation(self, time: float) -> None:
        state, rules = self._bundles.state, self._rules
        active, previous = self._bundles.active, self._bundles.previous
        assert state.watch_since is not None
        if active is None or previous is None:
            state.watch_since = None
            return
        over = time >= state.watch_since + HOUR * rules.watch_hours
        try:
            comparison = self._compare(active, previous, state.watch_since, time)
            after = self._errors(active, state.watch_since, time)
        except ProcessError as error:
            self._go_back(time, active, f"cannot predict: {error}", None, {})
            return
        self._next_watch = time + 24 * HOUR
        if not any(pair.count for pair in comparison.pairs):
            return
        tolerance, worst = (rules.tolerance, rules.worst) if over else (rules.early_tolerance, 2.0 * rules.worst)
        if not comparison.not_worse(tolerance, worst):
            reason = f"worse than its predecessor on the same days: {comparison.words()}"
            self._go_back(time, active, reason, comparison, after)
        elif over:
            state.watch_since = None
            state.last_verdict = f"{active.label} kept after its probation"
            live = {"before": state.live_before, "after": after}
            self._bundles.tell(time, Verdict("kept", active.identity, active.label, "", comparison, live))

    def _go_back(
        self, time: float, active: Bundle, reason: str, comparison: Comparison | None, after: dict[str, float]
    ) -> None:
        live = {"before": self._bundles.state.live_before, "after": after}
        self._bundles.go_back()
        self._bundles.reject(time, Verdict("went_back", active.identity, active.label, reason, comparison, live))

    def _adopt(self, time: float, bundle: Bundle, comparison: Comparison | None, reason: str) -> None:
        before: dict[str, float] = {}
        previous = self._bundles.active
        if previous is not None:
            with contextlib.suppress(ProcessError):
                before = self._errors(previous, time - HOUR * self._rules.shadow_hours, time)
        self._bundles.adopt(bundle, time, reason, before)
        live = {"before": before}
        self._bundles.tell(time, Verdict("adopted", bundle.identity, bundle.label, reason, comparison, live))

    def _compute_live_error(self, time: float) -> None:
        """Add how wrong the bundle in force was yesterday: free runs of a day that ended in the last hours."""
        active, state = self._bundles.active, self._bundles.state
        if active is None:
            return
        try:
            errors = self._errors(active, time - HOUR * (24.0 + self._rules.live_error_hours), time)
        except TelemetryError:
            return  # a site without a sensor that the simulator needs has no live error
        if errors:
            with self._bundles.lock:
                if state.judged != active.identity:
                    state.judged, state.judged_since = active.identity, time
                state.live_errors = [*state.live_errors, (time, errors)][-KEPT_ERRORS:]

    def _compare(self, candidate: Bundle, reference: Bundle | None, since: float, time: float) -> Comparison:
        comparison: Comparison = self._graphs.call(
            f"{_JUDGING}:compare_on_log", self._predictor, self._log_folder, self._rules.step_seconds,
            candidate, reference, since, time, seconds=JUDGE_SECONDS,
        )  # fmt: skip
        return comparison

    def _errors(self, bundle: Bundle, since: float, time: float) -> dict[str, float]:
        errors: dict[str, float] = self._graphs.call(
            f"{_JUDGING}:errors_on_log", self._predictor, self._log_folder, self._rules.step_seconds,
            bundle, since, time, seconds=JUDGE_SECONDS,
        )  # fmt: skip
        return errors
