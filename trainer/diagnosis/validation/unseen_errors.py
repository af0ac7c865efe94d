"""How well each stage of a diagnosis predicts days that nothing was fitted to."""

from __future__ import annotations

from collections.abc import Mapping

from igrow.trainer.diagnosis.design.freerun import HORIZONS, FreeRuns, LogDays, Stage, mean_absolute_errors
from igrow.trainer.diagnosis.search.actuators import Completed
from igrow.trainer.diagnosis.validation.correction import Corrected


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
