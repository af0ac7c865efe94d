"""The tomato crop: carbohydrate buffer, leaves, stem, fruits in stages, respiration, harvest, deleafing.

After Vanthoor (2011), chapter 3 and electronic appendix section 9, with his sources: De Koning (1994),
Development and dry matter distribution in glasshouse tomato, PhD thesis, Wageningen; Heuvelink (1996), Tomato
growth and yield, PhD thesis, Wageningen; Leffelaar and Ferrari (1989) for the fixed boxcar train of fruit
stages. Pools are kg carbohydrate (CH2O) m-2, times s, temperatures degC.

Differences: fruits come truss by truss at De Koning's rate, so that a cherry tomato needs no other equations;
the fruit train has 20 stages, enough for a spread of 22 % of the ripening time; leaves are picked on a fixed day.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from igrow.core.arrays import Array
from igrow.core.greenhouse.parameters import GreenhouseParameters
from igrow.core.namespace import clip, ramp, sigmoid

CARBOHYDRATE_PER_MOL = 0.030026
"""kg CH2O in a mol of CO2 fixed."""
CO2_PER_CARBOHYDRATE = 0.04401 / CARBOHYDRATE_PER_MOL
"""kg CO2 for each kg CH2O."""
BUFFER_FULL = 0.020
"""Carbohydrate buffer at which assimilation stops, kg m-2 (Vanthoor: 20e3 mg)."""
BUFFER_LOW = 0.001
"""Buffer at which growth stops, kg m-2 (Vanthoor: 1e3 mg)."""
GROWTH_COST = {"fruit": 0.27, "leaf": 0.28, "stem": 0.30}
"""Carbohydrate respired for each growing into an organ, 1 (Heuvelink 1996)."""
MAINTENANCE = {"fruit": 1.16e-7, "leaf": 3.47e-7, "stem": 1.47e-7}
"""Maintenance respiration at 25 degC, s-1 (Heuvelink 1996)."""
Q10 = 2.0
"""Of maintenance respiration."""
ACTIVITY = 2.85e6
"""How maintenance rises with the relative growth rate, s (Heuvelink 1996)."""
STAGES = 20
"""Boxcars of the fruit train."""
_STAGE = (np.arange(STAGES) + 0.5) / STAGES
_GOMPERTZ = np.exp(-4.36 * (_STAGE - 0.452) - np.exp(-4.36 * (_STAGE - 0.452)))
SINK: NDArray[np.float64] = _GOMPERTZ / _GOMPERTZ.max()
"""Relative growth of a fruit by stage: the Gompertz curve of De Koning (1994) for 50 days to ripeness."""


class Crop(NamedTuple):
    """The state of the crop; floats or arrays (N,), fruits (STAGES,) or (STAGES, N)."""

    buffer: Array
    leaf: Array
    stem: Array
    fruit: NDArray[np.float64]
    """Carbohydrate in each stage, kg m-2."""
    fruits: NDArray[np.float64]
    """Number in each stage, m-2."""
    temperature_sum: Array
    """degC d since the first truss."""
    mean_temperature: Array
    """Of the last 24 h, degC (first-order filter)."""
    growth_rate: Array
    """Relative growth rate of the last day, s-1 (first-order filter)."""
    harvested: Array
    """Carbohydrate in harvested fruit, kg m-2, cumulative."""
    removed: Array
    """Carbohydrate in picked leaves, kg m-2, cumulative."""
    net_growth: Array
    """What was planted and, since, assimilation less respiration: kg carbohydrate m-2, cumulative."""


class Rates(NamedTuple):
    """What the crop does during a step, kg CH2O m-2 s-1."""

    fruit: Array
    leaf: Array
    stem: Array
    growth_respiration: Array
    fruit_maintenance: Array
    leaf_maintenance: Array
    stem_maintenance: Array
    first_truss: Array
    """New fruits m-2 s-1."""

    @property
    def respiration(self) -> Array:
        """All of it, kg CH2O m-2 s-1."""
        return self.growth_respiration + self.fruit_maintenance + self.leaf_maintenance + self.stem_maintenance


def young_crop(p: GreenhouseParameters, like: Array, leaf_area_index: Array = 0.4) -> Crop:
    """Return a transplanted crop; `like` gives the shape (a float, or an array (N,))."""
    zero = 0.0 * like
    leaf = zero + leaf_area_index / p.specific_leaf_area
    return Crop(
        buffer=zero + 0.004,
        leaf=leaf,
        stem=1.2 * leaf,
        fruit=np.zeros((STAGES, *np.shape(like))),
        fruits=np.zeros((STAGES, *np.shape(like))),
        temperature_sum=zero - 150.0,
        mean_temperature=zero + 20.0,
        growth_rate=zero + 5e-7,
        harvested=zero,
        removed=zero,
        net_growth=zero + 0.004 + 2.2 * leaf,
    )


def mature_crop(p: GreenhouseParameters, like: Array, leaf_area_index: Array = 2.8) -> Crop:
    """Return a crop in full production, with the fruit load of a steady state."""
    young = young_crop(p, like, leaf_area_index)
    shape = (STAGES, *([1] * np.ndim(like)))
    ones = np.ones((STAGES, *np.shape(like)))
    fruits = ones * (truss_rate(20.0) * 86_400.0 * 51.0 / STAGES) * p.stem_density * p.fruits_per_truss
    weight = np.cumsum(SINK) / np.sum(SINK) * 0.0011
    grown = young._replace(
        stem=12.0 * young.leaf,
        fruit=fruits * weight.reshape(shape),
        fruits=fruits,
        temperature_sum=young.temperature_sum + 150.0 + p.generative_sum,
    )
    return grown._replace(net_growth=stored_carbohydrate(grown))


def truss_rate(temperature: Array) -> Array:
    """Return trusses per stem and second: -0.018 + 0.0075 T a day, 0.13 at 20 degC (De Koning 1994)."""
    return (0.0075 * temperature - 0.018) / 86_400.0


def development_rate(temperature: Array) -> Array:
    """Return the share of ripening per second, -7.64e-9 + 1.16e-8 T (De Koning 1994): 51.6 days at 20 degC."""
    return 1.16e-8 * temperature - 7.64e-9


def leaf_area_index(p: GreenhouseParameters, crop: Crop) -> Array:
    """Return m2 of leaf per m2 of floor."""
    return p.specific_leaf_area * crop.leaf


def assimilation_share(xp: Any, crop: Crop) -> Array:
    """Return the fraction of the potential assimilation that a filling buffer allows, 1 to 0 (Vanthoor eq. 9.11)."""
    return sigmoid(xp, (BUFFER_FULL - crop.buffer) * 5e3 / 2.0)


def rates(xp: Any, p: GreenhouseParameters, crop: Crop, canopy_temperature: Array) -> Rates:
    """Return growth and respiration at a canopy temperature in degC.

    Growth is limited by the buffer, the momentary (10 to 34 degC) and the mean temperature (15 to 24.5 degC), and
    fruit by the temperature sum, each a factor from 0 to 1 (Vanthoor 2011, section 9.3); all organs grow at
    (0.047 T24 + 0.06) of their rate at 20 degC. Maintenance: c Q10^((T - 25) / 10) C (1 - exp(-2.85e6 s RGR)).
    """
    mean = crop.mean_temperature
    stocked = ramp(xp, crop.buffer, 0.0, 2.0 * BUFFER_LOW)
    at_once = ramp(xp, canopy_temperature, 6.0, 14.0) * ramp(xp, canopy_temperature, 39.0, 29.0)
    all_day = ramp(xp, mean, 12.0, 18.0) * ramp(xp, mean, 27.0, 22.0)
    speed = 0.047 * mean + 0.06
    fruiting = clip(xp, crop.temperature_sum / p.generative_sum, 0.0, 1.0)
    fruit = stocked * at_once * all_day * fruiting * speed * p.fruit_growth
    leaf = stocked * all_day * speed * p.leaf_growth
    stem = stocked * all_day * speed * p.stem_growth
    warmth = xp.exp(0.06931471805599453 * (canopy_temperature - 25.0)) * (1.0 - xp.exp(-ACTIVITY * crop.growth_rate))
    fruit_total = total(crop.fruit)
    first = truss_rate(mean) * p.stem_density * p.fruits_per_truss * clip(xp, crop.temperature_sum / 50.0, 0.0, 1.0)
    return Rates(
        fruit=fruit,
        leaf=leaf,
        stem=stem,
        growth_respiration=(GROWTH_COST["fruit"] * fruit + GROWTH_COST["leaf"] * leaf + GROWTH_COST["stem"] * stem),
        fruit_maintenance=MAINTENANCE["fruit"] * warmth * fruit_total,
        leaf_maintenance=MAINTENANCE["leaf"] * warmth * crop.leaf,
        stem_maintenance=MAINTENANCE["stem"] * warmth * crop.stem,
        first_truss=xp.maximum(first, 0.0),
    )


def total(stages: NDArray[np.float64]) -> Array:
    """Return the sum over the stages: a float for one greenhouse, an array (N,) for a batch."""
    summed = stages.sum(axis=0)
    return float(summed) if stages.ndim == 1 else summed


def grow(
    xp: Any,
    p: GreenhouseParameters,
    crop: Crop,
    rate: Rates,
    assimilated: Array,
    canopy_temperature: Array,
    seconds: float,
) -> Crop:
    """Return the crop after `seconds`.

    Args:
        xp: the namespace.
        p: parameters of the greenhouse.
        crop: the state before.
        rate: growth and respiration during the step.
        assimilated: carbohydrate fixed during the step, kg CH2O m-2.
        canopy_temperature: degC.
        seconds: length of the step.
    """
    respired = rate.respiration * seconds
    # Growing fruits share the carbohydrate by sink strength; maintenance takes from all by weight.
    fruit_before = total(crop.fruit)
    sink = SINK.reshape((STAGES, *([1] * (crop.fruits.ndim - 1)))) * crop.fruits
    sinks = total(sink)
    none = sinks < 1e-9
    share = sink / xp.maximum(sinks, 1e-9)
    into_fruit = rate.fruit * seconds
    # Carbohydrate for fruits waits in the first stage where no fruit is set yet.
    into_first = xp.where(none, into_fruit, 0.0)
    fruit = crop.fruit * (1.0 - rate.fruit_maintenance * seconds / xp.maximum(fruit_before, 1e-12))
    fruit = fruit + share * (into_fruit - into_first)
    fruit[0] += into_first
    fruits = crop.fruits.copy()
    fruits[0] += rate.first_truss * seconds
    moved = clip(xp, development_rate(crop.mean_temperature) * (STAGES * seconds), 0.0, 1.0)
    fruit_out, fruits_out = fruit * moved, fruits * moved
    fruit = fruit - fruit_out
    fruits = fruits - fruits_out
    fruit[1:] += fruit_out[:-1]
    fruits[1:] += fruits_out[:-1]
    ripe = float(fruit_out[-1]) if fruit_out.ndim == 1 else fruit_out[-1]
    grown = (rate.fruit + rate.leaf + rate.stem) * seconds
    relative = grown / (seconds * (fruit_before + crop.leaf + crop.stem))
    follow = seconds / 86_400.0
    leaf = crop.leaf + (rate.leaf - rate.leaf_maintenance) * seconds
    return crop._replace(
        buffer=crop.buffer + assimilated - grown - rate.growth_respiration * seconds,
        leaf=leaf,
        stem=crop.stem + (rate.stem - rate.stem_maintenance) * seconds,
        fruit=fruit,
        fruits=fruits,
        temperature_sum=crop.temperature_sum + canopy_temperature * follow,
        mean_temperature=crop.mean_temperature + (canopy_temperature - crop.mean_temperature) * follow,
        growth_rate=crop.growth_rate + (relative - crop.growth_rate) * follow,
        harvested=crop.harvested + ripe,
        net_growth=crop.net_growth + assimilated - respired,
    )


def deleaf(xp: Any, p: GreenhouseParameters, crop: Crop) -> Crop:
    """Return the crop after the picking of all leaves beyond the largest leaf area index."""
    kept = xp.minimum(crop.leaf, p.leaf_area_maximum / p.specific_leaf_area)
    return crop._replace(leaf=kept, removed=crop.removed + crop.leaf - kept)


def stored_carbohydrate(crop: Crop) -> Array:
    """Return the carbohydrate in the crop and taken from it, kg CH2O m-2; it grows by assimilation alone."""
    return crop.buffer + crop.leaf + crop.stem + total(crop.fruit) + crop.harvested + crop.removed
