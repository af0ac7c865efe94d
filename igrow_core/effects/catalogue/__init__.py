"""The catalogue: one module an effect, each with its `EFFECT`. A new one is a file, a line below, and a test."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from igrow.core.effects.catalogue import (
    air_temperature_lag,
    air_temperature_offset,
    air_temperature_radiation_error,
    angle_transmission,
    co2_dose_vent_loss,
    co2_drift,
    co2_offset,
    co2_valve_leak,
    cover_ageing,
    cover_condensation,
    deficit_stomata_closure,
    heating_valve_leak,
    humidity_drift,
    humidity_offset,
    irrigation_evaporation,
    lamp_heat,
    leaf_area_transpiration,
    night_transpiration,
    photosynthesis_decline,
    photosynthesis_heat_limit,
    pipe_lag,
    pipe_temperature_offset,
    rain_cooling,
    screen_gap,
    sky_cooling,
    soil_heat_storage,
    soil_respiration,
    stack_ventilation,
    structure_shade,
    vent_backlash,
    vent_wind_asymmetry,
    wind_infiltration,
)
from igrow.core.effects.definition import Effect

EFFECTS: Mapping[str, Effect] = MappingProxyType(
    {
        module.EFFECT.name: module.EFFECT
        for module in (
            wind_infiltration,
            screen_gap,
            sky_cooling,
            cover_condensation,
            soil_heat_storage,
            lamp_heat,
            pipe_lag,
            heating_valve_leak,
            vent_wind_asymmetry,
            stack_ventilation,
            vent_backlash,
            cover_ageing,
            structure_shade,
            angle_transmission,
            rain_cooling,
            night_transpiration,
            deficit_stomata_closure,
            irrigation_evaporation,
            leaf_area_transpiration,
            co2_valve_leak,
            co2_dose_vent_loss,
            photosynthesis_heat_limit,
            photosynthesis_decline,
            soil_respiration,
            air_temperature_offset,
            humidity_offset,
            co2_offset,
            pipe_temperature_offset,
            air_temperature_radiation_error,
            air_temperature_lag,
            humidity_drift,
            co2_drift,
        )
    }
)
"""Every effect by its name, processes first."""
