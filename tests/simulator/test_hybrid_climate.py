"""The balances of the hybrid climate stage."""

from __future__ import annotations

from datetime import date

import numpy as np
import pytest

from igrow.core.air import LATENT_HEAT, STANDARD_PRESSURE
from igrow.core.effects import EFFECTS
from igrow.core.simulator.hybrid import climate
from igrow.core.simulator.hybrid import record as records
from igrow.core.simulator.hybrid.balances import balances
from igrow.core.simulator.hybrid.nominal import leaf_area_curve, nominal, site_record
from igrow.core.simulator.hybrid.parameters import PARAMETERS
from igrow.core.site import Crop, Greenhouse, Site
from tests.virtual_log import SITE, virtual_log


def steady_inputs(**changes: float) -> dict[str, float]:
    usual = {
        "outdoor_temperature": 8.0,
        "outdoor_humidity": 80.0,
        "outdoor_co2": 415.0,
        "global_radiation": 300.0,
        "wind_speed": 3.0,
        "sky_temperature": 0.0,
        "rail_pipe_temperature": 40.0,
        "grow_pipe_temperature": 0.0,
        "vent_lee": 0.0,
        "vent_wind": 0.0,
        "energy_screen": 0.0,
        "blackout_screen": 0.0,
        "lamp_power": 0.0,
        "co2_dosing": 0.0,
        "leaf_area_index": 3.0,
        "mean_height": 5.0,
    }
    return usual | changes


def settled(**changes: float) -> dict[str, float]:
    """The climate that constant inputs lead to."""
    values, inputs = nominal(SITE), steady_inputs(**changes)
    start = {"air_temperature": 20.0, "air_humidity": 75.0, "air_co2": 600.0}
    state = climate.initial_state(np, start, inputs, values, {}, 1.2)
    for _ in range(24 * 12 * 8):
        state = climate.advance(np, state, inputs, values, {}, seconds=300.0, lamp_efficacy=1.2)
    drivers = climate.derive(np, state, inputs, values, 1.2)
    return {name: float(drivers[name]) for name in ("air_temperature", "air_humidity", "air_co2", "ventilation")}


def test_at_rest_every_balance_is_closed() -> None:
    values, inputs = nominal(SITE), steady_inputs()
    state = climate.initial_state(
        np, {"air_temperature": 20.0, "air_humidity": 75.0, "air_co2": 600.0}, inputs, values, {}, 1.2
    )
    for _ in range(24 * 12 * 20):
        state = climate.advance(np, state, inputs, values, {}, seconds=300.0, lamp_efficacy=1.2)
    drivers = climate.derive(np, state, inputs, values, 1.2)
    fluxes = balances(np, state, drivers, values, {}).of
    assert abs(fluxes["air_temperature"][0]) < 0.01
    assert abs(fluxes["vapour_concentration"][0]) < 1e-9
    assert abs(fluxes["co2_concentration"][0]) < 1e-10


@pytest.mark.parametrize(
    ("share", "passed"),
    [(1.0, 0.55 * 0.6), (0.0, 0.55), (0.671, 1.0 / (1.0 / 0.55 + 1.0 / 0.6 - 1.0))],
    ids=["each of what the other lets pass", "as one", "resistances in series"],
)
def test_two_closed_screens_save_less_than_both_and_no_less_than_the_better(share: float, passed: float) -> None:
    values = nominal(SITE) | {
        "energy_screen_saving": 0.45, "blackout_screen_saving": 0.4, "second_screen_share": share,
    }  # fmt: skip

    def let_pass(**closed: float) -> float:
        return float(climate.forcing(np, steady_inputs(**closed), values, 1.2).drivers["screens"])

    assert let_pass(energy_screen=100.0, blackout_screen=100.0) == pytest.approx(passed, abs=1e-3)
    assert let_pass(energy_screen=50.0) == pytest.approx(1.0 - 0.5 * 0.45)
    assert let_pass(blackout_screen=50.0) == pytest.approx(1.0 - 0.5 * 0.4)


def test_co2_adds_up_in_a_tight_greenhouse_on_a_still_night() -> None:
    values = nominal(SITE) | {"leakage_still": 0.0, "respiration": 0.36}
    inputs = steady_inputs(wind_speed=0.0, global_radiation=0.0)
    state = climate.initial_state(
        np, {"air_temperature": 20.0, "air_humidity": 75.0, "air_co2": 600.0}, inputs, values, {}, 1.2
    )
    after = climate.advance(np, state, inputs, values, {}, seconds=900.0, lamp_efficacy=1.2)
    gained = (after["co2_concentration"] - state["co2_concentration"]) * inputs["mean_height"]
    # 0.36 g m-2 h-1 at 20 degC for a quarter of an hour.
    assert float(gained) == pytest.approx(0.36e-3 / 4.0, rel=0.01)


def test_thin_air_takes_fewer_grams_for_as_many_ppm() -> None:
    """At 3000 m a dose, the crop's uptake and respiration moved ppm by less than two thirds of what they do there.

    A diagnosis by the built-in bundle named CO2 from the soil, or a leaking valve, in a greenhouse where all was well.
    """
    high = Site(name="high", latitude=0.5, longitude=-78.2, elevation=3000.0)
    sea, there = nominal(Site(name="sea", latitude=0.5, longitude=-78.2)), nominal(high)
    pressure = 70_110.0  # Pa, standard atmosphere
    for name in ("dosing_share", "assimilation_maximum", "respiration"):
        assert there[name] / sea[name] == pytest.approx(STANDARD_PRESSURE / pressure, rel=0.02)
    assert {name for name in sea if there[name] != sea[name]} == {"dosing_share", "assimilation_maximum", "respiration"}
    assert nominal(Site(name="polder", latitude=52.0, longitude=4.5, elevation=-4.0)) == nominal(
        Site(name="polder", latitude=52.0, longitude=4.5)
    )


@pytest.mark.parametrize(
    ("change", "quantity", "sign"),
    [
        ({"vent_lee": 60.0}, "air_temperature", -1),
        ({"vent_lee": 60.0}, "air_humidity", -1),
        ({"energy_screen": 100.0}, "air_temperature", 1),
        ({"lamp_power": 100.0}, "air_temperature", 1),
        ({"rail_pipe_temperature": 60.0}, "air_temperature", 1),
        ({"global_radiation": 200.0}, "air_co2", -1),
        ({"co2_dosing": 0.01}, "air_co2", 1),
        ({"sky_temperature": -20.0}, "air_temperature", -1),
        ({"leaf_area_index": 1.0}, "air_humidity", -1),
    ],
)
def test_an_input_moves_the_climate_the_way_physics_says(change: dict[str, float], quantity: str, sign: int) -> None:
    # With the night's screen there is no sun in the comparison, or the shade would hide the saving.
    base = {"global_radiation": 0.0} if change.keys() & {"energy_screen", "global_radiation"} else {}
    assert sign * (settled(**base | change)[quantity] - settled(**base)[quantity]) > 0.1


def test_a_closed_screen_stops_vents_and_leaks() -> None:
    values = nominal(SITE)
    state = climate.initial_state(
        np, {"air_temperature": 20.0, "air_humidity": 75.0, "air_co2": 800.0}, steady_inputs(), values, {}, 1.2
    )
    exchange = []
    for screen in (0.0, 100.0):
        inputs = steady_inputs(energy_screen=screen, vent_lee=20.0)
        drivers = climate.derive(np, state, inputs, values, 1.2)
        exchange.append(balances(np, state, drivers, values, {}).of["co2_concentration"][1])
    assert exchange[1] < 0.7 * exchange[0]


@pytest.mark.parametrize(("channel", "most"), [("light_loss", 1.0), ("assimilation", -1.0)])
def test_an_effect_takes_no_more_light_or_assimilation_than_there_is(channel: str, most: float) -> None:
    """Effects that go on with time would in the end take more than all: a crop that gives off CO2, a sun that cools."""
    values, inputs = nominal(SITE), steady_inputs()
    start = {"air_temperature": 20.0, "air_humidity": 75.0, "air_co2": 600.0}
    state = climate.initial_state(np, start, inputs, values, {}, 1.2)
    drivers = climate.derive(np, state, inputs, values, 1.2)
    whole = most * (drivers["assimilation"] if channel == "assimilation" else 1.0)
    none, all_of_it, twice = (balances(np, state, drivers, values, {channel: share * whole}).of for share in (0, 1, 2))
    assert {name: flux for name, (flux, *_) in twice.items()} == {name: flux for name, (flux, *_) in all_of_it.items()}
    assert all_of_it["co2_concentration"][0] > none["co2_concentration"][0]


def test_a_crop_answers_less_to_drier_air_the_drier_it_is() -> None:
    """What it says of its answer is the slope of what it evaporates, in moist air four times that at a kilopascal."""
    values, inputs = nominal(SITE), steady_inputs()

    def of(humidity: float) -> dict[str, float]:
        start = {"air_temperature": 20.0, "air_humidity": humidity, "air_co2": 600.0}
        return climate.derive(np, climate.initial_state(np, start, inputs, values, {}, 1.2), inputs, values, 1.2)

    answers = []
    for humidity in (99.0, 80.0, 57.0):
        moister, drier = of(humidity + 0.1), of(humidity - 0.1)
        more = LATENT_HEAT * (drier["transpiration"] - moister["transpiration"])
        slope = more / (drier["vapour_deficit"] - moister["vapour_deficit"])
        assert slope == pytest.approx(of(humidity)["transpiration_response"], rel=0.06)
        answers.append(slope)
    assert answers[0] > 1.5 * answers[1] > 2.2 * answers[2] > 0.0
    assert answers[0] / answers[2] == pytest.approx(4.0, rel=0.1)


@pytest.mark.parametrize("humidity", [99.0, 100.0, 102.0])
def test_a_long_step_from_saturated_air_is_as_many_short_ones(humidity: float) -> None:
    """A quarter of an hour after its sensor had shown 100 % the air seemed to be at 79 %, and warmer by 1.3 K.

    What the crop would evaporate as soon as the air is drier was left out where the step began.
    """
    values, inputs = nominal(SITE) | {"transpiration_moist_air": 157.0}, steady_inputs(lamp_power=120.0)
    after = {}
    for seconds in (900.0, 30.0):
        climate_now = {"air_temperature": 22.0, "air_humidity": humidity, "air_co2": 800.0}
        state = climate.initial_state(np, climate_now, inputs, values, {}, 1.2)
        for _ in range(round(900.0 / seconds)):
            state = climate.advance(np, state, inputs, values, {}, seconds=seconds, lamp_efficacy=1.2)
        after[seconds] = climate.derive(np, state, inputs, values, 1.2)
    coarse, fine = after.values()
    assert coarse["air_temperature"] == pytest.approx(fine["air_temperature"], abs=0.4)
    assert coarse["air_humidity"] == pytest.approx(fine["air_humidity"], abs=3.0)


def test_the_step_is_small_enough() -> None:
    record = site_record(virtual_log(3, noise=False), SITE, 300.0)
    fine = site_record(virtual_log(3, noise=False, step=300.0), SITE, 900.0)
    values = nominal(SITE)
    coarse = records.free_run(fine, records.observe(fine, values, {}), [0], 96, values, {})
    exact = records.free_run(record, records.observe(record, values, {}), [0], 288, values, {})
    difference = coarse["air_temperature"][:, 0] - exact["air_temperature"][2::3, 0]
    assert np.abs(difference).mean() < 0.35


def test_variants_in_one_batch_equal_runs_one_by_one() -> None:
    record = site_record(virtual_log(2), SITE, 300.0)
    values = nominal(SITE)
    other = values | {"transmissivity": 0.5, "mass_heat_capacity": 200.0}
    batch = {name: np.array([[values[name]], [other[name]]]) for name in values}
    together = records.free_run(record, records.observe(record, batch, {}), [0, 100], 60, batch, {})
    for position, single in enumerate((values, other)):
        alone = records.free_run(record, records.observe(record, single, {}), [0, 100], 60, single, {})
        np.testing.assert_allclose(together["air_temperature"][:, position], alone["air_temperature"], rtol=1e-9)


@pytest.mark.filterwarnings("error")
def test_a_run_that_leaves_all_bounds_is_told_by_its_numbers_and_by_no_warning() -> None:
    record, values = site_record(virtual_log(2, step=900.0), SITE, 900.0), nominal(SITE)
    states, fire = records.observe(record, values, {}), {"heat": np.full(len(record), 1e12)}
    shown = records.free_run(record, states, [0], 60, values, {}, fire)
    assert not np.isfinite(shown["air_co2"]).all()


def test_floor_and_soil_follow_the_measured_air_as_the_balances_lead_them() -> None:
    """Whatever the log's length is to the stretches that are run side by side."""
    whole, values = site_record(virtual_log(7, step=900.0), SITE, 900.0), nominal(SITE)
    for samples in (1, 2, 150, 577):
        record = whole.slice(0, samples)
        states = records.observe(record, values, {})
        drivers = climate.derive(np, states, record.inputs, values, record.lamp_efficacy)
        for k in range(len(record) - 1):
            now = {name: course[k] for name, course in states.items()}
            led = climate.step(
                np,
                now,
                {name: np.broadcast_to(v, len(record))[k] for name, v in drivers.items()},
                values,
                {},
                seconds=900.0,
            )
            for name in ("mass_temperature", "soil_temperature"):
                assert states[name][k + 1] == pytest.approx(led[name], rel=1e-9), (name, k)


def test_memories_of_variants_equal_those_of_each_alone() -> None:
    # A sensor that the sun warms is corrected by the light inside, which differs from variant to variant; what its
    # housing remembers then differs too.
    record = site_record(virtual_log(days=2, step=900.0), SITE, 900.0)
    effects = {name: EFFECTS[name].values() for name in ("air_temperature_lag", "air_temperature_radiation_error")}
    parameters = nominal(SITE)
    transmissivity = np.array([0.5, 0.7])
    together = records.observe(record, parameters | {"transmissivity": transmissivity[:, None]}, effects)
    for position, value in enumerate(transmissivity):
        alone = records.observe(record, parameters | {"transmissivity": float(value)}, effects)
        for name, course in alone.items():
            of_both = np.broadcast_to(together[name], (2, len(record)))
            np.testing.assert_allclose(of_both[position], course, rtol=1e-9, err_msg=name)


def test_a_site_scales_what_it_describes_and_stays_within_bounds() -> None:
    leaky = Site(name="leaky", latitude=52.0, longitude=4.5, greenhouse=Greenhouse(leakage=2.4e-4))
    assert nominal(leaky)["leakage_wind"] == pytest.approx(2.0 * nominal(SITE)["leakage_wind"])
    extreme = Site(
        name="x", latitude=0.0, longitude=0.0, greenhouse=Greenhouse(cover_heat_transfer=15, cover_area_ratio=5)
    )
    assert all(PARAMETERS[name].low <= value <= PARAMETERS[name].high for name, value in nominal(extreme).items())


def test_a_log_without_leaf_area_gets_the_crops_usual_course_and_says_so() -> None:
    log = virtual_log(2)
    record = site_record(log, SITE, 300.0)
    assert "leaf_area_index" in record.missing
    curve = leaf_area_curve(
        Site(name="young", latitude=0, longitude=0, crop=Crop(planting_date=date(2020, 2, 1))),
        log.time,
    )
    assert curve[0] == pytest.approx(0.4, abs=0.1)  # as transplants have
    assert (np.diff(curve) >= 0.0).all()


def test_before_a_planting_an_older_crop_stands() -> None:
    site = Site(name="replanted", latitude=0, longitude=0, crop=Crop(planting_date=date(2020, 2, 1)))
    days = np.datetime64("2020-02-01T00:00:00", "s") + np.arange(-40, 80) * np.timedelta64(1, "D")
    curve = leaf_area_curve(site, days)
    assert (curve[:40] == 3.0).all()
    assert curve[40] == pytest.approx(0.4, abs=0.1)
    assert curve[-1] > 2.9
    # A greenhouse that stands empty before its first crop.
    assert (leaf_area_curve(site, days[20:])[:20] == 0.0).all()


def test_a_coarser_record_keeps_what_was_measured_and_the_means_of_what_drove_it() -> None:
    record = site_record(virtual_log(1), SITE, 300.0)
    coarse = record.coarser(3)
    assert coarse.step == 900.0
    assert len(coarse) == len(record) // 3
    np.testing.assert_array_equal(coarse.measured["air_co2"], record.measured["air_co2"][::3])
    assert coarse.inputs["lamp_power"][5] == pytest.approx(record.inputs["lamp_power"][15:18].mean())
