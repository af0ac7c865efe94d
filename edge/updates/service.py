"""The updates as the daemon has them: one thread that looks for bundles and lives their lives, and what it shows."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from concurrent.futures import Future
from pathlib import Path
from typing import TYPE_CHECKING

from igrow.core.bundle import BundleError
from igrow.core.errors import IgrowError
from igrow.edge.hand_off import HandOff, LateError, settled
from igrow.edge.planning.graph_process import ProcessError
from igrow.edge.ports import ActiveBundle
from igrow.edge.updates.bundles import Bundles
from igrow.edge.updates.fetched import BundleRefusedError, UpdateError
from igrow.edge.updates.life import HOUR, BundleLife
from igrow.edge.updates.rules import Graphs, ReportBox, UpdateRules, UpdateStore
from igrow.edge.updates.shadow import Predictor
from igrow.edge.updates.shelf import Shelf
from igrow.edge.updates.telling import Teller
from igrow.edge.updates.wishes import Wishes, read_wishes
from igrow.edge.updates.worsening import Worsening, find_worsening, worsening_sentence

if TYPE_CHECKING:
    from igrow.edge.updates.signed_source import SignedSource

LATE_AFTER = 1800.0
"""Seconds after which the thread counts as held by a share: longer than the longest comparison."""
RETRY = 600.0
"""Seconds after work that failed until it is tried again; each failure in a row doubles them."""
LONGEST_RETRY = 86_400.0
CLOSE_SECONDS = 2.0
"""How long work under way is waited for at the stop, after the process for graphs was ended."""


class BundleUpdates:
    """Implements `igrow.edge.ports.UpdateService`."""

    def __init__(
        self,
        folder: Path,
        *,
        site: str,
        igrow_version: str,
        store: UpdateStore,
        graphs: Graphs,
        predictor: Predictor,
        source: SignedSource | None = None,
        reports: ReportBox | None = None,
        rules: UpdateRules | None = None,
        first_bundle: Path | None = None,
    ) -> None:
        """Begin to read the state in `folder`, and to adopt `first_bundle` where no bundle is in force.

        Never raises for a bundle: a damaged one is replaced by its predecessor or by none, and recorded.
        """
        self._store = store
        self._rules = rules or UpdateRules()
        self._first_bundle = first_bundle
        self._teller = Teller(site, store, reports)
        shelf = Shelf(folder / "bundles", site=site, igrow_version=igrow_version)
        self._bundles = Bundles(folder / "state.json", shelf, graphs, self._teller)
        self._life = BundleLife(site, self._bundles, source, graphs, predictor, store.folder, self._teller, self._rules)
        self._aside = HandOff("updates", late_after=LATE_AFTER)
        self._looked_at: tuple[str, float] | None = None
        self._found: tuple[Worsening, ...] = ()
        self._folder = folder
        # The look at the operator's wishes must not wait behind a share that holds the updates.
        self._wishes = HandOff("the operator's wishes")
        self._look: Future[Wishes] | None = None
        self._begun = False
        self._again = 0.0
        """When work that has failed is tried again."""
        self._failures = 0
        """In a row."""
        self._problem = ""
        self._task: Future[None] | None = self._aside.post(self._begin)

    def active(self) -> ActiveBundle | None:
        """Return the bundle in force."""
        with self._bundles.lock:
            bundle = self._bundles.active
        return None if bundle is None else ActiveBundle(bundle.label, bundle.folder)

    @property
    def busy(self) -> bool:
        """Work is under way in the thread."""
        return self._task is not None and not self._task.done()

    @property
    def health(self) -> str:
        """Empty when all is well, else one line."""
        return self._aside.problem or self._problem

    def tick(self, time: float | None) -> None:
        """Start what is due at this time (plant's clock, seconds since 1970 UTC); never blocks."""
        if self.busy:
            return
        if self._task is not None:
            self._hear_how_it_ended(time, self._task.exception())
        self._task = None
        self._hear_wishes()
        if time is None:
            return
        self._life.keep_up(time)
        self._again = min(self._again, time + LONGEST_RETRY)
        if time < self._again:
            return
        if not self._begun:
            self._task = self._aside.post(self._begin)
        elif self._life.is_due(time):
            self._task = self._aside.post(lambda: self._work(time))

    def _hear_how_it_ended(self, time: float | None, error: BaseException | None) -> None:
        """Take note of what the thread's work has come to; what fails again and again is told once."""
        if error is None:
            self._failures, self._problem = 0, ""
            return
        reason = str(error) if isinstance(error, IgrowError) else f"{type(error).__name__}: {error}"
        if not self._failures:
            self._teller.event(time, "update_failed", {"reason": reason})
        self._problem = f"updates: {reason}"
        self._again = 0.0 if time is None else time + min(RETRY * 2.0**self._failures, LONGEST_RETRY)
        self._failures = min(self._failures + 1, 10)

    def _hear_wishes(self) -> None:
        """Take over what the operator asked for, when it has been read, and look again."""
        if self._look is not None and self._look.done():
            self._life.wishes, self._look = self._look.result(), None
        if self._look is None:
            with contextlib.suppress(LateError):
                self._look = self._wishes.post(lambda: read_wishes(self._folder))

    async def wait(self, timeout: float) -> None:  # noqa: ASYNC109  # the signature is igrow.edge.ports.UpdateService's
        """Return when not busy, or after `timeout` seconds of wall clock."""
        if self._task is not None:
            await settled(self._task, timeout)

    def describe(self) -> Mapping[str, object]:
        """Return what the status page shows."""
        with self._bundles.lock:
            state, active = self._bundles.state, self._bundles.active
            candidate = self._bundles.known.get(state.candidate or "")
            return {
                "name": active.label if active else None,
                "identity": active.identity if active else None,
                "created": active.manifest.created.isoformat() if active else None,
                "variant": active.manifest.variant if active else None,
                "effects": [effect.name for effect in active.manifest.effects] if active else [],
                "confounded": [[effect.name, *effect.confounded] for effect in active.manifest.effects]
                if active
                else [],
                "pinned": self._life.is_pinned,
                "previous": state.previous,
                "candidate": candidate.label if candidate else None,
                "shadow_until": state.candidate_since + HOUR * self._rules.shadow_hours if candidate else None,
                "probation_until": None
                if state.watch_since is None
                else state.watch_since + HOUR * self._rules.watch_hours,
                "live_errors": dict(state.live_errors[-1][1]) if state.live_errors else {},
                "live_error_history": [[time, errors] for time, errors in state.live_errors],
                "worse_since": worsening[0].since if (worsening := self._worsening()) else None,
                "rejected": dict(state.rejected),
                "last_verdict": state.last_verdict,
                "refusal": self._life.last_refusal,
            }

    @property
    def worsening(self) -> str:
        """One line where the bundle in force predicts worse than it did, else empty."""
        with self._bundles.lock:
            found = self._worsening()
        return "" if not found else worsening_sentence(found)

    def _worsening(self) -> tuple[Worsening, ...]:
        state = self._bundles.state
        if state.judged is None or state.judged != state.active or not state.live_errors:
            return ()
        newest = state.judged, state.live_errors[-1][0]
        if self._looked_at != newest:  # each cycle asks, a new error comes every few hours
            since = state.judged_since
            self._found = find_worsening([entry for entry in state.live_errors if entry[0] >= since])
            self._looked_at = newest
        return self._found

    def close(self) -> None:
        """Stop; the process for graphs has been ended, and a thread that hangs is left behind."""
        self._aside.close(CLOSE_SECONDS)

    def _begin(self) -> None:
        self._bundles.begin()
        if self._bundles.state.active is None and self._first_bundle is not None:
            try:
                self._bundles.install(self._first_bundle)
                self._life.last_refusal = ""
            except (BundleError, UpdateError, ProcessError) as error:
                self._life.last_refusal = str(error)
                if isinstance(error, UpdateError) and not isinstance(error, BundleRefusedError):
                    raise  # such as for a disk without room: another attempt may succeed
                self._teller.event(None, "update_refused", {"reason": str(error)})
        self._begun = True

    def _work(self, time: float) -> None:
        with contextlib.suppress(LateError):
            self._store.flush()
        self._life.work(time)
