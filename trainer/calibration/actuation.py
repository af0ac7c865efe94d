"""The actuation stage fitted to a log: the climate computer's rules, read off what it did.

First each actuator's rule by itself, by least squares on what the sensors showed and what the actuator did: the
computer's input is the measured climate, so this is a regression without feedback bias. Then all rules together
in closed loop, where what counts is seen: the climate they keep, and the energy and CO2 they use in a day.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from igrow.core import gaps
from igrow.core.quantities import SETPOINTS
from igrow.core.simulator import actuation
from igrow.core.simulator.actuation import RULES
from igrow.core.simulator.closed_loop import closed_run, pipe_heat
from igrow.core.simulator.hybrid import climate
from igrow.core.simulator.hybrid import record as records
from igrow.core.simulator.hybrid.disturbance import DisturbanceModel
from igrow.core.simulator.hybrid.record import Record
from igrow.core.telemetry import Telemetry, to_grid
from igrow.trainer.calibration.evaluation import run_fluxes, starts_within
from igrow.trainer.calibration.fit import coarser_rows
from igrow.trainer.calibration.least_squares import Problem, Scale, minimise

Floats = NDArray[np.float64]

_RULES_OF = {
    "rail_pipe_temperature": ("rail", 5.0),
    "grow_pipe_temperature": ("grow", 5.0),
    "vent_lee": ("lee", 5.0),
    "vent_wind": ("windward", 5.0),
    "energy_screen": ("energy_screen", 20.0),
    "blackout_screen": ("blackout_screen", 20.0),
    "co2_dosing": ("co2", 0.002),
}
"""Actuator -> prefix of its rules, and the size of an error that counts as one."""


def setpoint_columns(telemetry: Telemetry, record: Record) -> tuple[dict[str, Floats], tuple[str, ...]]:
    """Return the setpoints on the record's grid, (n,) each, and the names of those that had to be inferred.

    A log without setpoints: the heating and CO2 setpoints are taken as the median of what was measured at the same
    hour over the two weeks around (what the computer held), lamps and irrigation as what they did.
    """
    grid = to_grid(telemetry, int(record.step))
    inferred = []
    columns: dict[str, Floats] = {}
    for name in SETPOINTS:
        values = grid.columns.get(name, np.full(len(record), np.nan))
        if np.isfinite(values).mean() > 0.5:
            columns[name] = gaps.held(values)
            continue
        inferred.append(name)
        if name == "lamp_on":
            power = record.inputs["lamp_power"]
            columns[name] = power / max(float(power.max()), 1e-9)
        elif name == "irrigation_on":
            columns[name] = np.zeros(len(record))
        else:
            measured = record.measured["air_temperature" if name == "heating_setpoint" else "air_co2"]
            columns[name] = _usual_course(measured, record.step)
    return columns, tuple(inferred)


def fit_actuation(
    parts: Sequence[tuple[Record, Mapping[str, Floats], NDArray[np.bool_] | None]], parameters: Mapping[str, float]
) -> dict[str, float]:
    """Return the rules of the actuation stage by name.

    Args:
        parts: records, their setpoints by name, (n,), and the rows that may be used (None: all).
        parameters: of the climate stage (for the light on the crop).
    """
    samples = [_samples(record, setpoints, rows, parameters) for record, setpoints, rows in parts]
    table = {name: np.concatenate([sample[name] for sample in samples]) for name in samples[0]}
    rules = actuation.default_rules()
    known = {name for record, _, _ in parts for name in actuation.OUTPUTS if name not in record.unknown}
    if "lamp_power" in known:
        burning = table["lamp_power"][table["setpoint:lamp_on"] > 0.9]
        rules["lamp_capacity"] = float(np.median(burning)) if len(burning) else 0.0
        rules["lamp_radiation"] = _lamp_limit(table, rules["lamp_capacity"])
    if "co2_dosing" in known:
        rules["co2_capacity"] = max(float(np.quantile(table["co2_dosing"], 0.999)), 1e-4)
    if "irrigation" in known:
        running = table["setpoint:irrigation_on"]
        rules["irrigation_rate"] = float(np.sum(table["irrigation"] * running) / max(np.sum(running**2), 1e-9))
        rules["irrigation_rate"] = min(rules["irrigation_rate"], RULES["irrigation_rate"].high)
    for actuator, (prefix, size) in _RULES_OF.items():
        if actuator in known:
            rules |= _fit_rule(actuator, prefix, size, table, rules)
        elif actuator.endswith("screen"):
            rules |= {f"{prefix}_{part}": 0.0 for part in ("unlit", "lit", "open")}
    return rules


def _lamp_limit(table: Mapping[str, Floats], capacity: float) -> float:
    """Return the radiation in W m-2 above which lamps that were asked for stayed dark; the highest, if none did."""
    asked = table["setpoint:lamp_on"] > 0.5
    radiation, burning = table["global_radiation"][asked], table["lamp_power"][asked] > 0.5 * capacity
    order = np.argsort(radiation)
    radiation, burning = radiation[order], burning[order]
    # Below the limit lamps that are dark count as wrong, above it lamps that burn.
    wrong = np.concatenate([[0], np.cumsum(~burning)]) + burning.sum() - np.concatenate([[0], np.cumsum(burning)])
    best = len(wrong) - 1 - int(np.argmin(wrong[::-1]))
    rule = RULES["lamp_radiation"]
    return rule.high if best == len(radiation) else float(np.clip(radiation[best], rule.low, rule.high))


def _samples(
    record: Record, setpoints: Mapping[str, Floats], rows: NDArray[np.bool_] | None, parameters: Mapping[str, float]
) -> dict[str, Floats]:
    """Return what the computer saw and did, every quarter of an hour."""
    states = records.observe(record, parameters, {})
    drivers = climate.derive(np, states, record.inputs, parameters, record.lamp_efficacy)
    good = record.usable & np.all([np.isfinite(values) for values in record.measured.values()], axis=0)
    if rows is not None:
        good &= rows
    every = max(1, round(900.0 / record.step))
    chosen = np.flatnonzero(good)[::every]
    table: dict[str, Floats] = {name: record.inputs[name][chosen] for name in actuation.OUTPUTS}
    for name in ("outdoor_temperature", "global_radiation", "wind_speed"):
        table[name] = record.inputs[name][chosen]
    for name in ("air_temperature", "air_humidity", "air_co2"):
        table[name] = record.measured[name][chosen]
    table["par"] = np.broadcast_to(drivers["par"], (len(record),))[chosen]
    return table | {f"setpoint:{name}": values[chosen] for name, values in setpoints.items()}


def _fit_rule(
    actuator: str, prefix: str, size: float, table: Mapping[str, Floats], rules: Mapping[str, float]
) -> dict[str, float]:
    names = [
        name for name in RULES if name.startswith(f"{prefix}_") and name not in {"co2_capacity", "irrigation_rate"}
    ]
    low = np.array([RULES[name].low for name in names])
    high = np.array([RULES[name].high for name in names])
    start = np.clip(np.array([rules[name] for name in names]), low, high)
    width = np.maximum(np.abs(start), 0.05 * (high - low))
    setpoints = {name: table[f"setpoint:{name}"] for name in SETPOINTS}
    measured = table[actuator]

    def predict(point: Floats) -> Floats:
        trial = dict(rules) | dict(zip(names, point.tolist(), strict=True))
        result: Floats = actuation.targets(np, setpoints, table, table, table, trial)[actuator]
        return result

    def residual(point: Floats) -> Floats:
        # A faint pull to the usual settings decides what the log leaves open.
        return np.concatenate([(predict(point) - measured) / size, 0.3 * (point - start) / width])

    best = min(
        (
            least_squares(
                residual,
                np.clip(start + shift * width, low, high),
                bounds=(low - 1e-9, high + 1e-9),
                x_scale=width,
                diff_step=1e-3,
                loss="soft_l1",
                max_nfev=60,
            )
            for shift in (0.0, 0.5)
        ),
        key=lambda solution: float(solution.cost),
    )
    return dict(zip(names, np.clip(best.x, low, high).tolist(), strict=True))


def _usual_course(measured: Floats, step: float) -> Floats:
    """Return the median over the two weeks around at the same time of the day, smoothed over an hour, (n,)."""
    day = round(86_400.0 / step)
    count = -(-len(measured) // day)
    padding = np.full(count * day - len(measured), np.nan)
    table = np.concatenate([measured, padding]).reshape(count, day)
    width = max(1, round(3600.0 / step))
    courses = np.empty_like(table)
    for position in range(count):
        window = table[max(0, position - 7) : position + 8]
        course = np.nanmedian(np.where(np.isfinite(window).any(axis=0), window, np.nanmedian(measured)), axis=0)
        padded = np.concatenate([course[-width:], course, course[:width]])
        courses[position] = np.convolve(padded, np.ones(width) / width, "same")[width:-width]
    usual: Floats = courses.ravel()[: len(measured)]
    return usual


_CLOSED_SCALES = {
    "air_temperature": Scale(0.5, 1 / 12),
    "air_humidity": Scale(4.0, 1 / 12),
    "air_co2": Scale(40.0, 1 / 12),
    "heat": Scale(8.0, 1 / 12),
    "vent_lee": Scale(8.0, 1 / 12),
    "vent_wind": Scale(8.0, 1 / 24),
    "energy_screen": Scale(30.0, 1 / 24),
    "blackout_screen": Scale(30.0, 1 / 24),
    "co2_dosing": Scale(0.0015, 1 / 12),
    "ventilation": Scale(0.0005, 1 / 24),
    "daily:heat": Scale(3.0, 0.5),
    "daily:ventilation": Scale(1.5e-4, 0.5),
    "daily:co2_dosing": Scale(2e-4, 0.5),
}
"""How errors of a closed run count: half-hour means, and means over the whole run."""
_STEP = 900.0
"""Seconds; closed runs for fitting take this step, which is several times as fast as 5 minutes."""
_HELD = ("lamp_capacity", "lamp_radiation", "co2_capacity", "irrigation_rate")


def refine_actuation(
    record: Record,
    setpoints: Mapping[str, Floats],
    rows: NDArray[np.bool_] | None,
    parameters: Mapping[str, float],
    rules: Mapping[str, float],
    *,
    remainder: Mapping[str, Floats] | None = None,
    disturbance: DisturbanceModel | None = None,
    iterations: int = 8,
    every_hours: float = 24.0,
) -> dict[str, float]:
    """Return the rules refitted together in closed loop over runs of a day.

    Args:
        record: the log.
        setpoints: by name, (n,).
        rows: that may be used (None: all).
        parameters: of the climate stage.
        rules: from `fit_actuation`, where the search starts and what it is held to.
        remainder: known further fluxes by channel, (n,).
        disturbance: how missing fluxes go on.
        iterations: at most.
        every_hours: between the runs' starts.
    """
    factor = max(1, int(_STEP // record.step))
    whole_rows = len(record) // factor * factor
    setpoints = {name: values[:whole_rows].reshape(-1, factor).mean(axis=1) for name, values in setpoints.items()}
    remainder = {
        channel: flux[:whole_rows].reshape(-1, factor).mean(axis=1) for channel, flux in (remainder or {}).items()
    }
    allowed = np.ones(whole_rows // factor, dtype=bool) if rows is None else coarser_rows(rows, factor)
    record = record.coarser(factor)
    steps = round(86_400.0 / record.step)
    starts = starts_within(record, allowed, steps, round(every_hours * 3600.0 / record.step))
    if len(starts) == 0:
        return dict(rules)
    states = records.observe(record, parameters, {})
    fluxes = run_fluxes(record, parameters, {}, starts, steps, remainder, disturbance)
    names = [name for name in RULES if name not in _HELD]
    drivers = climate.derive(np, states, record.inputs, parameters, record.lamp_efficacy)
    targets: dict[str, Floats] = dict(record.measured)
    targets |= {name: record.inputs[name] for name in actuation.OUTPUTS if name not in record.unknown}
    targets |= {"heat": pipe_heat(drivers, parameters), "ventilation": drivers["ventilation"]}
    if "co2_dosing" in record.unknown:
        targets.pop("air_co2")
    width = max(1, round(1800.0 / record.step))
    whole = steps // width * width
    following = starts + 1 + np.arange(whole)[:, None]

    def half_hours(values: Floats) -> Floats:
        mean: Floats = values[:whole].reshape(whole // width, width, *values.shape[1:]).mean(axis=1)
        return mean

    wanted = {name: half_hours(values[following]) for name, values in targets.items() if name in _CLOSED_SCALES}

    def residuals(points: Floats) -> dict[str, Floats]:
        trial = dict(rules) | {name: points[:, k : k + 1] for k, name in enumerate(names)}
        out = closed_run(record, states, setpoints, starts, steps, parameters, {}, trial, fluxes)
        errors: dict[str, Floats] = {}
        for name, target in wanted.items():
            predicted = half_hours(np.broadcast_to(out[name], (steps, len(points), len(starts))))
            errors[name] = np.moveaxis(predicted, 1, 0) - target
            if f"daily:{name}" in _CLOSED_SCALES:
                errors[f"daily:{name}"] = np.nanmean(errors[name], axis=1)
        return errors

    start = np.array([rules[name] for name in names])
    low = np.array([RULES[name].low for name in names])
    high = np.array([RULES[name].high for name in names])
    usual = np.array([RULES[name].value for name in names])
    deviation = np.maximum(0.5 * np.abs(usual), 0.04 * (high - low))
    problem = Problem(residuals, _CLOSED_SCALES, start, np.diag(deviation**2), low, high)
    point, _ = minimise(problem, start, iterations, lambda _number, _errors: None)
    return dict(rules) | dict(zip(names, point.tolist(), strict=True))
