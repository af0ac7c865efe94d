"""How a verdict on a bundle is told: as an event in the ledger, and as a report for the trainer in the exchange."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from igrow.edge.sentences import log_event
from igrow.edge.updates.rules import ReportBox, UpdateStore
from igrow.edge.updates.shadow import Comparison

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Verdict:
    """What became of one bundle."""

    verdict: str
    """adopted, kept, rejected or went_back."""
    identity: str
    label: str
    reason: str
    comparison: Comparison | None = None
    live: Mapping[str, object] | None = None
    """Live errors before and after."""


class Teller:
    """Tells what happens to bundles."""

    def __init__(self, site: str, store: UpdateStore, reports: ReportBox | None) -> None:
        self._site = site
        self._store = store
        self._reports = reports

    def event(self, time: float | None, kind: str, detail: Mapping[str, object]) -> None:
        """Record an event, and say it in the journal."""
        self._store.record_event(time, kind, detail)
        log_event(kind, detail)

    def verdict(self, time: float, given: Verdict) -> None:
        """Record a verdict, and leave a report on it."""
        content = {
            "site": self._site,
            "time": f"{np.datetime64(int(time), 's')}Z",
            "verdict": given.verdict,
            "bundle": given.label,
            "identity": given.identity,
            "reason": given.reason,
            "comparison": [] if given.comparison is None else given.comparison.table(),
            "live_error": dict(given.live or {}),
        }
        self.event(time, f"bundle_{given.verdict}", content)
        if self._reports is None:
            return
        try:
            self._reports.leave_report(time, f"{given.identity[:8] or 'bundle'}-{given.verdict}", content)
        except OSError as error:
            _log.warning("the report on bundle %s could not be left in the exchange: %s", given.label, error)
