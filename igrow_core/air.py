"""Physics of moist air: saturation, humidity, and the conversions between units of gas content.

Every function is pure and elementwise; where it takes `xp` it works in numpy, in torch and while a graph is
traced. Temperatures are degC, pressures Pa, gas contents kg m-3.
"""

from __future__ import annotations

import math
from typing import Any

from igrow.core.arrays import Array

STANDARD_PRESSURE = 101_325.0
"""Air pressure at sea level, Pa."""
GAS_CONSTANT = 8.314462618
"""Molar gas constant, J mol-1 K-1."""
MOLAR_MASS_WATER = 0.018015
"""kg mol-1."""
MOLAR_MASS_CO2 = 0.04401
"""kg mol-1."""
SPECIFIC_HEAT_AIR = 1006.0
"""Specific heat of dry air at constant pressure, J kg-1 K-1."""
VOLUMETRIC_HEAT = 1.2 * SPECIFIC_HEAT_AIR
"""Heat capacity of air at 20 degC, J m-3 K-1."""
LATENT_HEAT = 2.45e6
"""Heat of evaporation of water at 20 degC, J kg-1."""
STEFAN_BOLTZMANN = 5.670374419e-8
"""W m-2 K-4."""


def thinness(elevation: float) -> float:
    """Return how many times denser air is at the sea than at an elevation in m; 1 below the sea.

    Barometric formula of an atmosphere of 288 K, whose scale height is 8434 m.
    """
    return math.exp(max(elevation, 0.0) / 8434.0)


def saturation_pressure(xp: Any, temperature: Array) -> Array:
    """Return the vapour pressure over water at saturation in Pa.

    Magnus form with the coefficients of Alduchov and Eskridge (1996), J. Appl. Meteor. 35, 601-609, eq. 21;
    within 0.4 % from -40 to 50 degC.
    """
    return 610.94 * xp.exp(17.625 * temperature / (temperature + 243.04))


def saturation_concentration(xp: Any, temperature: Array) -> Array:
    """Return the vapour content of saturated air in kg m-3 (ideal gas)."""
    return saturation_pressure(xp, temperature) * (MOLAR_MASS_WATER / GAS_CONSTANT) / (temperature + 273.15)


def vapour_concentration(xp: Any, temperature: Array, humidity: Array) -> Array:
    """Return the vapour content in kg m-3 of air at a relative humidity in %."""
    return 0.01 * humidity * saturation_concentration(xp, temperature)


def relative_humidity(xp: Any, temperature: Array, concentration: Array) -> Array:
    """Return the relative humidity in % of air with a vapour content in kg m-3 (not cut at 100)."""
    return humidity_and_deficit(xp, temperature, concentration)[0]


def humidity_and_deficit(xp: Any, temperature: Array, concentration: Array) -> tuple[Array, Array]:
    """Return the relative humidity, and the pressure in Pa that the vapour lacks to saturation (never negative).

    Saturation, which is what takes long, is computed once.
    """
    saturated, kelvin = saturation_pressure(xp, temperature), temperature + 273.15
    humidity = 100.0 * concentration / (saturated * (MOLAR_MASS_WATER / GAS_CONSTANT) / kelvin)
    pressure = concentration * (GAS_CONSTANT / MOLAR_MASS_WATER) * kelvin
    return humidity, xp.maximum(saturated - pressure, 0.0 * pressure)


def co2_concentration(temperature: Array, ppm: Array) -> Array:
    """Return the CO2 content in kg m-3 of air of standard pressure with a volume fraction in ppm."""
    return ppm * (1e-6 * STANDARD_PRESSURE * MOLAR_MASS_CO2 / GAS_CONSTANT) / (temperature + 273.15)


def co2_fraction(temperature: Array, concentration: Array) -> Array:
    """Return the CO2 volume fraction in ppm of air of standard pressure with a content in kg m-3."""
    return concentration * (temperature + 273.15) / (1e-6 * STANDARD_PRESSURE * MOLAR_MASS_CO2 / GAS_CONSTANT)
