"""Four predictors of a compartment's harvest, each fitted to other compartments.

The data are few: six tomato crops of one season side by side, four cucumber crops of another. So the first predictor
is the one that any model has to beat: the mean harvest of the other compartments, which knows nothing of the crop.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np

from igrow.core.arrays import Floats
from igrow.core.greenhouse.canopy import photosynthesis
from igrow.core.greenhouse.parameters import GreenhouseParameters
from igrow.core.greenhouse.tomato import (
    CARBOHYDRATE_PER_MOL,
    assimilation_share,
    deleaf,
    grow,
    leaf_area_index,
    rates,
    young_crop,
)
from igrow.trainer.research.paper.compartments import Compartment
from igrow.trainer.training.stage import StageData, StageLayout, TrainingPlan, run_stage, train_stage, untrained

Predictor = Callable[[Sequence[Compartment], Compartment], Floats]

DELAYS = range(0, 36, 5)
"""Days from light to harvest that are tried."""
WAITS = range(300, 1501, 50)
"""Thermal times to the first harvest that are tried, degC d."""
ASSUMED_CO2 = 700.0
"""ppm in the mechanistic crop: no compartment of 2019 but one has published its CO2."""
CANOPY_LIGHT = 0.75
"""Share of the light above a grown canopy that it absorbs, per 1 - exp(-0.7 LAI)."""


def mean_of_others(others: Sequence[Compartment], crop: Compartment) -> Floats:
    """Return the mean cumulative harvest of the other compartments, (days,)."""
    rows = np.arange(crop.day.size)
    return np.asarray(np.mean([np.interp(rows, np.arange(o.day.size), o.cumulative()) for o in others], axis=0))


def _light_since(crop: Compartment, wait: float, delay: int) -> Floats:
    """Return the light since `wait` degC d after planting, as it was `delay` days ago, mol m-2, (days,)."""
    light = np.cumsum(crop.drivers["light_sum"])
    start = light[min(int(np.searchsorted(np.cumsum(crop.drivers["temperature"]), wait)), light.size - 1)]
    lagged = np.concatenate([np.zeros(delay), light[: light.size - delay]])
    return np.asarray(np.maximum(lagged - start, 0.0))


def light_use(others: Sequence[Compartment], crop: Compartment) -> Floats:
    """Return a harvest proportional to light: a constant kg per mol of the light that came after the first fruits set.

    Three numbers are fitted on the others by least squares: the efficiency, the thermal time to the first harvest and
    the delay from light to harvest.
    """
    best: tuple[float, float, float, int] | None = None
    for wait in WAITS:
        for delay in DELAYS:
            light = np.concatenate([_light_since(other, wait, delay)[other.harvest_day] for other in others])
            harvested = np.concatenate([other.harvested for other in others])
            if not light.any():
                continue
            efficiency = float(light @ harvested / (light @ light))
            error = float(((efficiency * light - harvested) ** 2).sum())
            if best is None or error < best[0]:
                best = (error, efficiency, wait, delay)
    assert best is not None
    return best[1] * _light_since(crop, best[2], best[3])


DRIVERS = ("light_sum", "temperature", "crop_age")
"""Not the stem density: with five crops to learn from, the sixth's lies outside what was seen."""


def _stage_drivers(crop: Compartment) -> Floats:
    age = np.arange(crop.day.size, dtype=np.float64)
    columns = {**crop.drivers, "crop_age": age}
    return np.stack([columns[name] for name in DRIVERS], axis=-1)


def learned(others: Sequence[Compartment], crop: Compartment) -> Floats:
    """Return the free run of a small daily harvest network (8 units) trained on the other compartments."""
    days = min(other.day.size for other in (*others, crop))
    drivers = np.stack([_stage_drivers(other)[:days] for other in others])
    states = np.stack([other.cumulative()[:days, None] for other in others])
    data = StageData(drivers, states, np.zeros(days), np.ones(states.shape[:2], dtype=bool))
    shape = StageLayout("harvest", ("fruit_fresh_weight",), DRIVERS, (10.0, 40.0), (8,), step=24.0)
    plan = TrainingPlan(updates=((10, 300), (40, 300)), batch=64, learning_rate=1e-2, decay=0.1, start_share=0.2)
    stage = train_stage(untrained(shape, data, 0), data, plan)
    run = run_stage(stage, _stage_drivers(crop)[None], np.zeros(crop.day.size), np.zeros((1, 1)))
    return np.asarray(run[0, :, 0])


@lru_cache(maxsize=64)
def _crop_run(light_sum: tuple[float, ...], temperature: tuple[float, ...]) -> tuple[float, ...]:
    parameters = GreenhouseParameters()
    shape = np.clip(np.sin((np.arange(24) - 4.0) / 16.0 * np.pi), 0.0, None)
    shape = shape / shape.sum() * 1e6 / 3600.0
    state = young_crop(parameters, 0.0)
    harvested = []
    for light_of_day, degrees in zip(light_sum, temperature, strict=True):
        for hour in range(24):
            area = leaf_area_index(parameters, state)
            light = CANOPY_LIGHT * (1.0 - np.exp(-0.7 * area)) * light_of_day * shape[hour]
            fixed = photosynthesis(np, parameters, light, ASSUMED_CO2, degrees, area)
            fixed = fixed * assimilation_share(np, state) * 3600.0 * CARBOHYDRATE_PER_MOL
            state = grow(np, parameters, state, rates(np, parameters, state, degrees), fixed, degrees, 3600.0)
        state = deleaf(np, parameters, state)
        harvested.append(float(state.harvested))
    return tuple(harvested)


def crop_run(crop: Compartment) -> Floats:
    """Return carbohydrate harvested by the mechanistic crop, cumulative kg m-2, (days,).

    The day's light comes as a half sine over 16 h, the temperature is the day's mean, leaves are picked daily.
    """
    return np.array(_crop_run(tuple(crop.drivers["light_sum"]), tuple(crop.drivers["temperature"])))


def mechanistic(others: Sequence[Compartment], crop: Compartment) -> Floats:
    """Return the mechanistic crop's harvest times one factor (fresh weight per carbohydrate) fitted on the others."""
    modelled = np.concatenate([crop_run(other)[other.harvest_day] for other in others])
    harvested = np.concatenate([other.harvested for other in others])
    factor = float(modelled @ harvested / max(modelled @ modelled, 1e-12))
    return factor * crop_run(crop)


PREDICTORS: dict[str, Predictor] = {
    "mean of the others": mean_of_others,
    "light use": light_use,
    "learned stage": learned,
    "mechanistic crop": mechanistic,
}
