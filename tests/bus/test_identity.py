"""A unit that says who it is: where another one answers nothing is read as its own, and nothing is written."""

from __future__ import annotations

import pytest

from igrow.edge.bus.errors import NoAnswerError, OtherUnitError
from igrow.edge.bus.plc import Reading, RegisterPlc
from igrow.edge.registers.bus_load import estimate
from igrow.edge.registers.loading import parse_register_map
from igrow.edge.sensors import ImageBuilder, SensorRule
from tests.bus.simulated_loop import run
from tests.bus.test_register_plc import FakeBus

IDENTITY = "identity: {function: holding, address: 200, content: [47, 11]}"
MAP = """
title: a PLC with a serial number
source: none
buses:
  net: {transport: tcp, host: 192.0.2.1}
devices:
  plc: {bus: net, device_id: 1, IDENTITY}
  weather: {bus: net, device_id: 2}
points:
  air_temperature: {device: plc, function: holding, address: 0, type: int16, scale: 0.1, unit: degC}
  co2_setpoint: {device: plc, function: holding, address: 20, type: int16, unit: ppm, writable: true, poll: 60 s}
  wind_speed: {device: weather, function: holding, address: 0, type: uint16, unit: m s-1}
"""
POLLED = MAP.replace("scale: 0.1,", "scale: 0.1, poll: 60 s,")
CONTENT = {0: 201, 20: 600, 200: 47, 201: 11}


class Site:
    """A PLC of such a map, and what the image makes of it."""

    def __init__(self, text: str = MAP) -> None:
        register_map = parse_register_map(text.replace("IDENTITY", IDENTITY))
        self.bus, self.now = FakeBus(dict(CONTENT)), 0.0
        self.plc = RegisterPlc(register_map, monotonic=lambda: self.now, buses={"net": self.bus})
        units = {name: point.device for name, point in register_map.points.items()}
        self.builder = ImageBuilder({name: SensorRule(-1e6, 1e6, stale_after=30.0) for name in units}, units=units)
        self.readings: dict[str, Reading] = {}

    def cycle(self, seconds: float = 10.0):
        self.now += seconds
        self.readings = dict(run(self.plc.read()))
        return self.builder.build(self.readings, self.now, None)


def test_a_unit_that_shows_its_identity_is_read() -> None:
    image = Site().cycle()
    assert image.value_of("air_temperature").value == pytest.approx(20.1)
    assert image.reaches("co2_setpoint")


@pytest.mark.parametrize("shows", [{200: 48}, {200: 0, 201: 0}])
def test_of_a_unit_that_shows_another_identity_nothing_is_believed(shows: dict[int, int]) -> None:
    site = Site()
    site.cycle()
    site.bus.content |= {0: 333, **shows}
    for _ in range(3):
        image = site.cycle()
        assert image.value_of("air_temperature").value == pytest.approx(20.1), "what was read of the unit itself"
        assert not image.reaches("co2_setpoint")
        assert image.reaches("wind_speed"), "the other unit says nothing of itself, and is read as before"
        assert "47, 11 in holding 200" in image.why_senseless("co2_setpoint")
    site.bus.content |= CONTENT
    image = site.cycle()
    assert image.reaches("co2_setpoint")


def test_a_unit_that_has_no_such_registers_is_another_one() -> None:
    """It may refuse all that the map asks for: then it is written to still less."""
    site = Site()
    site.cycle()
    site.bus.content = {}
    image = site.cycle()
    assert not image.reaches("co2_setpoint")
    assert isinstance(site.readings["air_temperature"].error, OtherUnitError)


def test_a_unit_that_does_not_say_who_it_is_in_time_is_not_read() -> None:
    site = Site()
    site.cycle()
    usual = site.bus.read

    async def read(request, priority):
        if request.address == 200:
            raise NoAnswerError("no answer")
        return await usual(request, priority)

    site.bus.read = read
    image = site.cycle()
    assert isinstance(site.readings["air_temperature"].error, NoAnswerError)
    assert not image.senseless
    assert not image.reaches("air_temperature")


def test_a_unit_of_which_nothing_is_due_is_asked_all_the_same() -> None:
    """Before what an interlock forces is written there."""
    site = Site(POLLED)
    site.cycle()
    site.bus.content[200] = 48
    assert not site.cycle().reaches("co2_setpoint")


def test_the_question_is_part_of_the_load_of_its_line() -> None:
    with_identity, without = (
        estimate(parse_register_map(text), cycle=5.0)[0].requests_per_second
        for text in (MAP.replace("IDENTITY", IDENTITY), MAP.replace(", IDENTITY", ""))
    )
    assert with_identity == pytest.approx(without + 0.2)
