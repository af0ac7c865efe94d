"""One table for the whole catalogue: silent at amplitude zero, linear in it, reading only what is declared."""

from __future__ import annotations

import numpy as np
import pytest

from igrow.core.effects import EFFECTS, PROCESS_CHANNELS, Effect
from igrow.core.quantities import QUANTITIES
from igrow.core.simulator.hybrid.parameters import PARAMETERS

# name: (drivers of an hour that shows it, channel, sign of the first contribution at the typical amplitude)
SIGNS = {
    "wind_infiltration": ("air_exchange", 1),
    "screen_gap": ("heat", -1),
    "sky_cooling": ("heat", -1),
    "cover_condensation": ("vapour", -1),
    "soil_heat_storage": ("heat", -1),
    "lamp_heat": ("heat", 1),
    "pipe_lag": ("heat", -1),
    "heating_valve_leak": ("heat", 1),
    "vent_wind_asymmetry": ("air_exchange", 1),
    "stack_ventilation": ("air_exchange", 1),
    "vent_backlash": ("air_exchange", -1),
    "cover_ageing": ("light_loss", 1),
    "structure_shade": ("light_loss", 1),
    "angle_transmission": ("light_loss", 1),
    "rain_cooling": ("heat", -1),
    "night_transpiration": ("vapour", 1),
    "deficit_stomata_closure": ("vapour", -1),
    "irrigation_evaporation": ("vapour", 1),
    "leaf_area_transpiration": ("vapour", 1),
    "co2_valve_leak": ("co2", 1),
    "co2_dose_vent_loss": ("co2", -1),
    "photosynthesis_heat_limit": ("assimilation", -1),
    "photosynthesis_decline": ("assimilation", -1),
    "soil_respiration": ("co2", 1),
    "air_temperature_offset": ("air_temperature", 1),
    "humidity_offset": ("air_humidity", 1),
    "co2_offset": ("air_co2", 1),
    "pipe_temperature_offset": ("rail_pipe_temperature", 1),
    "air_temperature_radiation_error": ("air_temperature", 1),
    "air_temperature_lag": ("air_temperature", -1),
    "humidity_drift": ("air_humidity", 1),
    "co2_drift": ("air_co2", 1),
}
CATALOGUE = list(SIGNS)
"""In the order of the catalogue."""

HOUR = {
    "outdoor_temperature": 5.0,
    "outdoor_humidity": 80.0,
    "outdoor_co2": 420.0,
    "global_radiation": 0.0,
    "wind_speed": 4.0,
    "wind_direction": 225.0,
    "sky_temperature": -8.0,
    "rain": 1.0,
    "air_temperature": 28.0,
    "air_humidity": 85.0,
    "air_co2": 800.0,
    "leaf_area_index": 4.0,
    "rail_pipe_temperature": 40.0,
    "grow_pipe_temperature": 35.0,
    "rail_pipe_excess": 2.0,
    "grow_pipe_excess": 2.0,
    "vent_lee": 30.0,
    "vent_wind": 20.0,
    "energy_screen": 90.0,
    "blackout_screen": 0.0,
    "lamp_power": 1.0,
    "co2_dosing": 0.01,
    "irrigation": 2.0,
    "mean_height": 5.0,
    "elapsed_days": 30.0,
    "hour": 12.0,
    "sun_elevation": 20.0,
    "sun_azimuth": 140.0,
    "radiation_inside": 200.0,
    "vapour_concentration": 0.02,
    "outdoor_vapour_concentration": 0.006,
    "vapour_deficit": 1500.0,
    "ventilation": 0.01,
    "transpiration": 3e-5,
    "assimilation": 1e-6,
}
MEMORY_BELOW = {"soil_heat_storage": 20.0, "pipe_lag": 1.0, "vent_backlash": 20.0, "air_temperature_lag": 25.0}


def read_hour(effect: Effect) -> dict[str, float]:
    """Only what the effect declares: a driver that it forgot to declare is a KeyError."""
    return {name: HOUR[name] for name in effect.drivers}


def contribution(effect: Effect, amplitude: float) -> dict[str, float]:
    drivers = read_hour(effect)
    values = effect.values(**{effect.amplitude.name: amplitude})
    memory = None
    if effect.memory is not None:
        memory = MEMORY_BELOW.get(effect.name, effect.memory.start(np, drivers, values))
    return {name: float(value) for name, value in effect.contribution(np, drivers, values, memory).items()}


def test_the_catalogue_holds_all_thirty_two_effects_in_order() -> None:
    assert list(EFFECTS) == CATALOGUE


@pytest.mark.parametrize("name", CATALOGUE)
def test_an_effect_adds_to_the_channel_and_with_the_sign_it_is_told_by(name: str) -> None:
    channel, sign = SIGNS[name]
    added = contribution(EFFECTS[name], EFFECTS[name].amplitude.typical)
    assert sign * added[channel] > 0.0


@pytest.mark.parametrize("name", CATALOGUE)
def test_an_effect_is_silent_at_amplitude_zero_and_linear_in_it(name: str) -> None:
    effect = EFFECTS[name]
    nothing, once, twice = (contribution(effect, size * effect.amplitude.typical) for size in (0.0, 1.0, 2.0))
    for channel, value in once.items():
        assert nothing[channel] == 0.0
        assert twice[channel] == pytest.approx(2.0 * value, rel=1e-12)


@pytest.mark.parametrize("name", CATALOGUE)
def test_a_process_enters_balances_and_a_sensor_fault_enters_measurements_only(name: str) -> None:
    effect = EFFECTS[name]
    channels = set(contribution(effect, effect.amplitude.typical))
    if effect.kind == "process":
        assert channels <= set(PROCESS_CHANNELS)
        assert effect.balances
        assert not effect.measured
    else:
        assert channels == set(effect.measured)
        assert channels <= set(QUANTITIES)
        assert not effect.balances


@pytest.mark.parametrize("name", CATALOGUE)
def test_an_effect_tells_its_bounds_its_source_and_the_test_that_separates_it(name: str) -> None:
    effect = EFFECTS[name]
    for parameter in effect.parameters:
        assert parameter.low <= parameter.typical <= parameter.high
        assert parameter.unit
    assert effect.source
    assert effect.signature
    assert effect.separating_test
    assert effect.title
    assert "{value}" not in effect.sentence.format(value="1", unit=effect.amplitude.unit)
    assert set(effect.resembles) <= set(PARAMETERS)


@pytest.mark.parametrize("name", [name for name in CATALOGUE if EFFECTS[name].memory is not None])
def test_a_memory_rests_where_it_starts_under_drivers_that_stand_still(name: str) -> None:
    effect = EFFECTS[name]
    assert effect.memory is not None
    drivers, values = read_hour(effect), effect.values()
    start = effect.memory.start(np, drivers, values)
    assert effect.memory.advance(np, start, drivers, values, 300.0) == pytest.approx(start)


@pytest.mark.parametrize("effect", EFFECTS.values(), ids=list(EFFECTS))
def test_an_effect_of_either_sign_has_a_sentence_for_both(effect: Effect) -> None:
    assert bool(effect.opposite) == (effect.amplitude.low < 0.0)
    for amplitude in (-2.0, 2.0):
        sentence, size = effect.told(amplitude)
        assert size == (abs(amplitude) if effect.opposite else amplitude)
        assert sentence == (effect.opposite if effect.opposite and amplitude < 0.0 else effect.sentence)
        assert "{value}" not in sentence.format(value=size, unit=effect.amplitude.unit)
