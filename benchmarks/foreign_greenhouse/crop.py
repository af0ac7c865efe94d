"""The crop's gas exchange and its leaves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.foreign_greenhouse.plant import ForeignGreenhouse, Values
from igrow.core.air import MOLAR_MASS_CO2, co2_fraction, saturation_concentration, saturation_pressure

GROWTH_HOURS = 14.0
"""In which what was taken up becomes a crop."""
GROWTH_RESPIRATION = 0.28
"""Of what becomes a crop, 1."""
LEAVES = 3.2
"""Leaf area index for each kg m-2 of CO2 that becomes a crop."""


@dataclass(frozen=True)
class Exchange:
    """What the crop exchanges with the air, as means of a step."""

    conductance: Any
    """Of all leaves to vapour, m s-1."""
    transpired: Any
    """kg m-2 s-1."""
    unaffected: Any
    """CO2 that it would take up but for what is hidden, kg m-2 s-1, as are the next."""
    taken: Any
    respired: Any


def exchange(p: ForeignGreenhouse, s: Values, light: Values, hidden: Any, seconds: float) -> Exchange:
    """Return the crop's gas exchange, and let its leaves grow.

    Stomata by the form of Stanghellini (1987), photosynthesis after Acock et al. (1978), its answer to CO2 by Farquhar
    et al. (1980).

    Args:
        p: parameters.
        s: states; leaf area and buffer are carried on.
        light: of `distribute`.
        hidden: assimilation that a hidden effect adds, kg m-2 s-1.
        seconds: of the step.
    """
    leaf, area = s["leaf"], np.maximum(s["area"], 0.1)
    ppm = co2_fraction(s["air"], s["co2"])
    radiation = light["canopy"] / (2.0 * area)
    deficit = np.clip(saturation_pressure(np, leaf) - 461.5 * s["vapour"] * (s["air"] + 273.15), 0.0, 4000.0) / 1000.0
    stomata = p.stomatal_resistance * (radiation + 4.3) / (radiation + 0.54) * (1.0 + 0.023 * (leaf - 24.5) ** 2)
    stomata = np.minimum(
        stomata * (1.0 + 2.2 * deficit**2) * np.minimum(1.0 + 6.1e-7 * (ppm - 200.0) ** 2, 1.5), 2800.0
    )

    compensation = 42.0 * 1.4 ** ((leaf - 20.0) / 10.0)
    above = np.maximum(ppm - compensation, 0.0)
    efficiency = 0.072 * above / (ppm + 2.0 * compensation)
    largest = 1.04 * area * p.assimilation * np.exp(-(((leaf - 24.0) / 13.0) ** 2)) * above / (ppm + 320.0)
    fixed = largest * (1.0 - np.exp(-efficiency * light["absorbed"] / np.maximum(largest, 1e-6)))
    unaffected = 1e-6 * MOLAR_MASS_CO2 * fixed
    taken = np.maximum(unaffected + hidden, 0.0)
    grown = s["buffer"] / (3600.0 * GROWTH_HOURS)
    respired = p.respiration * 2.0 ** ((leaf - 25.0) / 10.0) + GROWTH_RESPIRATION * grown
    s["buffer"] = np.maximum(s["buffer"] + seconds * (taken - grown), 0.0)
    s["area"] = area + seconds * LEAVES * grown
    conductance = 2.0 * area / (0.9 * p.leaf_resistance + stomata)
    transpired = conductance * (saturation_concentration(np, leaf) - s["vapour"])
    return Exchange(conductance, transpired, unaffected, taken, respired)
