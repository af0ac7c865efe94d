"""What a cause is worth: heat, CO2 and light that it takes in a week, and their price.

The greenhouse is held at the climate that the log shows. What its heating must then supply is what the balance of heat
lacks without the pipes, and the same goes for CO2 while it is dosed; a cause takes the difference between the corrected
model with and without it, a parameter that has changed that between its value now and at the calibration. Light that is
lost is priced as the electricity that the lamps would need for as much.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from igrow.core.arrays import Array, Floats
from igrow.core.economics import co2_cost, electricity_price
from igrow.core.simulator.hybrid import climate
from igrow.core.simulator.hybrid.balances import affected_drivers, balances
from igrow.core.simulator.hybrid.record import Record, observe
from igrow.trainer.diagnosis.answer.result import DISCREPANCY, Diagnosis, Finding
from igrow.trainer.diagnosis.design.freerun import Stage
from igrow.trainer.diagnosis.knowledge import CROP, activate
from igrow.trainer.diagnosis.validation.correction import without
from igrow.trainer.diagnosis.visible_parameters import VISIBLE, members

_WEEK = 604_800.0
_PAID: Mapping[str, str] = {"heating_valve_leak": "heat", "co2_valve_leak": "co2"}
"""Effects that bring something in which is paid for, whether it is wanted or not."""
OF_THE_CROP = frozenset(name for name in VISIBLE if CROP.issuperset(members(name)))
"""Parameters whose change costs growth, which no balance counts: less CO2 taken up saves nothing."""
_PAR_PER_GLOBAL = 2.1
"""Photons of PAR in outdoor radiation, umol J-1."""


@dataclass(frozen=True)
class Worth:
    """What a cause takes from a greenhouse in a week, per m2; negative: it saves as much."""

    heat: float
    """MJ m-2."""
    co2: float
    """kg m-2."""
    lamp_light: float
    """kWh m-2 of the lamps for the light that is lost."""
    money: float
    """EUR m-2."""
    spread: tuple[float, float] | None
    """By which all of it may be multiplied: the 90 % interval of the cause's size; None: not known."""


def worth(result: Diagnosis, finding: Finding) -> Worth | None:
    """Return what a finding is worth, by the site's prices; None where nothing of it can be counted."""
    if result.evidence is None or "corrected" not in result.evidence.stages:
        return None
    record, stage, site = result.evidence.log.record, result.evidence.stages["corrected"], result.model.site
    is_effect = finding.kind in ("process", "sensor")
    if finding.effect in OF_THE_CROP or (is_effect and finding.effect not in {one.effect for one in stage.terms}):
        return None
    reduced = without(stage, finding)
    since = np.ones(len(record), dtype=bool) if finding.onset is None else record.time >= finding.onset.time
    counted = since & record.usable
    if not counted.any():
        return None
    full, less = _needed(record, stage), _needed(record, reduced)
    taken = {name: full[name] - less[name] for name in full}
    if site.greenhouse.heating_capacity == 0.0:
        # What is never heated is colder or warmer, and nobody pays for it.
        taken["heat"] = np.zeros(len(record))
    paid = _PAID.get(finding.effect)
    if paid is not None:
        taken[paid] = _brought_in(record, stage, finding.effect, paid)
    share = _WEEK / float(counted.sum())
    sums = {name: share * float(np.sum(values[counted])) for name, values in taken.items()}
    lamps = site.greenhouse.lamps
    # A greenhouse without lamps pays for no light; their efficacy is 0 there.
    electricity = np.zeros(len(record)) if lamps is None else taken["light"] / lamps.efficacy / 3.6e6
    if not (sums["heat"] or sums["co2"] or electricity.any()):
        return None
    price = electricity_price(site.prices, record.time, site.time_zone)
    money = (
        site.prices.heat * 1e-6 * sums["heat"]
        # Of the first tier; what is saved counts as much.
        + float(np.sign(sums["co2"]) * co2_cost(site.prices, 0.0, abs(sums["co2"])))
        + share * float(np.sum((electricity * price)[counted]))
    )
    return Worth(1e-6 * sums["heat"], sums["co2"], share * float(np.sum(electricity[counted])), money, _spread(finding))


def _needed(record: Record, stage: Stage) -> dict[str, Floats]:
    """Return what holds the logged climate, (n,): heat, W m-2, and CO2, kg m-2 s-1; and the sun's light that lacks.

    The light, umol m-2 s-1, is what the crop has less than none lost: negative.
    """
    effects, parameters = activate(record, stage.terms), stage.posterior.values
    state = observe(record, parameters, effects)
    drivers = climate.derive(np, state, record.inputs, parameters, record.lamp_efficacy)
    added: dict[str, Array] = climate.contributions(np, drivers, state, effects, record.step)
    for channel, flux in stage.added.items():
        added[channel] = added.get(channel, 0.0) + flux
    none = np.zeros(len(record))
    unheated = dict(drivers) | {"rail_pipe_excess": none, "grow_pipe_excess": none, "co2_dosing": none}
    net = balances(np, state, unheated, parameters, added).of
    heat = np.maximum(-_course(net["air_temperature"][0], record), 0.0)
    dosed = np.asarray(record.inputs["co2_dosing"]) > 0.0
    short = np.maximum(-_course(net["co2_concentration"][0], record), 0.0) / parameters["dosing_share"]
    co2 = np.where(dosed, short, 0.0)
    light = -_course(affected_drivers(np, drivers, added)["radiation_inside"], record) * _PAR_PER_GLOBAL
    return {"heat": heat, "co2": co2, "light": light}


def _brought_in(record: Record, stage: Stage, effect: str, channel: str) -> Floats:
    """Return what a leaking valve lets in, (n,)."""
    effects, parameters = activate(record, stage.terms), stage.posterior.values
    state = observe(record, parameters, effects)
    drivers = climate.derive(np, state, record.inputs, parameters, record.lamp_efficacy)
    added = climate.contributions(np, drivers, state, {effect: effects[effect]}, record.step)
    return _course(added[channel], record)


def _course(values: Array, record: Record) -> Floats:
    return np.broadcast_to(np.asarray(values, dtype=np.float64), (len(record),))


def _spread(finding: Finding) -> tuple[float, float] | None:
    """Return the interval of the first parameter, relative to its value: all fluxes are linear in it."""
    first = next(iter(finding.parameters.values()), None)
    if first is None or first.value == 0.0 or finding.effect == DISCREPANCY:
        return None
    ends = sorted((first.low / first.value, first.high / first.value))
    return (max(ends[0], 0.0), ends[1])
