"""How far off a sensor can have been, by what air there is: no greenhouse holds more vapour than its air can carry.

A humidity sensor that reads 95 % cannot read 9 % too little. Beyond that bound the model's air is saturated at every
such reading, its errors have kinks, and a fit there says anything.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from igrow.core.arrays import Mask
from igrow.core.effects import Effect
from igrow.core.simulator.hybrid.record import Record

POSSIBLE: Mapping[str, tuple[float, float]] = {"air_humidity": (0.0, 100.0), "air_co2": (100.0, np.inf)}
"""Least and largest value of a quantity in a greenhouse's air: %, ppm (a crop takes up none below its compensation
point of 50 to 100 ppm)."""
STRAY = 0.01
"""Share of readings at either end that bind nothing: noise, and a sensor being cleaned."""


def amplitude_bounds(effect: Effect, record: Record, acts: Mask | None = None) -> tuple[float, float]:
    """Return the least and the largest amplitude of an effect: the catalogue's, or what the readings leave of that.

    Args:
        effect: of the catalogue.
        record: of the log.
        acts: rows in which the effect acts, (n,); None for all.
    """
    low, high = effect.amplitude.low, effect.amplitude.high
    if not is_constant(effect):
        return low, high
    (quantity,) = effect.measured
    least, largest = POSSIBLE[quantity]
    if quantity not in record.measured:
        return low, high
    read = record.measured[quantity]
    read = read[np.isfinite(read) & (True if acts is None else acts)]
    if len(read) == 0:
        return low, high
    # The air had what was read less the amplitude.
    bottom, top = np.quantile(read, (STRAY, 1.0 - STRAY))
    return max(low, min(float(top) - largest, 0.0)), min(high, max(float(bottom) - least, 0.0))


def is_constant(effect: Effect) -> bool:
    """Tell whether an effect adds the same to all readings of a quantity that has such bounds.

    What a drift may reach depends on when it began, and that is not known yet when it is judged.
    """
    quantity = effect.measured[0] if len(effect.measured) == 1 else ""
    return effect.kind == "sensor" and effect.drivers == (quantity,) and quantity in POSSIBLE and effect.memory is None
