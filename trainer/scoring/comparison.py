"""Simulators side by side on a log that none of them has seen."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from igrow.core.bundle import Bundle, read_bundle
from igrow.core.errors import IgrowError
from igrow.core.quantities import QUANTITIES
from igrow.trainer.data import Log
from igrow.trainer.exporting import read_model
from igrow.trainer.fit.evaluation import CARRIED, ErrorSummary, Evaluation, errors_of, summarise
from igrow.trainer.fit.model import FittedModel
from igrow.trainer.given import READ, must_be
from igrow.trainer.scoring.bundles import BY_SETPOINTS, runs_by_actuators, score_bundle, unseen_part

PERSISTENCE = "persistence"
Judged = FittedModel | Bundle | str | Path
"""A model, a bundle, or the folder of one."""


@dataclass(frozen=True, repr=False)
class Comparison:
    """Mean absolute errors of several simulators on one log, beside persistence."""

    log: str
    scores: Mapping[str, Evaluation]
    """By the simulator's name."""

    def rows(self) -> list[dict[str, Any]]:
        """Return a row for each simulator, quantity and horizon: mean absolute error with its 90 % interval."""
        return [
            {
                "simulator": name,
                "quantity": quantity,
                "horizon": horizon,
                "mae": one.mae,
                "mae_low": one.mae_low,
                "mae_high": one.mae_high,
                PERSISTENCE: one.persistence,
                "unit": QUANTITIES[quantity].difference_unit,
            }
            for name, evaluation in self.scores.items()
            for quantity, horizons in evaluation.items()
            for horizon, one in horizons.items()
        ]

    def __repr__(self) -> str:
        return as_table(self.scores)

    def to_pandas(self) -> Any:
        """Return `rows` as a `pandas.DataFrame`."""
        import pandas as pd  # noqa: PLC0415  (slow to import)

        return pd.DataFrame(self.rows())


def as_table(scores: Mapping[str, Evaluation], *, intervals: bool = False) -> str:
    """Return mean absolute errors beside persistence, a line for each quantity and horizon.

    Args:
        scores: by the simulator's name, or by how it is driven.
        intervals: with their 90 % intervals over days.
    """

    def cell(one: ErrorSummary | None) -> str:
        if one is None:
            return "-"
        return f"{one.mae:.3g} [{one.mae_low:.3g}, {one.mae_high:.3g}]" if intervals else f"{one.mae:.3g}"

    width = max(30 if intervals else 14, *(len(name) + 2 for name in scores))
    names = "".join(f"{name:>{width}}" for name in scores)
    lines = [f"{'mean absolute error':20}{'ahead':>7}{PERSISTENCE:>14}{names}"]
    every = [(quantity, horizon) for one in scores.values() for quantity, by in one.items() for horizon in by]
    for quantity, horizon in dict.fromkeys(every):
        found = [one.get(quantity, {}).get(horizon) for one in scores.values()]
        naive = next(one.persistence for one in found if one is not None)
        cells = "".join(f"{cell(one):>{width}}" for one in found)
        lines.append(f"{quantity:20}{horizon:>7}{naive:14.3g}{cells}  {QUANTITIES[quantity].difference_unit}")
    return "\n".join(lines)


def compare(
    simulators: Mapping[str, Judged] | Sequence[Judged], log: Log, horizons: Sequence[str] = CARRIED
) -> Comparison:
    """Return the errors of several simulators on a log.

        compare([model, result.corrected, "bundle/"], newest)
        compare({"before": model, "after": result.corrected}, newest)

    Args:
        simulators: models, bundles or folders of bundles, with names where they are a mapping.
        log: of the greenhouse; those of its days that a simulator was calibrated on are left out for that one.
        horizons: of `igrow.trainer.fit.evaluation.HORIZONS`.

    Raises:
        IgrowError: a bundle cannot be read, the log cannot be used, or a simulator has seen all of it.
    """
    must_be(Log, log, READ)
    if not simulators:
        raise IgrowError("no simulator is given: a model, a bundle or the folder of one is needed")
    given = simulators.items() if isinstance(simulators, Mapping) else _named(simulators)
    return Comparison(log.name, {name: _scores(one, log, horizons) for name, one in given})


def _named(simulators: Sequence[Judged]) -> Iterable[tuple[str, Judged]]:
    for number, one in enumerate(simulators, 1):
        if isinstance(one, FittedModel):
            yield f"{number} {one.calibrated_on or 'described'}", one
        else:
            yield f"{number} {one.label if isinstance(one, Bundle) else Path(one).name}", one


def _scores(simulator: Judged, log: Log, horizons: Sequence[str]) -> Evaluation:
    """Return the errors driven by what the actuators did; of the network variant, by the setpoints that it knows."""
    if not isinstance(simulator, FittedModel):
        bundle = simulator if isinstance(simulator, Bundle) else read_bundle(Path(simulator))
        if bundle.manifest.variant == "network":
            return score_bundle(log, bundle, horizons)[BY_SETPOINTS]
        simulator = read_model(bundle, log.known_site)
    return summarise([errors_of(*runs_by_actuators(unseen_part(log, simulator), simulator), horizons)])
