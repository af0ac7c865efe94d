"""Values by name: what the control cycle gets, whatever the devices do."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from typing import Any

import pytest

from igrow.edge.bus.errors import (
    AddressRefusedError,
    BusError,
    NoAnswerError,
    NoValueError,
    UnknownPointError,
    ValueDoesNotFitError,
)
from igrow.edge.bus.plc import RegisterPlc
from igrow.edge.bus.protocol import Bus, Priority, ReadRequest, WriteRequest
from igrow.edge.registers.loading import parse_register_map
from igrow.edge.registers.model import Function
from tests.bus.simulated_loop import run

MAP = """
title: a small site
source: none
buses:
  net: {transport: tcp, host: 192.0.2.1}
  roof: {transport: tcp, host: 192.0.2.2}
devices:
  plc: {bus: net, device_id: 1}
  weather: {bus: roof, device_id: 7}
points:
  air_temperature: {device: plc, function: holding, address: 0, type: int16, scale: 0.1, no_value: -32768, unit: degC}
  air_humidity: {device: plc, function: holding, address: 2, type: uint16, unit: "%"}
  air_co2: {device: plc, function: holding, address: 5, type: uint16, unit: ppm, poll: 60 s}
  leaf_area_index: {device: plc, function: holding, address: 100, type: uint16, unit: m2 m-2}
  heating_setpoint:
    {device: plc, function: holding, address: 20, type: int16, scale: 0.1, unit: degC, writable: true}
  heartbeat: {device: plc, function: holding, address: 30, type: uint16, unit: "1", writable: true}
  wind_speed: {device: weather, function: input, address: 0, type: uint16, unit: m s-1}
"""


class FakeBus:
    """A Bus that answers from a dictionary and refuses what is not in it."""

    def __init__(self, content: dict[int, int]) -> None:
        self.content = content
        self.requests: list[tuple[Priority, int, int]] = []
        self.written: list[tuple[Priority, WriteRequest]] = []
        self.error: BusError | None = None
        self.connected = True

    def start(self) -> None:
        pass

    def last_orders(self) -> None:
        pass

    async def close(self) -> None:
        pass

    async def read(self, request: ReadRequest, priority: Priority) -> tuple[int, ...]:
        self.requests.append((priority, request.address, request.count))
        if self.error is not None:
            raise self.error
        addresses = range(request.address, request.address + request.count)
        if not set(addresses) <= set(self.content):
            raise AddressRefusedError("refused", 2)
        return tuple(self.content[address] for address in addresses)

    async def write(self, request: WriteRequest, priority: Priority) -> None:
        self.written.append((priority, request))


class Clock:
    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def make(content: Sequence[int] = range(200), text: str = MAP) -> tuple[RegisterPlc, FakeBus, FakeBus, Clock]:
    net, roof = FakeBus({address: address for address in content}), FakeBus({0: 4})
    clock = Clock()
    return RegisterPlc(parse_register_map(text), monotonic=clock, buses={"net": net, "roof": roof}), net, roof, clock


def values(plc: RegisterPlc, names: Any = None) -> dict[str, float | None]:
    return {name: reading.value for name, reading in run(plc.read(names)).items()}


def test_all_points_are_read_in_few_requests_control_before_log() -> None:
    plc, net, _, _ = make()
    assert values(plc) == {
        "air_temperature": 0.0,
        "air_humidity": 2.0,
        "air_co2": 5.0,
        "leaf_area_index": 100.0,
        "heating_setpoint": pytest.approx(2.0),
        "heartbeat": 30.0,
        "wind_speed": 4.0,
    }
    assert net.requests == [
        (Priority.CONTROL, 0, 6),
        (Priority.CONTROL, 20, 1),
        (Priority.CONTROL, 30, 1),
        (Priority.LOG, 100, 1),
    ]


def test_a_point_with_a_poll_period_is_read_when_it_is_due() -> None:
    plc, _, _, clock = make()
    assert "air_co2" in values(plc)
    clock.now = 56.9
    assert "air_co2" not in values(plc)
    assert "air_co2" in values(plc, ["air_co2"])
    clock.now = 59.9
    assert "air_co2" in values(plc)


def test_a_block_with_an_unreadable_gap_is_split_once_and_for_good() -> None:
    plc, net, _, _ = make([a for a in range(200) if a not in (1, 3, 4)])
    assert values(plc, ["air_temperature", "air_humidity", "air_co2"]) == {
        "air_temperature": 0.0,
        "air_humidity": 2.0,
        "air_co2": 5.0,
    }
    net.requests.clear()
    values(plc, ["air_temperature", "air_humidity", "air_co2"])
    assert [(address, count) for _, address, count in net.requests] == [(0, 1), (2, 1), (5, 1)]


def test_an_address_that_does_not_exist_fails_alone_and_is_tried_again_soon_and_then_ever_more_rarely() -> None:
    plc, net, _, clock = make([a for a in range(200) if a != 2])
    begin, asked = clock.now, []
    for second in range(3000):
        clock.now = begin + second
        net.requests.clear()
        readings = run(plc.read(["air_temperature", "air_humidity"]))
        assert readings["air_temperature"].value == 0.0
        assert isinstance(readings["air_humidity"].error, AddressRefusedError)
        if any(address == 2 for _, address, _ in net.requests):
            asked.append(second)
    assert asked == [0, 10, 30, 70, 150, 310, 630, 1230, 1830, 2430]
    net.content[2] = 80
    clock.now = begin + 3030
    assert values(plc, ["air_temperature", "air_humidity"]) == {"air_temperature": 0.0, "air_humidity": 80.0}


def test_an_address_that_a_plc_refuses_while_it_starts_is_back_within_seconds() -> None:
    plc, net, _, clock = make([a for a in range(200) if a != 2])
    for _ in range(2):
        run(plc.read(["air_humidity"]))
        net.content[2] = 80
        clock.now += 10.0
        assert values(plc, ["air_humidity"]) == {"air_humidity": 80.0}
        del net.content[2]


def test_one_bus_that_fails_leaves_the_other_ones_values() -> None:
    plc, net, _, _ = make()
    net.error = NoAnswerError("silent")
    readings = run(plc.read(["air_temperature", "wind_speed"]))
    assert readings["air_temperature"].value is None
    assert readings["air_temperature"].error is net.error
    assert readings["wind_speed"].value == 4.0


def test_a_device_that_has_no_value_says_so() -> None:
    plc, net, _, _ = make()
    net.content[0] = 0x8000
    reading = run(plc.read(["air_temperature"]))["air_temperature"]
    assert reading.value is None
    assert isinstance(reading.error, NoValueError)


def test_a_name_that_the_map_does_not_have_costs_the_others_nothing() -> None:
    plc, _, _, _ = make()
    readings = run(plc.read(["air_temperature", "sky_temperature"]))
    assert readings["air_temperature"].value == 0.0
    assert isinstance(readings["sky_temperature"].error, UnknownPointError)


def test_a_write_is_encoded_and_goes_before_reads_and_the_heartbeat_after_writes() -> None:
    plc, net, _, _ = make()
    run(plc.write("heating_setpoint", 21.5))
    run(plc.write("heartbeat", 3.0))
    assert net.written == [
        (Priority.WRITE, WriteRequest(1, Function.HOLDING, 20, (215,))),
        (Priority.HEARTBEAT, WriteRequest(1, Function.HOLDING, 30, (3,))),
    ]


@pytest.mark.parametrize(
    ("name", "value", "error"),
    [
        ("heating_setpoint", 1e9, ValueDoesNotFitError),
        ("heating_setpoint", float("nan"), ValueDoesNotFitError),
        ("air_temperature", 20.0, UnknownPointError),
        ("lamp_on", 1.0, UnknownPointError),
    ],
)
def test_what_cannot_be_written_is_refused_and_nothing_is_sent(name: str, value: float, error: type[BusError]) -> None:
    plc, net, _, _ = make()
    with pytest.raises(error) as caught:
        run(plc.write(name, value))
    assert not caught.value.sent
    assert net.written == []


def test_two_buses_are_read_at_the_same_time() -> None:
    class SlowBus(FakeBus):
        async def read(self, request: ReadRequest, priority: Priority) -> tuple[int, ...]:
            await asyncio.sleep(1.0)
            return await super().read(request, priority)

    async def main() -> float:
        loop = asyncio.get_running_loop()
        buses: dict[str, Bus] = {"net": SlowBus({0: 0}), "roof": SlowBus({0: 0})}
        plc = RegisterPlc(parse_register_map(MAP), monotonic=loop.time, buses=buses)
        begin = loop.time()
        await plc.read(["air_temperature", "wind_speed"])
        return loop.time() - begin

    assert run(main()) == pytest.approx(1.0)
