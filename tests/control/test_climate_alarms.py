"""Too cold, too hot, too damp: the site's own thresholds, for how long, and what a bad sensor does not do."""

from __future__ import annotations

import datetime

import pytest

from igrow.core.site import Crop
from igrow.core.yaml_schema import SettingError
from igrow.edge.alarm_levels import Level, usual_level
from igrow.edge.climate_alarms import ClimateAlarm, ClimateAlarms, usual_climate_alarms
from igrow.edge.image import Image, Quality, Value

COLD = ClimateAlarm("too_cold", "air_temperature", None, 13.0, datetime.timedelta(minutes=15), 0.5, Level.CRITICAL)


class Board:
    def __init__(self):
        self.texts = {}
        self.levels = {}

    def __call__(self, name, text, level):
        self.texts[name], self.levels[name] = text, level


def image(seconds, value, quality=Quality.GOOD):
    return Image(seconds, None, {"air_temperature": Value(value, quality, 0.0)})


def test_it_comes_once_it_has_lasted_and_goes_when_the_value_is_well_back():
    alarms, board = ClimateAlarms([COLD]), Board()
    alarms.tick(image(0.0, 12.9), board)
    assert board.texts == {}
    alarms.tick(image(899.0, 12.9), board)
    assert board.texts == {}
    alarms.tick(image(900.0, 12.0), board)
    assert board.texts["climate too_cold"] == "too cold: air_temperature for 15 min below 13 degC, now 12 degC"
    assert board.levels["climate too_cold"] is Level.CRITICAL
    alarms.tick(image(910.0, 13.2), board)
    assert board.texts["climate too_cold"]
    alarms.tick(image(920.0, 13.5), board)
    assert board.texts["climate too_cold"] == ""


def test_a_short_dip_is_no_alarm_and_the_time_begins_anew():
    alarms, board = ClimateAlarms([COLD]), Board()
    for seconds, value in ((0.0, 12.0), (600.0, 13.1), (700.0, 12.0), (1500.0, 12.0)):
        alarms.tick(image(seconds, value), board)
    assert board.texts["climate too_cold"] == ""


@pytest.mark.parametrize("quality", [Quality.MISSING, Quality.FROZEN, Quality.OUT_OF_RANGE])
def test_a_value_that_cannot_be_believed_neither_raises_nor_ends_an_alarm(quality):
    alarms, board = ClimateAlarms([COLD]), Board()
    alarms.tick(image(0.0, -20.0, quality), board)
    alarms.tick(image(1000.0, -20.0, quality), board)
    assert board.texts == {}
    alarms.tick(image(2000.0, 12.0), board)
    alarms.tick(image(2900.0, 12.0), board)
    alarms.tick(image(3000.0, 20.0, quality), board)
    assert board.texts["climate too_cold"]


def test_the_usual_alarms_are_those_of_the_sites_crop():
    found = {one.name: one for one in usual_climate_alarms(Crop(temperature_low=10.0, humidity_high=88.0))}
    assert found["too_cold"].below == 10.0
    assert found["too_damp"].above == 88.0
    assert found["too_damp"].lasting == datetime.timedelta(hours=3)


@pytest.mark.parametrize("bounds", [{}, {"above": 1.0, "below": 2.0}])
def test_a_threshold_has_one_side(bounds):
    with pytest.raises(SettingError):
        ClimateAlarm("x", "air_temperature", **bounds)


def test_a_silent_plc_is_critical_and_an_exchange_that_is_away_is_not():
    assert usual_level("link") is Level.CRITICAL
    assert usual_level("write heating_setpoint") is Level.CRITICAL
    assert usual_level("sensor air_co2") is Level.WARNING
    assert usual_level("service exchange") is Level.NOTICE
