"""The errors of a bundle on a log, as it will be used: driven by what the actuators did, and by setpoints alone.

Persistence is what any of them must beat: as at the start an hour ahead, as one run earlier over a day or a week.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from igrow.core.arrays import Floats, Integers
from igrow.core.bundle import Bundle, Manifest
from igrow.core.effects import EFFECTS
from igrow.core.errors import IgrowError
from igrow.core.quantities import SETPOINTS, WEATHER
from igrow.core.simulator.hybrid.record import Record
from igrow.core.simulator.outcome import Outcome
from igrow.core.simulator.plan import BundleSimulator
from igrow.core.site import Site
from igrow.trainer.data import Log
from igrow.trainer.diagnosis.knowledge import activate, active_term
from igrow.trainer.exporting import read_model
from igrow.trainer.fit.actuation import setpoint_columns
from igrow.trainer.fit.evaluation import EVERY, Errors, Evaluation, Predictor, errors_of, free_runs, summarise
from igrow.trainer.fit.model import FittedModel
from igrow.trainer.fit.unseen_days import unseen
from igrow.trainer.progress import Progress, silent

HORIZONS = ("1_h", "24_h", "7_d")
ACTUATORS, BY_SETPOINTS = "by actuators", "by setpoints"
"""How a simulator is driven."""
_DAY = 24
_WEEKS_EVERY = 3 * EVERY
"""Seconds between the starts of runs of a week, which overlap for days as it is."""


def score_bundle(
    log: Log, bundle: Bundle, horizons: Sequence[str] = HORIZONS, progress: Progress = silent
) -> dict[str, Evaluation]:
    """Return the errors by the way of driving: `ACTUATORS` (hybrid bundles only) and `BY_SETPOINTS`.

    Days that the bundle was calibrated on, where it was on this very greenhouse, are left out.

    Args:
        log: of the greenhouse.
        bundle: of either variant.
        horizons: of `igrow.trainer.fit.evaluation.HORIZONS`.
        progress: is told what is being done, in lines.

    Raises:
        IgrowError: the log cannot be used, or has no unseen days.
    """
    log = unseen_part(log, bundle.manifest)
    log.require("an evaluation", days=2.0)
    site = log.known_site
    if bundle.manifest.variant == "network":
        from igrow.trainer.research.network.log_runs import climate_runs  # noqa: PLC0415  (torch is slow to import)

        record = log.record()
        by_setpoints = climate_runs(bundle.folder, record, setpoint_columns(log.telemetry, record, site)[0])
        return {BY_SETPOINTS: _scores(record, by_setpoints, horizons, BY_SETPOINTS, progress)}
    record, by_actuators = runs_by_actuators(log, read_model(bundle, site))
    found = {ACTUATORS: _scores(record, by_actuators, horizons, ACTUATORS, progress)}
    setpoints, _ = setpoint_columns(log.telemetry, record, site)
    planned = planned_runs(bundle, site, record, setpoints)
    return found | {BY_SETPOINTS: _scores(record, planned, horizons, BY_SETPOINTS, progress)}


def runs_by_actuators(log: Log, model: FittedModel) -> tuple[Record, Predictor]:
    """Return a log as a model reads it, and the model's runs along it, driven by what the actuators did."""
    alignment = log.best_shift(model.posterior.values) if model.alignment is None else model.alignment
    record = log.record(alignment)
    terms = [active_term(effect) for effect in model.effects if effect.name in EFFECTS]
    return record, free_runs(record, model.posterior.values, activate(record, terms))


def _scores(record: Record, predict: Predictor, horizons: Sequence[str], how: str, progress: Progress) -> Evaluation:
    found: dict[tuple[str, str], Errors] = {}
    for horizon in horizons:
        progress(f"running {horizon.replace('_', ' ')} ahead {how}")
        found |= errors_of(record, predict, (horizon,), every=_WEEKS_EVERY if horizon == "7_d" else EVERY)
    return summarise([found])


def unseen_part(log: Log, model: FittedModel | Manifest) -> Log:
    """Return the part of a log that a model was not calibrated on, with a note on what was left out.

    Raises:
        IgrowError: there is none.
    """
    rest, until = unseen(log, model)
    if until is None:
        return log
    if len(rest) == 0:
        raise IgrowError(
            f"{log.name}: the model was calibrated on days up to {until:%Y-%m-%d %H:%M} UTC, all days of this log are "
            "among them: give a later one"
        )
    return replace(rest, notes=(*log.notes, f"days up to {until:%Y-%m-%d %H:%M} UTC were fitted on: left out"))


def planned_runs(bundle: Bundle, site: Site, record: Record, setpoints: Mapping[str, Floats]) -> Predictor:
    """Return runs of a bundle's planning graph, from the measured state by weather and setpoints, hour by hour.

    Within an hour nothing is predicted: NaN.

    Args:
        bundle: of either variant that plans.
        site: whose greenhouse it is.
        record: of the log.
        setpoints: on its grid, (n,) each.
    """
    simulator = BundleSimulator(bundle, site.greenhouse, members=1)
    hour = max(1, round(3600.0 / record.step))
    weather = np.stack([record.inputs[name] for name in WEATHER if name in record.inputs], axis=1)
    usual = {name: np.full(len(record), site.limits[name].safe) for name in SETPOINTS}
    asked = np.stack([setpoints.get(name, usual[name]) for name in SETPOINTS], axis=1)
    last = len(record) - 1
    known: dict[tuple[int, int], Outcome] = {}

    def hourly(table: Floats, start: int, hours: int) -> Floats:
        rows = np.minimum(start + np.arange(hours * hour), last)
        return np.asarray(table[rows].reshape(hours, hour, -1).mean(axis=1))

    def predict(starts: Integers, steps: int) -> Mapping[str, Floats]:
        whole = -(-steps // (hour * _DAY)) * _DAY
        ends = hour * np.arange(1, steps // hour + 1) - 1
        shown = {name: np.full((steps, len(starts)), np.nan) for name in record.measured}
        for column, start in enumerate(starts.tolist()):
            if (start, whole) not in known:
                state = {name: float(values[start]) for name, values in {**record.inputs, **record.measured}.items()}
                day_before = record.measured["air_temperature"][max(0, start - _DAY * hour) : start + 1]
                state["mean_air_temperature"] = float(np.nanmean(day_before))
                ahead = hourly(weather, start, whole), hourly(asked, start, whole)[None]
                known[start, whole] = simulator.simulate(state, *ahead, record.time[start])
            for name, values in shown.items():
                values[ends, column] = getattr(known[start, whole], name)[0, 0, : len(ends)]
        return shown

    return predict
