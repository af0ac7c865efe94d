"""Traps of climate computers' logs: sensor spikes, and pipes that read zero while their circuit is off."""

from __future__ import annotations

import numpy as np

from igrow.core.arrays import Floats
from igrow.core.quantities import QUANTITIES

_JUMPS = {"air_temperature": 5.0, "air_humidity": 18.0, "air_co2": 350.0}
"""A reading further than this from the median of its neighbours, in the quantity's unit, is a spike."""
COOLING_TIME = 90.0 * 60.0
"""Seconds in which a pipe with standing water loses 63 % of its excess over the air.

Measured on the rail pipe of the 2019 Reference compartment: 362 times the circuit came on again; after 8, 11,
19 and 35 steps of 5 min off, 63, 54, 41 and 29 % of the excess were left.
"""


def without_spikes(name: str, values: Floats) -> Floats:
    """Return a column with readings out of range, and those far from all their neighbours, set to NaN.

    Args:
        name: of the quantity.
        values: (n,), a step of about 5 minutes.
    """
    quantity = QUANTITIES[name]
    kept = np.where((values >= quantity.low) & (values <= quantity.high), values, np.nan)
    limit = _JUMPS.get(name)
    if limit is None or len(kept) < 5:
        return kept
    padded = np.pad(kept, 3, constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(padded, 7)
    some = np.isfinite(windows).any(axis=1)
    middle = np.full(len(kept), np.nan)
    middle[some] = np.nanmedian(windows[some], axis=1)
    return np.where(np.abs(kept - middle) > limit, np.nan, kept)


def cooling_pipe(pipe: Floats, air_temperature: Floats, step: float) -> Floats:
    """Return pipe temperatures with the zeros of a circuit that is off replaced by water that cools down.

    The excess over the air at the moment of switching off falls with `COOLING_TIME`; nothing later than that
    moment is used. A pipe that was never on is at the air's first temperature.

    Args:
        pipe: degC, exactly 0 (or below 1) where the circuit is off, (n,).
        air_temperature: degC, (n,).
        step: seconds between rows.
    """
    decay = float(np.exp(-step / COOLING_TIME))
    air = np.where(np.isfinite(air_temperature), air_temperature, 20.0)
    result = np.array(pipe)
    excess, base = 0.0, float(air[0]) if len(air) else 20.0
    for k in range(len(pipe)):
        value = pipe[k]
        if value >= 1.0:
            base = float(air[k])
            excess = float(value) - base
        elif value < 1.0:
            excess *= decay
            result[k] = base + excess
    return result
