"""What a verdict rests on: the log as it was split, what the search found first, and the free runs on unseen days."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from igrow.core.arrays import Floats
from igrow.trainer.diagnosis.design.freerun import FreeRuns, LogDays, Stage, mean_absolute_errors
from igrow.trainer.diagnosis.knowledge import ActiveTerm, Knowledge
from igrow.trainer.diagnosis.search.change import Round


@dataclass(frozen=True)
class Evidence:
    """What supports a diagnosis."""

    log: LogDays
    knowledge: Knowledge
    """Of the greenhouse before this log."""
    first: Round
    """What the search found first."""
    stages: Mapping[str, Stage]
    runs: Mapping[str, FreeRuns]
    """24 h free runs on held-out days by stage."""


def errors_with(
    evidence: Evidence, terms: Sequence[ActiveTerm], added: Mapping[str, Floats] | None = None
) -> dict[str, float]:
    """Return the 24 h errors on unseen days of the model with given causes, its parameters refitted: the oracle's.

    Args:
        evidence: of a diagnosis.
        terms: causes that are known to be there.
        added: further fluxes that are known to be there, by channel, (n,).
    """
    log, causes = evidence.log, (*evidence.knowledge.terms, *terms)
    fitted = log.fit(evidence.knowledge.shipped_prior, causes, added=added)
    return mean_absolute_errors(log.run(Stage(fitted, causes, {}, added or {})))
