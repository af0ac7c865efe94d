"""The life of a bundle on the gateway: candidate, shadow, adopted, on probation, kept or taken back."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import threading
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import numpy as np

from igrow.core.bundle import Bundle, BundleError
from igrow.core.telemetry import Telemetry, to_grid
from igrow.edge.ports import ActiveBundle
from igrow.edge.sentences import log_event
from igrow.edge.store.store import StoreError, read_telemetry
from igrow.edge.updates.rules import ReportBox, UpdateRules, UpdateStore
from igrow.edge.updates.shadow import Comparison, Predictor, compare, hindcast_errors
from igrow.edge.updates.shelf import Shelf
from igrow.edge.updates.signed_source import RefusedError, SignedSource, UpdateError
from igrow.edge.updates.state import load_state, save_state

_log = logging.getLogger(__name__)
HOUR = 3600.0
FIRST_LOOK = 25 * HOUR
"""Into the probation: long enough for a free run of a day to have ended."""
KEPT_ERRORS = 400


class BundleUpdates:
    """Implements `igrow.edge.ports.UpdateService`; all long work runs in one thread of its own."""

    def __init__(
        self,
        folder: Path,
        *,
        site: str,
        igrow_version: str,
        store: UpdateStore,
        predictor: Predictor,
        source: SignedSource | None = None,
        reports: ReportBox | None = None,
        rules: UpdateRules | None = None,
        first_bundle: Path | None = None,
    ) -> None:
        """Read the state in `folder`, and adopt `first_bundle` where no bundle is in force.

        Never raises for a bundle: a damaged one is replaced by its predecessor or by none, and recorded.
        """
        self._site = site
        self._store = store
        self._predictor = predictor
        self._source = source
        self._reports = reports
        self._rules = rules or UpdateRules()
        self._shelf = Shelf(folder / "bundles", site=site, igrow_version=igrow_version)
        self._state_file = folder / "state.json"
        self._state = load_state(self._state_file)
        self._lock = threading.Lock()
        self._bundles: dict[str, Bundle] = {}
        self._last_refusal = ""
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="updates")
        self._task: Future[None] | None = None
        self._next_check = self._next_errors = self._next_watch = 0.0
        with contextlib.suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
        self._recover()
        if self._state.active is None and first_bundle is not None:
            self._adopt_first(first_bundle)

    # --- igrow.edge.ports.UpdateService ---------------------------------------------------------------------------

    def active(self) -> ActiveBundle | None:
        """Return the bundle in force."""
        with self._lock:
            identity = self._state.active
            bundle = None if identity is None else self._bundles.get(identity)
        return None if bundle is None else ActiveBundle(bundle.label, bundle.folder)

    @property
    def busy(self) -> bool:
        """Work is under way in the thread."""
        return self._task is not None and not self._task.done()

    def tick(self, time: float | None) -> None:
        """Start what is due at this time (plant's clock, seconds since 1970 UTC); never blocks."""
        if time is None or self.busy:
            return
        if self._task is not None and (error := self._task.exception()) is not None:
            self._event(time, "update_failed", {"reason": f"{type(error).__name__}: {error}"})
        self._task = None
        if self._is_due(time):
            self._store.flush()
            self._task = self._worker.submit(self._work, time)

    async def wait(self, timeout: float) -> None:  # noqa: ASYNC109  # the signature is igrow.edge.ports.UpdateService's
        """Return when not busy, or after `timeout` seconds of wall clock."""
        if self._task is not None:
            await asyncio.wait([asyncio.wrap_future(self._task)], timeout=timeout)

    def describe(self) -> Mapping[str, object]:
        """Return what the status page shows."""
        with self._lock:
            state = self._state
            active = self._bundles.get(state.active or "")
            candidate = self._bundles.get(state.candidate or "")
            return {
                "name": active.label if active else None,
                "identity": active.identity if active else None,
                "created": active.manifest.created.isoformat() if active else None,
                "variant": active.manifest.variant if active else None,
                "effects": [effect.name for effect in active.manifest.effects] if active else [],
                "previous": state.previous,
                "candidate": candidate.label if candidate else None,
                "shadow_until": state.candidate_since + HOUR * self._rules.shadow_hours if candidate else None,
                "probation_until": None
                if state.watch_since is None
                else state.watch_since + HOUR * self._rules.watch_hours,
                "live_errors": dict(state.live_errors[-1][1]) if state.live_errors else {},
                "live_error_history": [[time, errors] for time, errors in state.live_errors],
                "rejected": dict(state.rejected),
                "last_verdict": state.last_verdict,
                "refusal": self._last_refusal,
            }

    def close(self) -> None:
        """Stop; work under way is finished first."""
        self._worker.shutdown(wait=True, cancel_futures=True)

    # --- the work, in the thread ----------------------------------------------------------------------------

    def _is_due(self, time: float) -> bool:
        state, rules = self._state, self._rules
        if state.candidate is not None:
            if time >= state.candidate_since + HOUR * rules.shadow_hours:
                return True
        elif state.watch_since is None and self._source is not None and time >= self._next_check:
            return True
        if state.watch_since is not None and time >= max(self._next_watch, state.watch_since + FIRST_LOOK):
            return True
        return state.active is not None and time >= self._next_errors

    def _work(self, time: float) -> None:
        state, rules = self._state, self._rules
        try:
            if state.candidate is not None:
                if time >= state.candidate_since + HOUR * rules.shadow_hours:
                    self._judge_shadow(time)
            elif state.watch_since is not None:
                if time >= max(self._next_watch, state.watch_since + FIRST_LOOK):
                    self._judge_probation(time)
            elif time >= self._next_check:
                self._next_check = time + HOUR * rules.check_hours
                self._look_for_candidate(time)
            if state.active is not None and time >= self._next_errors:
                self._next_errors = time + HOUR * rules.live_error_hours
                self._compute_live_error(time)
        finally:
            with contextlib.suppress(OSError):
                save_state(self._state_file, state)

    def _look_for_candidate(self, time: float) -> None:
        if self._source is None:
            return
        state = self._state
        known = {state.active or "", *state.rejected} - {""}
        fetched = None
        try:
            fetched = self._source.fetch(self._site, known)
            if fetched is None:
                self._last_refusal = ""
                return
            bundle = self._shelf.put(fetched.archive)
            if bundle.identity in known:
                return  # published again under another signature
        except (UpdateError, BundleError) as error:
            if fetched is not None and isinstance(error, RefusedError | BundleError):
                self._reject(time, fetched.identity, fetched.identity, str(error), None, {})
            if str(error) != self._last_refusal:
                self._last_refusal = str(error)
                self._event(time, "update_refused", {"reason": str(error)})
            return
        self._last_refusal = ""
        with self._lock:
            self._bundles[bundle.identity] = bundle
        if state.active is None:
            self._adopt(time, bundle, None, "the first bundle; there was none to compare it with")
            return
        with self._lock:
            state.candidate, state.candidate_since = bundle.identity, time
        self._event(
            time,
            "shadow_began",
            {"bundle": bundle.label, "hours": self._rules.shadow_hours, "effects": _effects(bundle)},
        )

    def _judge_shadow(self, time: float) -> None:
        state, rules = self._state, self._rules
        assert state.candidate is not None
        candidate = self._bundles[state.candidate]
        reference = self._bundles.get(state.active or "")
        try:
            comparison = self._compare(candidate, reference, state.candidate_since, time)
        except BundleError as error:
            with self._lock:
                state.candidate = None
            self._reject(time, candidate.identity, candidate.label, f"cannot predict: {error}", None, {})
            self._tidy()
            return
        if not any(pair.count for pair in comparison.pairs):
            # A log full of gaps says nothing about the candidate; it waits for a better day.
            with self._lock:
                state.candidate_since = time - HOUR * (rules.shadow_hours - 6.0)
            return
        with self._lock:
            state.candidate = None
        if comparison.not_worse(rules.tolerance, rules.worst):
            self._adopt(
                time, candidate, comparison, f"errors in the shadow run are {comparison.score:.2f} times those before"
            )
        else:
            reason = f"worse in the shadow run: {comparison.words()}"
            self._reject(time, candidate.identity, candidate.label, reason, comparison, {})
            self._tidy()

    def _judge_probation(self, time: float) -> None:
        state, rules = self._state, self._rules
        assert state.watch_since is not None
        self._next_watch = time + 24 * HOUR
        active, previous = self._bundles.get(state.active or ""), self._bundles.get(state.previous or "")
        over = time >= state.watch_since + HOUR * rules.watch_hours
        if active is None or previous is None:
            state.watch_since = None
            return
        comparison = self._compare(active, previous, state.watch_since, time)
        if not any(pair.count for pair in comparison.pairs):
            return
        after = hindcast_errors(
            self._predictor, active, self._grid(state.watch_since, time), _instant(state.watch_since), _instant(time)
        )
        live = {"before": state.live_before, "after": after}
        tolerance, worst = (rules.tolerance, rules.worst) if over else (rules.early_tolerance, 2.0 * rules.worst)
        if not comparison.not_worse(tolerance, worst):
            reason = f"worse than its predecessor on the same days: {comparison.words()}"
            with self._lock:
                state.active, state.previous, state.watch_since = previous.identity, None, None
            self._reject(time, active.identity, active.label, reason, comparison, live, verdict="went_back")
            self._tidy()
        elif over:
            with self._lock:
                state.watch_since = None
                state.last_verdict = f"{active.label} kept after its probation"
            self._tell(time, "kept", active.identity, active.label, "", comparison, live)

    def _adopt(self, time: float, bundle: Bundle, comparison: Comparison | None, reason: str) -> None:
        state = self._state
        previous = self._bundles.get(state.active or "")
        before: dict[str, float] = {}
        if previous is not None:
            since = time - HOUR * self._rules.shadow_hours
            before = hindcast_errors(
                self._predictor, previous, self._grid(since, time), _instant(since), _instant(time)
            )
        with self._lock:
            state.previous, state.active = state.active, bundle.identity
            state.watch_since = time if previous is not None else None
            state.live_before = before
            state.last_verdict = f"{bundle.label} adopted: {reason}"
        self._tidy()
        self._tell(time, "adopted", bundle.identity, bundle.label, reason, comparison, {"before": before})

    def _reject(
        self,
        time: float,
        identity: str,
        label: str,
        reason: str,
        comparison: Comparison | None,
        live: Mapping[str, object],
        *,
        verdict: str = "rejected",
    ) -> None:
        with self._lock:
            if identity:
                self._state.rejected[identity] = reason
            self._state.last_verdict = f"{label} {verdict.replace('_', ' ')}: {reason}"
        self._tell(time, verdict, identity, label, reason, comparison, live)

    def _tell(
        self,
        time: float,
        verdict: str,
        identity: str,
        label: str,
        reason: str,
        comparison: Comparison | None,
        live: Mapping[str, object],
    ) -> None:
        """Record a verdict as an event, and leave a report for the trainer."""
        with contextlib.suppress(OSError):
            save_state(self._state_file, self._state)
        content = {
            "site": self._site,
            "time": str(_instant(time)) + "Z",
            "verdict": verdict,
            "bundle": label,
            "identity": identity,
            "reason": reason,
            "comparison": [] if comparison is None else comparison.table(),
            "live_error": dict(live),
        }
        self._event(time, f"bundle_{verdict}", content)
        if self._reports is not None:
            try:
                self._reports.leave_report(time, f"{identity[:8] or 'bundle'}-{verdict}", content)
            except OSError as error:
                _log.warning("the report on bundle %s could not be left in the exchange: %s", label, error)

    def _compute_live_error(self, time: float) -> None:
        active = self._bundles.get(self._state.active or "")
        if active is None:
            return
        # Free runs of a day that ended in the last hours; each value so answers "how wrong were we yesterday".
        since = time - HOUR * (24.0 + self._rules.live_error_hours)
        errors = hindcast_errors(self._predictor, active, self._grid(since, time), _instant(since), _instant(time))
        if errors:
            with self._lock:
                self._state.live_errors = [*self._state.live_errors, (time, errors)][-KEPT_ERRORS:]

    def _compare(self, candidate: Bundle, reference: Bundle | None, since: float, time: float) -> Comparison:
        log = self._grid(since, time)
        return compare(self._predictor, candidate, reference, log, _instant(since), _instant(time))

    def _grid(self, since: float, time: float) -> Telemetry:
        """Return the log from a day before `since`, as history for the simulator, on the regular grid."""
        try:
            stored = read_telemetry(self._store.folder, since - 24 * HOUR, time)
        except StoreError:
            stored = Telemetry(np.empty(0, dtype="datetime64[s]"), {})
        return to_grid(stored, self._rules.step_seconds)

    def _event(self, time: float | None, kind: str, detail: Mapping[str, object]) -> None:
        self._store.record_event(time, kind, detail)
        log_event(kind, detail)

    # --- start and order ------------------------------------------------------------------------------------

    def _recover(self) -> None:
        """Read the bundles that the state names; one that is damaged is dropped, the active one replaced."""
        state = self._state
        for role in ("previous", "candidate", "active"):
            identity = getattr(state, role)
            if identity is None:
                continue
            try:
                self._bundles[identity] = self._shelf.get(identity)
            except BundleError as error:
                self._event(None, "bundle_damaged", {"bundle": identity, "reason": str(error)})
                setattr(state, role, None)
                if role == "active" and state.previous is not None:
                    state.active, state.previous = state.previous, None
                    state.watch_since = None
                    self._event(None, "bundle_went_back", {"bundle": identity, "reason": "it is damaged"})

    def _adopt_first(self, folder: Path) -> None:
        try:
            bundle = self._shelf.put_folder(folder)
        except (BundleError, UpdateError) as error:
            self._last_refusal = str(error)
            self._event(None, "update_refused", {"reason": str(error)})
            return
        self._bundles[bundle.identity] = bundle
        self._state.active = bundle.identity
        self._state.last_verdict = f"{bundle.label} installed by the configuration"
        self._event(None, "bundle_installed", {"bundle": bundle.label})
        with contextlib.suppress(OSError):
            save_state(self._state_file, self._state)

    def _tidy(self) -> None:
        """Keep the bundle in force and its predecessor (and a candidate) on the disk, no other."""
        state = self._state
        wanted = {identity for identity in (state.active, state.previous, state.candidate) if identity}
        with self._lock:
            self._bundles = {identity: b for identity, b in self._bundles.items() if identity in wanted}
        self._shelf.keep_only(wanted)


def _effects(bundle: Bundle) -> list[str]:
    return [effect.name for effect in bundle.manifest.effects]


def _instant(seconds: float) -> np.datetime64:
    return np.datetime64(int(seconds), "s")
