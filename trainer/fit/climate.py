"""The physical parameters of the climate stage, fitted to batched free runs of a day under a prior, robustly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from igrow.core.arrays import Floats, Integers, Mask
from igrow.core.effects import EFFECTS
from igrow.core.effects.definition import Parameter
from igrow.core.errors import IgrowError
from igrow.core.simulator.hybrid import record as records
from igrow.core.simulator.hybrid.climate import ActiveEffects
from igrow.core.simulator.hybrid.measurement import PREDICTED
from igrow.core.simulator.hybrid.nominal import nominal
from igrow.core.simulator.hybrid.parameters import PARAMETERS
from igrow.core.simulator.hybrid.record import Record
from igrow.core.site import Site
from igrow.trainer.fit.evaluation import starts_within
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.scales import CORRELATION_TIME, ERROR_SCALES, ROBUST
from igrow.trainer.fit.solver import DivergenceError, by_differences, covariance, solve
from igrow.trainer.progress import Progress, silent

RUN_HOURS, EVERY_HOURS = 24.0, 8.0
"""Length of the free runs, and hours between their starts."""
_SAMPLE = 1800.0
"""Seconds between the errors of a run that are kept."""
_LEAST_SPREAD = 0.02
"""Standard deviation of a site's prior, relative to the parameter's range, below which it would count as known."""
_LEAST_SCALE = 0.2
"""Spread of a fit's errors, in `ERROR_SCALES`, below which it says nothing of the next log."""

Part = tuple[Record, Mask | None]
"""A record, and which of its rows may be used, (n,); None: all."""


def site_prior(site: Site) -> Gaussian:
    """Return what is known of a greenhouse before any log: its description with the spreads of `PARAMETERS`."""
    values = nominal(site)
    deviation = {
        name: PARAMETERS[name].spread * max(abs(value), _LEAST_SPREAD * (PARAMETERS[name].high - PARAMETERS[name].low))
        for name, value in values.items()
    }
    return Gaussian.independent(values, deviation)


def bounds(names: Sequence[str]) -> tuple[Floats, Floats]:
    """Return the least and the largest value of physical parameters and of parameters of effects, (p,) each."""
    rows = [PARAMETERS[name] if name in PARAMETERS else _of_effect(name) for name in names]
    return np.array([one.low for one in rows]), np.array([one.high for one in rows])


def _of_effect(name: str) -> Parameter:
    """Return the definition of a parameter that is called ``effect:parameter``."""
    effect, _, own = name.partition(":")
    return next(one for one in EFFECTS[effect].parameters if one.name == own)


def fit_climate(
    parts: Sequence[Part],
    prior: Gaussian,
    effects: ActiveEffects | None = None,
    *,
    start: Mapping[str, float] | None = None,
    progress: Progress = silent,
) -> Gaussian:
    """Return the posterior of the parameters.

    Args:
        parts: records on the working grid; several compartments of one kind are fitted with one set of parameters.
        prior: of all parameters; one of an effect, to be fitted with them, is called ``effect:parameter``.
        effects: the active effects, held but for such parameters.
        start: where to begin, by name; what it lacks begins at the prior's mean.
        progress: is told of each step in a line.

    Raises:
        IgrowError: no complete run lies within the rows.
        DivergenceError: the model runs out of all bounds where the fit begins.
    """
    runs = [some for record, rows in parts if (some := _runs_of(record, rows)) is not None]
    if not runs:
        raise IgrowError(f"no stretch of {RUN_HOURS:g} h of the log is complete enough to calibrate on")
    low, high = bounds(prior.names)
    known = {name: [one.measured(name) for one in runs if name in one.quantities] for name in PREDICTED}
    measured = {name: np.concatenate(parts, axis=1) for name, parts in known.items() if parts}
    shapes = {name: values.shape for name, values in measured.items()}

    def batch(points: Floats) -> Floats:
        values = {name: points[:, k : k + 1] for k, name in enumerate(prior.names)}
        active = {name: {**held, **_own(values, f"{name}:")} for name, held in (effects or {}).items()}
        found = _errors(runs, values, active)
        return np.concatenate([found[name].reshape(len(points), -1) / ERROR_SCALES[name] for name in shapes], axis=1)

    def tell(step: int, errors: Floats) -> None:
        sizes = (
            f"{name} {ERROR_SCALES[name] * float(np.nanmean(np.abs(part))):.3g}"
            for name, part in _split(errors, shapes).items()
        )
        progress(f"calibration step {step}: mean error of {RUN_HOURS:g} h runs: {', '.join(sizes)}")

    residuals, jacobian = by_differences(batch, prior, high)
    counted = np.concatenate([np.isfinite(values).ravel() for values in measured.values()]).astype(np.float64)
    weights = counted * (_SAMPLE / CORRELATION_TIME)
    begin = np.array([{**prior.values, **(start or {})}[name] for name in prior.names])
    try:
        found = solve(residuals, jacobian, prior, low, high, weights=weights, robust=ROBUST, start=begin, progress=tell)
    except DivergenceError:
        raise DivergenceError(
            "the simulator runs out of all bounds on this log before anything is fitted: look whether vents, pipes, "
            "lamps, dosing and weather stand there in the units of the registry"
        ) from None
    # What the data are worth is only known at the end, when the errors are those of the fitted model. Runs that overlap
    # meet the same disturbances, which count once.
    overlap = max(1.0, RUN_HOURS / EVERY_HOURS)
    scale = np.concatenate(
        [np.tile(observed_scale(part), (part.size, 1)) for part in _split(found.residuals, shapes).values()]
    )
    spread, independent = scale.T
    uncertainty = covariance(
        found.residuals / spread,
        found.jacobian / spread[:, None],
        prior,
        weights=counted * independent / overlap,
        robust=ROBUST,
    )
    return Gaussian(prior.names, found.posterior.mean, uncertainty)


def _own(values: Mapping[str, Floats], prefix: str) -> dict[str, Floats]:
    return {name.removeprefix(prefix): value for name, value in values.items() if name.startswith(prefix)}


def observed_scale(errors: Floats) -> tuple[float, float]:
    """Return the robust spread of errors over time (k, runs), and how many independent ones there are in each.

    Args:
        errors: in `ERROR_SCALES`, NaN where nothing was measured.
    """
    known = errors[np.isfinite(errors)]
    spread = max(1.4826 * float(np.median(np.abs(known))), _LEAST_SCALE)
    clipped = np.clip(np.nan_to_num(errors), -3.0 * spread, 3.0 * spread)
    total = float(np.sum(clipped**2)) + 1e-12
    time = 1.0
    for lag in range(1, len(clipped)):
        correlation = float(np.sum(clipped[lag:] * clipped[:-lag])) / total * len(clipped) / (len(clipped) - lag)
        if correlation < 0.05:
            break
        time += 2.0 * correlation * (1.0 - lag / len(clipped))
    return spread, 1.0 / time


@dataclass(frozen=True)
class _Runs:
    """Free runs of one record."""

    record: Record
    starts: Integers
    """Rows, (s,)."""
    steps: int
    kept: Integers
    """Steps of a run whose errors are kept, (k,)."""
    quantities: tuple[str, ...]
    """What is compared."""

    def measured(self, name: str) -> Floats:
        """Return what was measured where errors are kept, (k, s)."""
        return np.asarray(self.record.measured[name][self.starts + 1 + self.kept[:, None]])


def has_runs(record: Record, rows: Mask | None) -> bool:
    """Tell whether a complete run lies within the rows, so that parameters can be fitted to them."""
    return _runs_of(record, rows) is not None


def _runs_of(record: Record, rows: Mask | None) -> _Runs | None:
    """Return the runs of a record, and the part of it that they need, or None where none is complete."""
    steps = max(1, round(RUN_HOURS * 3600.0 / record.step))
    allowed = np.ones(len(record), dtype=bool) if rows is None else rows
    starts = starts_within(record, allowed, steps, max(1, round(EVERY_HOURS * 3600.0 / record.step)))
    if len(starts) == 0:
        return None
    # The floor's temperature follows the air for days before the first run.
    first = max(0, int(starts[0]) - round(5 * 86_400.0 / record.step))
    part = record.slice(first, int(starts[-1]) + steps + 1)
    every = max(1, round(_SAMPLE / record.step))
    # Without the dose, CO2 would teach a greenhouse that is too tight.
    told = [name for name in PREDICTED if name != "air_co2" or "co2_dosing" not in record.missing]
    runs = _Runs(part, starts - first, steps, np.arange(every - 1, steps, every), ())
    return replace(runs, quantities=tuple(name for name in told if np.isfinite(runs.measured(name)).any()))


def _errors(runs: Sequence[_Runs], parameters: Mapping[str, Floats], effects: ActiveEffects) -> dict[str, Floats]:
    """Return predicted minus measured by quantity, (m, k, all runs), of parameters that are (m, 1)."""
    collected: dict[str, list[Floats]] = {}
    for one in runs:
        states = records.observe(one.record, parameters, effects)
        shown = records.free_run(one.record, states, one.starts, one.steps, parameters, effects)
        for name in one.quantities:
            collected.setdefault(name, []).append(np.moveaxis(shown[name][one.kept], 0, 1) - one.measured(name))
    return {name: np.concatenate(parts, axis=2) for name, parts in collected.items()}


def _split(errors: Floats, shapes: Mapping[str, tuple[int, ...]]) -> dict[str, Floats]:
    """Return errors (n,) by quantity, (k, all runs) each."""
    edges = np.cumsum([int(np.prod(shape)) for shape in shapes.values()])[:-1]
    parts = np.split(errors, edges)
    return {name: part.reshape(shape) for (name, shape), part in zip(shapes.items(), parts, strict=True)}
