"""Readers of the two greenhouse challenges, on the traps of their files and on the files themselves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from igrow.core import sun
from igrow.core.errors import IgrowError
from igrow.trainer.data.open_source import open_source
from igrow.trainer.data.public import traps
from igrow.trainer.data.source import Source

HEADER = (
    "%time,AssimLight,BlackScr,CO2air,EnScr,PipeGrow,PipeLow,Rhair,Tair,VentLee,Ventwind,co2_dos,"
    "int_red_vip,t_heat_vip,co2_vip,assim_vip,Cum_irr,water_sup"
)


def small_challenge(folder: Path, rows: list[str]) -> Path:
    """A folder laid out as the 2019 challenge's; 43891.5 is 2020-03-01 12:00 wall time."""
    (folder / "Weather").mkdir(parents=True)
    (folder / "Ours").mkdir()
    weather = ["%time ,Iglob,Pyrgeo,Rain,Rhout,Tout,Winddir,Windsp"]
    weather += [f"{43891.5 + k / 288:.5f},100,-50,0,80,8.0,4,3" for k in range(len(rows))]
    (folder / "Weather" / "Weather.csv").write_text("\n".join(weather))
    lines = [HEADER] + [f"{43891.5 + k / 288:.5f},{row}" for k, row in enumerate(rows)]
    (folder / "Ours" / "GreenhouseClimate.csv").write_text("\n".join(lines))
    return folder


ROW = " 100, 0, 600, 100, 0.0, 40.0, 80.0, 20.0, 5, 0, 0.002, 1000, 19.0, 700, 100, 1.0, 5"


def test_wall_time_becomes_utc(tmp_path: Path) -> None:
    log = open_source(small_challenge(tmp_path / "set", [ROW] * 3))
    assert log.telemetry.time[0] == np.datetime64("2020-03-01T11:00:00")


def test_lamps_are_the_sum_of_sodium_and_led_and_leds_off_may_be_empty(tmp_path: Path) -> None:
    off = ROW.replace("1000, 19.0", "NaN, 19.0").replace(" 100, 0,", " 0, 0,", 1)
    log = open_source(small_challenge(tmp_path / "set", [ROW, off]))
    np.testing.assert_allclose(log.telemetry["lamp_power"], [81.0 + 25.3, 0.0])


def test_a_pipe_that_reads_zero_is_off_and_cools_down(tmp_path: Path) -> None:
    rows = [ROW] + [ROW.replace("40.0, 80.0", "0.0, 80.0")] * 18
    pipe = open_source(small_challenge(tmp_path / "set", rows)).telemetry["rail_pipe_temperature"]
    assert pipe[0] == 40.0
    assert (np.diff(pipe) < 0.0).all()
    assert pipe[-1] == pytest.approx(20.0 + 20.0 / np.e, abs=0.3)


def test_rows_without_measurements_are_dropped_though_computed_columns_go_on(tmp_path: Path) -> None:
    empty = "NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN,0.004,NaN,NaN,NaN,NaN,NaN,NaN"
    log = open_source(small_challenge(tmp_path / "set", [ROW, empty, ROW]))
    assert len(log.telemetry) == 2
    assert log.telemetry["co2_dosing"].max() == pytest.approx(0.002)


def test_spikes_are_taken_out_and_steps_are_kept() -> None:
    steady = np.full(40, 20.0)
    spiked = steady.copy()
    spiked[[10, 25, 26]] = [-1.0, 0.5, -20.0]
    cleaned = traps.without_spikes("air_temperature", spiked)
    assert np.flatnonzero(np.isnan(cleaned)).tolist() == [10, 25, 26]
    step = np.where(np.arange(40) < 20, 450.0, 900.0)
    assert np.isfinite(traps.without_spikes("air_co2", step)).all()


def test_a_compartment_must_be_named_where_there_are_several(tmp_path: Path) -> None:
    folder = small_challenge(tmp_path / "set", [ROW])
    (folder / "Theirs").mkdir()
    (folder / "Theirs" / "GreenhouseClimate.csv").write_text(HEADER + f"\n43891.5,{ROW}")
    with pytest.raises(IgrowError, match="name a compartment: Ours, Theirs"):
        open_source(folder)
    with pytest.raises(IgrowError, match="those that have: Ours, Theirs"):
        open_source(folder, "Nobody")
    assert len(open_source(folder, "ours").telemetry) == 1
    assert open_source(folder / "Theirs").name == "agc2019 Theirs"


def test_a_place_that_is_not_there_is_said_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(IgrowError, match="no such file or folder"):
        open_source(tmp_path / "nothing")


@pytest.fixture(scope="module")
def reference(data_folder: Path) -> Source:
    return open_source(data_folder / "agc2019")


def test_the_season_of_2019_is_read_whole_and_in_its_units(reference: Source) -> None:
    table = reference.telemetry
    assert len(table) == 39_386
    assert np.nanmin(table["air_co2"]) > 282.0
    assert np.nanmin(table["air_temperature"]) > 5.0
    assert "par" not in table, "the publisher's PAR is computed, not measured"
    dosed = np.nansum(table["co2_dosing"]) / 12.0
    assert reference.resources is not None
    before_may = reference.resources.day < np.datetime64("2020-05-01")
    assert dosed == pytest.approx(reference.resources["co2"][before_may].sum(), rel=0.02)


@pytest.mark.parametrize("data_set", ["agc2019", "agc2018"])
def test_the_sun_stands_highest_at_noon_in_every_month(data_folder: Path, data_set: str) -> None:
    table = open_source(data_folder / data_set, "Reference").telemetry
    hour = sun.solar_hour(table.time + np.timedelta64(150, "s"), 52.03, 4.53)
    radiation = np.nan_to_num(table["global_radiation"])
    month = table.time.astype("datetime64[M]")
    for one in np.unique(month)[:-1]:
        rows = month == one
        assert np.average(hour[rows], weights=radiation[rows] + 1e-9) == pytest.approx(12.0, abs=0.25), one


def test_the_first_harvest_of_the_reference_is_moved_to_its_year(reference: Source) -> None:
    assert reference.harvests is not None
    assert reference.harvests.day[0] == np.datetime64("2020-02-14")
    assert any("year too early" in note for note in reference.notes)


def test_the_cucumbers_of_2018_have_no_dose_and_say_so(data_folder: Path) -> None:
    log = open_source(data_folder / "agc2018", "AiCU")
    assert "co2_dosing" not in log.telemetry
    assert any("CO2 dosing" in note for note in log.notes)
    assert log.site is not None
    assert log.site.crop.species == "cucumber"
    assert log.site.crop.dry_matter_fraction < 0.05, "a cucumber holds three times the water of a tomato"
    assert log.site.crop.days_to_harvest < 21
    assert log.resources is not None
    assert np.nansum(log.resources["co2"]) == pytest.approx(9.9, abs=0.1)
    assert log.harvests is not None
    total = np.nansum(log.harvests["class_a"]) + np.nansum(log.harvests["class_b"])
    assert total == pytest.approx(37.3, abs=0.5)
