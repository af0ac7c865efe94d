"""The plausibility gate: what is wrong with a log is named as what it is, with its mend; a clean log passes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.plausibility import SPOILS, Clean, Spoil, false_alarms, real_logs
from igrow.core import sun
from igrow.core.greenhouse import generate_weather
from igrow.core.greenhouse.weather import WeatherClimate
from igrow.core.site import Site
from igrow.core.telemetry import Telemetry, to_grid
from igrow.core.yaml_schema import parse
from igrow.trainer.data import prepare_log
from igrow.trainer.data.export import read
from igrow.trainer.data.grid import own_step
from igrow.trainer.data.mapping import ExportMapping
from igrow.trainer.data.plausibility import find_faults
from igrow.trainer.data.plausibility.relations import units_by_relation
from igrow.trainer.data.plausibility.sums import running_sum
from igrow.trainer.data.plausibility.sunlight import against_the_sun
from igrow.trainer.data.rows import merge
from tests.virtual_log import virtual_log

SITE = Site(name="virtual", latitude=52.0, longitude=4.5, time_zone="Europe/Amsterdam")


@pytest.fixture(scope="module")
def clean() -> Clean:
    """Weeks of wind, with vents that open: of vents that never pass 30 % nobody knows what 0.3 means."""
    table = virtual_log(20, seed=5)
    more = {"wind_speed": table["wind_speed"] * 1.6, "vent_lee": table["vent_lee"] * 8.0}
    return Clean("virtual", SITE, table.with_columns(more))


def test_a_clean_log_passes_at_every_pace(clean: Clean) -> None:
    for step in (300, 900, 1800, 3600):
        assert find_faults(to_grid(clean.telemetry, step), SITE) == ()


@pytest.mark.parametrize("name", SPOILS)
def test_a_fault_is_named_as_what_it_is_with_its_mend(clean: Clean, name: str) -> None:
    spoil: Spoil = SPOILS[name]
    found = find_faults(spoil.spoilt(clean), SITE)
    assert {fault.kind for fault in found} & set(spoil.kinds), [str(fault) for fault in found]
    assert {fault.kind for fault in found} <= set(spoil.kinds), [str(fault) for fault in found]
    assert all(fault.mend for fault in found)


@pytest.mark.parametrize(
    "name",
    [
        "air temperature in degF",
        "outdoor temperature in degF",
        "sky temperature in degF",
        "pipe temperature in degF",
        "air temperature in kelvin",
        "humidity 0 to 1",
        "humidity outside 0 to 1",
        "CO2 in %",
        "CO2 outside in mg m-3",
        "screen 0 to 1",
        "vents 0 to 1",
        "wind in km/h",
    ],
)
def test_a_certain_remedy_gives_the_log_back(clean: Clean, name: str) -> None:
    spoilt = SPOILS[name].spoilt(clean)
    (fault,) = find_faults(spoilt, SITE)
    assert fault.remedy is not None
    mended = spoilt[fault.quantity] * fault.remedy.scale + fault.remedy.offset
    np.testing.assert_allclose(mended, clean.telemetry[fault.quantity], rtol=1e-6, atol=1e-6)


def test_warm_weather_is_no_fahrenheit_where_it_is_warm(clean: Clean) -> None:
    """41 degC outside at noon and 33 in the median is a July in Riyadh, and no February in the Netherlands."""
    table = clean.telemetry
    hot = table.with_columns({"outdoor_temperature": table["outdoor_temperature"] + 26.0})
    summer = Telemetry(hot.time + np.timedelta64(150, "D"), hot.columns)
    assert [fault.quantity for fault in units_by_relation(hot, SITE)] == ["outdoor_temperature"]
    assert units_by_relation(summer, Site(name="riyadh", latitude=24.7, longitude=46.7)) == []


def test_the_weather_in_the_place_of_the_air_is_no_fahrenheit(clean: Clean) -> None:
    exchanged = SPOILS["inside and outside exchanged"].spoilt(clean)
    assert "fahrenheit" not in {fault.kind for fault in find_faults(exchanged, SITE)}


def test_grams_a_cubic_metre_outside_are_no_per_cent(clean: Clean) -> None:
    table = clean.telemetry
    warmth = table["outdoor_temperature"]
    grams = np.asarray(0.8 * 5.0 * np.exp(0.065 * warmth), dtype=np.float64)
    (fault,) = find_faults(table.with_columns({"outdoor_humidity": grams}), SITE)
    assert (fault.kind, fault.quantity) == ("absolute_humidity", "outdoor_humidity")
    desert = 30.0 - warmth
    assert find_faults(table.with_columns({"outdoor_humidity": desert}), SITE) == ()


def test_pipes_that_are_hot_throughout_cold_weeks_are_no_fahrenheit(clean: Clean) -> None:
    """A greenhouse without lamps in January: its pipes never rest. Where it is mild outside they do at times."""
    table = clean.telemetry
    hot = table.with_columns({"rail_pipe_temperature": np.linspace(60.0, 84.0, len(table))})
    for outside, faults in ((2.0, []), (20.0, ["rail_pipe_temperature"])):
        moved = table["outdoor_temperature"] - np.mean(table["outdoor_temperature"]) + outside
        found = units_by_relation(hot.with_columns({"outdoor_temperature": moved}), SITE)
        assert [one.quantity for one in found if one.quantity != "outdoor_temperature"] == faults


def test_windward_vents_that_hardly_open_in_winter_are_no_fraction(clean: Clean) -> None:
    lee = clean.telemetry["vent_lee"]
    small = 0.98 * lee / lee.max()
    assert find_faults(clean.telemetry.with_columns({"vent_wind": small}), SITE) == ()
    (fault,) = find_faults(clean.telemetry.with_columns({"vent_lee": small, "vent_wind": 0.0 * lee}), SITE)
    assert (fault.kind, fault.quantity) == ("fraction", "vent_lee")


def test_lamps_that_only_burn_or_not_are_no_power(clean: Clean) -> None:
    burning = clean.telemetry.with_columns({"lamp_power": np.where(clean.telemetry["lamp_power"] > 1.0, 1.0, 0.0)})
    (fault,) = find_faults(burning, SITE)
    assert (fault.kind, fault.quantity) == ("fraction", "lamp_power")


def test_a_sum_of_radiation_names_its_unit(clean: Clean) -> None:
    (fault,) = find_faults(SPOILS["radiation as a sum of the day"].spoilt(clean), SITE)
    assert "by its size in J cm-2" in fault.sentence
    assert fault.remedy is not None
    assert (fault.remedy.amount, fault.remedy.scale) == ("day", 1e4)


def test_in_dull_weeks_the_units_are_still_named_and_none_is_put_in_unasked(clean: Clean) -> None:
    """A fortnight without a clear sky may be W m-2 as well as J cm-2 an hour."""
    table, site = to_grid(clean.telemetry, 900), SITE
    sky = sun.extraterrestrial_radiation(table.time, site.latitude, site.longitude)
    dull = table.with_columns({"global_radiation": 0.25 * sky})
    (fault,) = find_faults(dull, site)
    assert fault.kind == "radiation_unit"
    assert fault.remedy is None
    assert "J cm-2 an hour" in fault.mend
    assert "--accept radiation_unit" in fault.mend
    step = own_step(table.time)
    (fault,) = find_faults(table.with_columns({"global_radiation": 0.25 * sky * step / 1e4}), site)
    assert f"J cm-2 a row ({step / 60:g} min)" in fault.mend


def test_wall_time_read_as_utc_names_the_zone_of_the_site(clean: Clean) -> None:
    (fault,) = find_faults(SPOILS["wall time read as UTC"].spoilt(clean), SITE)
    assert fault.kind == "local_time"
    assert "Europe/Amsterdam" in fault.mend


def test_a_clock_that_jumps_where_clocks_change_is_wall_time() -> None:
    log = virtual_log(40, seed=6, step=900.0)
    spring = Telemetry(log.time + (np.datetime64("2020-03-09") - log.time[0].astype("datetime64[D]")), log.columns)
    # The virtual sun is that of February: the clock is off by its equation of time alone, a few minutes.
    later = spring.time >= np.datetime64("2020-03-29T01:00:00")
    shifted = merge(spring.time + np.where(later, 3600, 0).astype("timedelta64[s]"), spring.columns).telemetry
    kinds = [fault.kind for fault in find_faults(shifted, SITE)]
    assert kinds == ["local_time"]


@pytest.mark.parametrize("latitude", [52.0, -34.5])
def test_a_latitude_on_the_wrong_side_of_the_equator_is_named(clean: Clean, latitude: float) -> None:
    """A minus that is left out, or one too many: noon is right, the days are of another season."""
    site = replace(SITE, latitude=latitude, time_zone="UTC")
    table = clean.telemetry
    winter = np.datetime64("2020-01-05T00:00:00") if latitude > 0.0 else np.datetime64("2020-06-05T00:00:00")
    table = Telemetry(table.time + (winter - table.time[0]), table.columns)
    sky = sun.extraterrestrial_radiation(table.time, site.latitude, site.longitude)
    table = table.with_columns({"global_radiation": 0.6 * sky})
    assert [fault.kind for fault in against_the_sun(table, site)] == []
    (fault,) = against_the_sun(table, replace(site, latitude=-latitude))
    assert fault.kind == "latitude"
    assert f"as long as at latitude {-latitude:g}, but as at {latitude:g}" in str(fault)
    assert f"latitude: {latitude:g} in the site file" in str(fault)


def test_rows_of_two_compartments_under_each_other_contradict_themselves(clean: Clean) -> None:
    table = clean.telemetry
    time = np.concatenate([table.time, table.time])
    columns = {name: np.concatenate([values, values]) for name, values in table.columns.items()}
    columns["air_temperature"][len(table) :] += 2.0
    (fault,) = merge(time, columns).faults
    assert fault.kind == "repeated_times"
    assert "air_temperature differs by 2" in fault.sentence


def test_rows_that_stand_twice_are_said_and_no_fault(clean: Clean) -> None:
    table = clean.telemetry
    merged = merge(np.repeat(table.time, 2), {name: np.repeat(values, 2) for name, values in table.columns.items()})
    assert merged.faults == ()
    assert any("have the time of another row" in note for note in merged.notes)


def test_rows_in_any_order_are_put_in_order(clean: Clean) -> None:
    table = clean.telemetry
    back = merge(table.time[::-1], {name: values[::-1] for name, values in table.columns.items()})
    assert (back.telemetry.time == table.time).all()
    assert any("newest to the oldest" in note for note in back.notes)
    order = np.random.default_rng(0).permutation(len(table))
    mixed = merge(table.time[order], {name: values[order] for name, values in table.columns.items()})
    np.testing.assert_array_equal(mixed.telemetry["air_co2"], table["air_co2"])
    assert any("put in the order of time" in note for note in mixed.notes)


def test_readings_on_few_days_only_are_too_sparse(clean: Clean) -> None:
    air = np.full(len(clean.telemetry), np.nan)
    air[: 2 * 288] = clean.telemetry["air_temperature"][: 2 * 288]
    (fault,) = find_faults(clean.telemetry.with_columns({"air_temperature": air}), SITE)
    assert (fault.kind, fault.quantity) == ("sparse", "air_temperature")


def test_an_accepted_fault_is_a_note(clean: Clean) -> None:
    late = SPOILS["clock 2 h early"].spoilt(clean)
    assert prepare_log(late, SITE).faults
    from igrow.trainer.data.reading import _prepared
    from igrow.trainer.data.source import Source

    log = _prepared(Source("late", late), SITE, accept=("clock", "local_time"))
    assert log.faults == ()
    assert any(note.startswith("accepted although noon comes") for note in log.notes)


def test_no_rate_is_taken_for_a_sum(clean: Clean) -> None:
    for step in (300, 3600):
        table = to_grid(clean.telemetry, step)
        assert all(running_sum(table.time, values) is None for values in table.columns.values())


def test_sums_since_midnight_become_rates(tmp_path: Path, clean: Clean) -> None:
    table = SPOILS["radiation as a sum of the day"].spoilt(clean)
    lines = [f"{time}Z,{value:.3f}" for time, value in zip(table.time, table["global_radiation"], strict=True)]
    (tmp_path / "export.csv").write_text("t,sum\n" + "\n".join(lines) + "\n")
    rule = "{global_radiation: {column: sum, amount: day, scale: 10000}}"
    text = f"time: {{column: t, time_zone: Europe/Amsterdam}}\ncolumns: {rule}\n"
    rates = read(tmp_path / "export.csv", parse(text, ExportMapping)).telemetry["global_radiation"]
    np.testing.assert_allclose(rates[1:], clean.telemetry["global_radiation"][1:], atol=0.1)


def test_real_logs_raise_no_alarm(data_folder: Path) -> None:
    logs = [log for log in real_logs(data_folder) if "from" not in log.name or "28 days" in log.name]
    assert len(logs) > 15
    assert false_alarms(logs) == []


def test_clouds_about_a_change_of_clocks_are_no_jump_of_noon() -> None:
    """Mornings of one week and afternoons of the next were clear: by its radiation noon came .7 h later."""
    place = WeatherClimate(latitude=43.6, longitude=6.0)
    weather = generate_weather(np.datetime64("2020-08-24"), np.datetime64("2020-09-20"), seed=284002, climate=place)
    elsewhere = Site(name="elsewhere", latitude=43.6, longitude=6.0)
    for step in (300, 3600):
        assert against_the_sun(to_grid(weather, step), elsewhere) == []
        late = weather.time >= np.datetime64("2020-09-06T04:00:00")
        time = weather.time + np.where(late, 3600, 0).astype("timedelta64[s]")
        jumped = to_grid(merge(time, weather.columns).telemetry, step)
        assert [fault.kind for fault in against_the_sun(jumped, elsewhere)] == ["local_time"]
