"""Gas exchange of the canopy: stomata, transpiration, photosynthesis.

Stomata and transpiration after Stanghellini (1987) in the form of Vanthoor (2011, appendix section 6);
photosynthesis after Farquhar, von Caemmerer and Berry (1980, Planta 149, 78-90) limited by electron transport,
for a whole canopy, in the form of Vanthoor (2011, appendix section 9.2).
"""

from __future__ import annotations

from typing import Any

from igrow.core.arrays import Array
from igrow.core.greenhouse.parameters import GreenhouseParameters
from igrow.core.namespace import sigmoid

GAS_CONSTANT = 8.314
"""J mol-1 K-1."""
ACTIVATION_ENERGY = 37e3
"""Of electron transport, J mol-1 (Farquhar et al. 1980)."""
DEACTIVATION_ENERGY = 22e4
"""J mol-1."""
ENTROPY = 710.0
"""J mol-1 K-1."""
CURVATURE = 0.7
"""Of electron transport against light, 1."""
ELECTRONS_PER_PHOTON = 0.385
"""1, with losses in the leaf."""
STOMATAL_RATIO = 0.67
"""CO2 in the stomata over CO2 in the air, 1 (Evans and Farquhar 1991)."""
COMPENSATION = 1.7
"""CO2 compensation point for each degC of the canopy, ppm K-1 (Farquhar 1988)."""
REFERENCE = 298.15
"""K."""


def stomatal_resistance(
    xp: Any,
    parameters: GreenhouseParameters,
    radiation: Array,
    co2: Array,
    vapour_deficit: Array,
    water_stress: Array,
) -> Array:
    """Return the stomatal resistance of a leaf to vapour, s m-1.

    Args:
        xp: the namespace.
        parameters: of the greenhouse.
        radiation: short-wave above the canopy, W m-2.
        co2: ppm.
        vapour_deficit: canopy saturation minus air, Pa.
        water_stress: 1 for ample water, 0 for none.

    Stanghellini (1987): minimum times a factor each for radiation (R + 4.3) / (R + 0.54), CO2 and vapour
    deficit, the last two with separate coefficients for day and night that a sigmoid at 5 W m-2 joins.
    """
    day = sigmoid(xp, radiation - 5.0)
    light = (radiation + 4.3) / (radiation + 0.54)
    carbon = 1.0 + (1.1e-11 + (6.1e-7 - 1.1e-11) * day) * (co2 - 200.0) * (co2 - 200.0)
    dryness = 1.0 + (5.2e-6 + (4.3e-6 - 5.2e-6) * day) * vapour_deficit * vapour_deficit
    # Beyond these the fitted parabolas leave the range of Stanghellini's leaves.
    resistance = parameters.minimum_stomatal_resistance * light * xp.minimum(carbon, 1.5) * xp.minimum(dryness, 5.8)
    return xp.minimum(resistance / xp.maximum(water_stress, 0.05), parameters.night_stomatal_resistance)


def vapour_conductance(parameters: GreenhouseParameters, leaf_area_index: Array, stomatal: Array) -> Array:
    """Return the conductance from canopy to air, m s-1 of floor: 2 LAI / (rb + rs) (Vanthoor, eq. 8.47)."""
    return 2.0 * leaf_area_index / (parameters.boundary_resistance + stomatal)


def photosynthesis(
    xp: Any,
    parameters: GreenhouseParameters,
    par_absorbed: Array,
    co2: Array,
    canopy_temperature: Array,
    leaf_area_index: Array,
) -> Array:
    """Return gross photosynthesis less photorespiration of the canopy, mol CO2 m-2 s-1 of floor.

    Args:
        xp: the namespace.
        parameters: of the greenhouse.
        par_absorbed: PAR that the canopy absorbs, umol m-2 s-1.
        co2: in the air, ppm.
        canopy_temperature: degC.
        leaf_area_index: m2 m-2.

    P = J (Ci - G) / (4 (Ci + 2 G)) with Ci = 0.67 CO2 and the compensation point G of a canopy (Vanthoor 2011,
    appendix eqs. 9.10 to 9.23); photorespiration P G / Ci is taken off.
    """
    area = xp.maximum(leaf_area_index, 0.05)
    kelvin = canopy_temperature + 273.15
    warm = xp.exp(ACTIVATION_ENERGY * (kelvin - REFERENCE) / (REFERENCE * GAS_CONSTANT * kelvin))
    collapse = 1.0 + xp.exp((ENTROPY * kelvin - DEACTIVATION_ENERGY) / (GAS_CONSTANT * kelvin))
    at_reference = 1.0 + 2.718281828459045 ** ((ENTROPY * REFERENCE - DEACTIVATION_ENERGY) / (GAS_CONSTANT * REFERENCE))
    potential = area * parameters.electron_transport * warm * at_reference / collapse
    light = ELECTRONS_PER_PHOTON * par_absorbed
    both = potential + light
    transport = (both - xp.sqrt(both * both - 4.0 * CURVATURE * potential * light)) / (2.0 * CURVATURE)
    warmth = xp.maximum(canopy_temperature, 1.0)
    # The formula is made for a closed canopy; below a leaf area of one it would run away.
    closed = xp.maximum(area, 1.0)
    compensation = COMPENSATION * warmth / closed + 20.0 * COMPENSATION * (1.0 - 1.0 / closed)
    compensation = xp.maximum(compensation, 10.0)
    inside = STOMATAL_RATIO * co2
    gross = transport * (inside - compensation) / (4.0 * (inside + 2.0 * compensation))
    return xp.maximum(1e-6 * gross * (1.0 - compensation / inside), 0.0)
