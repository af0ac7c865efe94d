"""The actuation stage fitted to a log: the climate computer's rules, read off what it did.

Each actuator's rule by itself, by least squares on what the sensors showed and what the actuator did: the computer's
input is the measured climate, so this is a regression without feedback bias.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.optimize import least_squares

from igrow.core import gaps
from igrow.core.arrays import Floats, Mask
from igrow.core.errors import IgrowError
from igrow.core.quantities import QUANTITIES, SETPOINTS
from igrow.core.separating_tests.definition import SOURCE
from igrow.core.simulator import actuation
from igrow.core.simulator.actuation import ANSWERS, RULES, VENTS, rules_of
from igrow.core.simulator.hybrid import climate
from igrow.core.simulator.hybrid import record as records
from igrow.core.simulator.hybrid.record import Record
from igrow.core.site import Site
from igrow.core.telemetry import Telemetry, to_grid

_RULES_OF = {
    "rail_pipe_temperature": ("rail", 5.0),
    "grow_pipe_temperature": ("grow", 5.0),
    "vent_lee": (VENTS["vent_lee"], 5.0),
    "vent_wind": (VENTS["vent_wind"], 5.0),
    "energy_screen": ("energy_screen", 20.0),
    "blackout_screen": ("blackout_screen", 20.0),
    "co2_dosing": ("co2", 0.002),
}
"""Actuator -> prefix of its rules, and the size of an error that counts as one."""
OPENING = 0.2
"""Largest opening for humidity from which a fit begins where the log has a humidity setpoint."""
LEAST_OPENING = 0.01
"""A smaller one is none: such vents do not answer to that setpoint."""
CLOSER, LEAST_GAIN = 0.9, 5.0
"""An actuator follows a setpoint that not every computer takes where that leaves at most this share of the misfit, and
takes away at least so many squared errors of its size: an actuator that hardly moved tells nothing."""


def setpoint_columns(telemetry: Telemetry, record: Record, site: Site) -> tuple[dict[str, Floats], tuple[str, ...]]:
    """Return the setpoints on the record's grid, (n,) each, and the names of those that had to be inferred.

    A log without setpoints: the heating and CO2 setpoints are taken as the median of what was measured at the same
    hour over the two weeks around (what the computer held), lamps and irrigation as what they did. A setpoint that not
    every computer takes is among them where the site names it and the log has it.
    """
    grid = to_grid(telemetry, int(record.step))
    inferred = []
    columns: dict[str, Floats] = {}
    # A gap in the log says nothing of what its rows hold.
    logged = np.isfinite(record.measured["air_temperature"])
    for name in SETPOINTS:
        optional = QUANTITIES[name].optional
        if optional and name not in site.setpoints:
            continue
        values = grid.columns.get(name, np.full(len(record), np.nan))
        if np.isfinite(values[logged]).sum() > 0.5 * logged.sum():
            columns[name] = gaps.held(values)
            continue
        if optional:
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


def by_its_own_rules(telemetry: Telemetry, record: Record) -> Mask:
    """Return the rows in which the PLC followed its rules, since no separating test moved the plant, (n,)."""
    marked = to_grid(telemetry, int(record.step)).columns.get(SOURCE)
    return np.ones(len(record), dtype=bool) if marked is None else ~(marked > 0.0)


def unanswered(site: Site, rules: Mapping[str, float]) -> tuple[str, ...]:
    """Return a sentence on each setpoint that a site names and that nothing in its log answers to; plans leave it."""
    answered = actuation.setpoints_of(rules)
    lost = [name for name in SETPOINTS if QUANTITIES[name].optional and name in site.setpoints and name not in answered]
    return tuple(f"in this log nothing answers to {name}: plans leave it to the recipe" for name in lost)


def fit_actuation(
    parts: Sequence[tuple[Record, Mapping[str, Floats], Mask | None]], parameters: Mapping[str, float]
) -> dict[str, float]:
    """Return the rules of the actuation stage by name.

    Args:
        parts: records, their setpoints by name, (n,), and the rows that may be used (None: all).
        parameters: of the climate stage (for the light on the crop).

    Raises:
        IgrowError: no row shows both what the computer saw and what it did.
    """
    samples = [_samples(record, setpoints, rows, parameters) for record, setpoints, rows in parts]
    # A setpoint that only some of the records have tells nothing of all their rows.
    common = set.intersection(*(set(sample) for sample in samples))
    samples = [{name: sample[name] for name in sample if name in common} for sample in samples]
    table = {name: np.concatenate([sample[name] for sample in samples]) for name in samples[0]}
    if len(table["par"]) == 0:
        raise IgrowError("no row of the log has the climate and all actuators at once: nothing tells the PLC's rules")
    rules = actuation.default_rules()
    known = {name for record, _, _ in parts for name in actuation.OUTPUTS if name not in record.missing}
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
    record: Record, setpoints: Mapping[str, Floats], rows: Mask | None, parameters: Mapping[str, float]
) -> dict[str, Floats]:
    """Return what the computer saw and did, every quarter of an hour."""
    states = records.observe(record, parameters, {})
    drivers = climate.derive(np, states, record.inputs, parameters, record.lamp_efficacy)
    # What no sensor shows has a usual value in the states; what one shows must be there.
    shown = {name: values if np.isfinite(values).any() else drivers[name] for name, values in record.measured.items()}
    good = record.usable & np.all([np.isfinite(values) for values in shown.values()], axis=0)
    if rows is not None:
        good &= rows
    every = max(1, round(900.0 / record.step))
    chosen = np.flatnonzero(good)[::every]
    table: dict[str, Floats] = {name: record.inputs[name][chosen] for name in actuation.OUTPUTS}
    for name in ("outdoor_temperature", "global_radiation", "wind_speed"):
        table[name] = record.inputs[name][chosen]
    table |= {name: np.broadcast_to(values, (len(record),))[chosen] for name, values in shown.items()}
    table["par"] = np.broadcast_to(drivers["par"], (len(record),))[chosen]
    return table | {f"setpoint:{name}": values[chosen] for name, values in setpoints.items()}


def _fit_rule(
    actuator: str, prefix: str, size: float, table: Mapping[str, Floats], rules: Mapping[str, float]
) -> dict[str, float]:
    """Return the rules of an actuator that follows those setpoints of the log that bring it closer."""
    found, misfit = _fit_following(actuator, prefix, size, table, rules)
    for setpoint in ("ventilation_setpoint", "minimum_pipe_setpoint", "energy_screen_setpoint"):
        following = {rule: 1.0 for rule in ANSWERS[setpoint] if rule.startswith(f"{prefix}_")}
        if following and f"setpoint:{setpoint}" in table:
            closer, left = _fit_following(actuator, prefix, size, table, {**rules, **following})
            if left < min(CLOSER * misfit, misfit - LEAST_GAIN):
                found, misfit = closer | following, left
    return found


def _fit_following(
    actuator: str, prefix: str, size: float, table: Mapping[str, Floats], rules: Mapping[str, float]
) -> tuple[dict[str, float], float]:
    """Return the rules of an actuator and the misfit that they leave; which setpoints it follows `rules` says."""
    setpoints = {name: table[f"setpoint:{name}"] for name in SETPOINTS if f"setpoint:{name}" in table}
    held: dict[str, float] = {}
    rules = dict(rules)
    settled = {"co2_capacity", "irrigation_rate", *(rule for own in ANSWERS.values() for rule in own)}
    if "humidity_setpoint" not in setpoints:
        settled |= {*rules_of("humidity_setpoint")}
    elif actuator in VENTS:
        held[f"{prefix}_humidity"] = 0.0
        rules[f"{prefix}_humidity_opening"] = OPENING
        settled = settled - {f"{prefix}_humidity_opening"} | set(held)
    rules |= held
    names = [name for name in RULES if name.startswith(f"{prefix}_") and name not in settled]
    low = np.array([RULES[name].low for name in names])
    high = np.array([RULES[name].high for name in names])
    start = np.clip(np.array([rules[name] for name in names]), low, high)
    width = np.maximum(np.abs(start), 0.05 * (high - low))
    measured = table[actuator]

    def predict(point: Floats) -> Floats:
        trial = rules | dict(zip(names, point.tolist(), strict=True))
        return np.asarray(actuation.targets(np, setpoints, table, table, table, trial)[actuator])

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
    found = held | dict(zip(names, np.clip(best.x, low, high).tolist(), strict=True))
    opening = f"{prefix}_humidity_opening"
    if 0.0 < found.get(opening, 0.0) < LEAST_OPENING:
        found[opening] = 0.0
    return found, float(best.cost)


def _usual_course(measured: Floats, step: float) -> Floats:
    """Return the median over the two weeks around at the same time of the day, smoothed over an hour, (n,).

    What was never measured was never held: nothing is asked of it.
    """
    if not np.isfinite(measured).any():
        return np.zeros(len(measured))
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
    return np.asarray(courses.ravel()[: len(measured)])
