"""The experiments on a season: greenhouses with logs, greenhouses in the simulator, and what growers had."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.figure_4_ways import DAYS, HEATING, LAMPS, champion, growers, simulator_of
from benchmarks.logged_greenhouses import LATER, STEP, LoggedGreenhouses
from benchmarks.season_greenhouses import BEFORE, DAY, START
from benchmarks.seasons import described
from benchmarks.simulated_greenhouses import SimulatedGreenhouses
from igrow.core.greenhouse import recipe_by_hour
from igrow.core.quantities import SETPOINTS
from igrow.core.sun import unix_seconds
from tests import needs


def test_copies_of_a_greenhouse_are_disturbed_alike_and_log_what_their_sensors_show() -> None:
    greenhouses = LoggedGreenhouses(1, [0, 1, 0, 1])
    begin = START - BEFORE * DAY
    setpoints = np.repeat(recipe_by_hour(begin, 24, described("today", 30).longitude)[None], 4, axis=0)
    greenhouses.advance(setpoints[:, :2], begin)
    air = greenhouses.measured()["air_temperature"]
    # Copies read sensors of their own, whose noise the climate computer follows.
    assert abs(air[0] - air[2]) < 0.3 * abs(air[0] - air[1])
    disturbance = np.array(greenhouses.plant.state.disturbance)
    np.testing.assert_array_equal(disturbance[:, :2], disturbance[:, 2:])
    assert (disturbance[:, 0] != disturbance[:, 1]).all()
    log = greenhouses.telemetry(2, -BEFORE, -BEFORE + 1)
    assert len(log) == 2 * 3600 // STEP
    assert log.time[0] == begin + np.timedelta64(STEP, "s")
    assert np.abs(log["air_temperature"][-1] - air[2]) < 1.0
    np.testing.assert_allclose(log["heating_setpoint"][-1], setpoints[2, 1, HEATING], atol=1e-9)


def test_the_second_effect_of_a_greenhouse_begins_later() -> None:
    greenhouses = LoggedGreenhouses(1, [0])
    assert greenhouses.plant.effects is not None
    stands, begins = greenhouses.hidden[0]
    starts = {entry.effect.name: float(np.ravel(entry.start)[0]) for entry in greenhouses.plant.effects._entries}
    assert starts == {
        stands: float(unix_seconds(START - BEFORE * DAY)),
        begins: float(unix_seconds(START + LATER * DAY)),
    }


def test_a_simulated_greenhouse_goes_on_where_it_ended_and_its_crop_is_picked() -> None:
    site = described("today", 30)
    greenhouses = SimulatedGreenhouses(site, simulator_of(site), 4, [0, 0, 1])
    setpoints = np.repeat(recipe_by_hour(START, 24, site.longitude)[None], 3, axis=0)
    picked = []
    for day in range(3):
        outcome = greenhouses.advance(setpoints, START + day * DAY)
        assert outcome.heat.shape == (1, 3, 24)
        np.testing.assert_array_equal(greenhouses.measured()["air_temperature"], outcome.air_temperature[0, :, -1])
        picked.append(outcome.fruit_fresh_weight[0].sum(axis=-1))
    total = np.sum(picked, axis=0)
    assert total[0] == total[1] != total[2]
    # A mature crop gives about half a kilogram a week.
    assert 0.1 < total[0] < 0.6


def test_what_growers_had_covers_the_season_and_the_champion_heats_less() -> None:
    folder = needs.data_sets() / "agc2019"
    theirs, his = growers(folder), champion(folder)
    assert theirs.shape == his.shape == (DAYS, 24, len(SETPOINTS))
    assert set(np.unique(theirs[:, :, LAMPS])) == {0.0, 1.0}
    shift = (his - theirs)[:, :, HEATING]
    assert (shift == shift[:, :1]).all()
    assert shift.mean() == pytest.approx(-1.46, abs=0.02)
    np.testing.assert_array_equal(theirs[:, :, LAMPS], his[:, :, LAMPS])
    # By day it is warmer than by night: days are local ones.
    assert theirs[:, 10:16, HEATING].mean() > theirs[:, 20:, HEATING].mean() + 2.0
