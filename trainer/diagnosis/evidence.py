"""What a verdict rests on: the log as it was split, what the search found first, and the free runs on unseen days."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from igrow.core.arrays import Floats
from igrow.trainer.diagnosis.actuators import Completed
from igrow.trainer.diagnosis.compare import Round
from igrow.trainer.diagnosis.correction import Corrected
from igrow.trainer.diagnosis.freerun import HORIZONS, FreeRuns, LogDays, Stage, mean_absolute_errors
from igrow.trainer.diagnosis.knowledge import ActiveTerm, Knowledge


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


def stages_of(result: Corrected, completed: Completed, logged: LogDays) -> dict[str, tuple[Stage, LogDays]]:
    """Return every stage with the log that it sees: an actuator that the log lacks counts from the correction on."""
    stages = {name: (stage, completed.days) for name, stage in result.stages.items()}
    if completed.recalibrated is not None:
        stages |= {
            "deployed": (result.stages["deployed"], logged),
            "recalibrated": (completed.recalibrated, logged),
        }
    return stages


def runs_of(stages: Mapping[str, tuple[Stage, LogDays]]) -> dict[str, dict[str, FreeRuns]]:
    """Return the free runs on held-out days: horizon -> stage, where one fits."""
    return {
        horizon: {name: run for name, (stage, seen) in stages.items() if (run := seen.run(stage, horizon)) is not None}
        for horizon in HORIZONS
    }


def errors_of(runs: Mapping[str, Mapping[str, FreeRuns]]) -> Mapping[str, Mapping[str, Mapping[str, float]]]:
    """Return the mean absolute errors on held-out days: quantity -> horizon -> stage."""
    table: dict[str, dict[str, dict[str, float]]] = {}
    for horizon, by_stage in runs.items():
        for name, run in by_stage.items():
            for quantity, error in mean_absolute_errors(run).items():
                table.setdefault(quantity, {}).setdefault(horizon, {})[name] = error
    return table


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
    fitted = log.fit(evidence.knowledge.prior, causes, added=added)
    return mean_absolute_errors(log.run(Stage(fitted, causes, {}, added or {})))
