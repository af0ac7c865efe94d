"""The virtual PLC: steps its plant at the chosen pace, and looks after it when nobody else does."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from igrow.core.errors import IgrowError
from igrow.core.quantities import USUAL_SETPOINTS
from igrow.edge.bus.errors import AddressRefusedError, BusError, NoValueError
from igrow.edge.bus.plc import RegisterPlc
from igrow.edge.bus.protocol import Priority, ReadRequest, WriteRequest
from igrow.edge.registers.loading import load_register_map, parse_register_map
from igrow.edge.registers.model import Function, RegisterMap
from igrow.edge.virtual_plc.pace import Lockstep, Pace, Realtime, parse_pace
from igrow.edge.virtual_plc.virtual_plc import SAFE_SETPOINTS, VirtualPlc
from tests.bus.simulated_loop import run
from tests.virtual_plc.toy_plant import ToyPlant

MAP = load_register_map(Path(__file__).parents[2] / "config" / "register-maps" / "virtual-plc.yaml")
START = 1577836800.0  # 2020-01-01T00:00:00Z


def against(
    pace: Pace, story: Callable[[VirtualPlc, RegisterPlc], Awaitable[None]], registers: RegisterMap = MAP, **more: Any
) -> ToyPlant:
    """Play a story between a virtual PLC and its client, in simulated time."""
    plant = ToyPlant()

    async def main() -> None:
        virtual = VirtualPlc(plant, registers, pace, **more)
        port = await virtual.start("127.0.0.1")
        buses = {name: replace(bus, port=port) for name, bus in registers.buses.items()}
        client = RegisterPlc(replace(registers, buses=buses), monotonic=asyncio.get_running_loop().time)
        client.start()
        try:
            await story(virtual, client)
        finally:
            await client.close()
            await virtual.close()

    run(main())
    return plant


async def value(client: RegisterPlc, name: str) -> float | None:
    return (await client.read([name]))[name].value


def test_in_lockstep_each_new_heartbeat_is_one_interval_of_plant_time() -> None:
    async def story(virtual: VirtualPlc, client: RegisterPlc) -> None:
        for beat in range(1, 11):
            await client.write("heartbeat", beat)
            assert await value(client, "plc_clock") == START + 300 * beat
        await client.write("heartbeat", 10)
        assert await value(client, "plc_clock") == START + 3000

    assert len(against(Lockstep(), story).history) == 10


def test_a_lockstep_run_is_the_same_each_time() -> None:
    async def story(virtual: VirtualPlc, client: RegisterPlc) -> None:
        for beat in range(1, 50):
            await client.write("heating_setpoint", 15.0 + beat % 7)
            await client.write("heartbeat", beat)

    assert against(Lockstep(), story).history == against(Lockstep(), story).history


def test_every_point_is_read_in_two_requests() -> None:
    async def story(virtual: VirtualPlc, client: RegisterPlc) -> None:
        asked: list[tuple[Function, int]] = []
        read = virtual.memory.read

        def recording(function: Function, address: int, count: int) -> list[int]:
            asked.append((function, count))
            return read(function, address, count)

        virtual.memory.read = recording
        readings = await client.read()
        assert set(readings) == set(MAP.points)
        assert len(asked) == 2

    against(Lockstep(), story)


def test_measurements_come_in_their_units_and_missing_ones_as_no_value() -> None:
    async def story(virtual: VirtualPlc, client: RegisterPlc) -> None:
        readings = await client.read()
        assert readings["air_temperature"].value == pytest.approx(15.0)
        assert readings["vent_lee"].value == pytest.approx(33.3)
        assert readings["rail_pipe_temperature"].value == pytest.approx(327.67)  # the end of the register's scale
        for name in ("air_co2", "vent_wind"):
            assert isinstance(readings[name].error, NoValueError)

    against(Lockstep(), story)


def test_the_plant_obeys_the_setpoints_that_were_written() -> None:
    async def story(virtual: VirtualPlc, client: RegisterPlc) -> None:
        for name, setpoint in zip(USUAL_SETPOINTS, (21.5, 800.0, 1.0, 0.5), strict=True):
            await client.write(name, setpoint)
        await client.write("heartbeat", 1)

    assert against(Lockstep(), story).history == [
        {"heating_setpoint": 21.5, "co2_setpoint": 800.0, "lamp_on": 1.0, "irrigation_on": 0.5}
    ]


def test_before_the_first_heartbeat_the_plant_runs_on_safe_setpoints_whatever_was_written() -> None:
    async def story(virtual: VirtualPlc, client: RegisterPlc) -> None:
        await client.write("heating_setpoint", 34.0)
        await asyncio.sleep(60.0)
        assert await value(client, "plc_fallback") == 1.0

    plant = against(Realtime(), story)
    assert len(plant.history) > 10
    safe = {name: SAFE_SETPOINTS[name] for name in USUAL_SETPOINTS}
    assert all(setpoints == pytest.approx(safe) for setpoints in plant.history)


def test_a_heartbeat_that_stops_makes_the_plc_fall_back_and_a_new_one_ends_it() -> None:
    async def story(virtual: VirtualPlc, client: RegisterPlc) -> None:
        for beat in range(1, 20):
            await client.write("heating_setpoint", 25.0)
            await client.write("heartbeat", beat)
            await asyncio.sleep(60)
        assert await value(client, "plc_fallback") == 0.0
        assert await value(client, "heating_setpoint") == 25.0
        await asyncio.sleep(850 - 60)
        assert await value(client, "plc_fallback") == 0.0
        await asyncio.sleep(100)
        assert await value(client, "plc_fallback") == 1.0
        assert await value(client, "heating_setpoint") == SAFE_SETPOINTS["heating_setpoint"]
        await client.write("heating_setpoint", 22.0)
        await client.write("heartbeat", 77)
        assert await value(client, "plc_fallback") == 0.0
        await asyncio.sleep(60)
        assert virtual.plant.history[-1]["heating_setpoint"] == 22.0  # type: ignore[attr-defined]

    against(Realtime(), story, fallback_after=900.0)


def test_in_real_time_the_plants_clock_goes_with_the_wall_clock() -> None:
    plant = against(Realtime(), lambda virtual, client: asyncio.sleep(3600.5))
    assert plant.time == np.datetime64("2020-01-01T01:00:00")


def test_at_speed_60_an_hour_takes_a_minute() -> None:
    plant = against(Realtime(60.0), lambda virtual, client: asyncio.sleep(60.05))
    assert plant.time == np.datetime64("2020-01-01T01:00:00")


def test_a_setpoint_changed_by_hand_shows_and_counts() -> None:
    async def story(virtual: VirtualPlc, client: RegisterPlc) -> None:
        await client.write("heating_setpoint", 20.0)
        virtual.set_by_hand("heating_setpoint", 19.0)
        assert await value(client, "heating_setpoint") == 19.0
        await client.write("heartbeat", 1)

    assert against(Lockstep(), story).history[0]["heating_setpoint"] == 19.0


def test_what_the_map_does_not_let_be_written_is_refused() -> None:
    async def story(virtual: VirtualPlc, client: RegisterPlc) -> None:
        bus = client.buses["greenhouse_network"]
        for request in (
            WriteRequest(1, Function.HOLDING, 11, (1,)),
            WriteRequest(1, Function.HOLDING, 10, (1, 2)),
            WriteRequest(1, Function.COIL, 0, (1,)),
        ):
            with pytest.raises(AddressRefusedError):
                await bus.write(request, Priority.WRITE)
        with pytest.raises(AddressRefusedError):
            await bus.read(ReadRequest(1, Function.INPUT, 40, 20), Priority.LOG)

    against(Lockstep(), story)


def test_a_client_that_was_hung_up_on_finds_back() -> None:
    async def story(virtual: VirtualPlc, client: RegisterPlc) -> None:
        await client.write("heartbeat", 1)
        virtual.drop_connections()
        await asyncio.sleep(0.01)
        for _ in range(10):
            try:
                await client.write("heartbeat", 2)
                break
            except BusError:
                await asyncio.sleep(0.5)
        assert await value(client, "plc_clock") == START + 600

    against(Lockstep(), story)


@pytest.mark.parametrize(
    ("text", "pace"),
    [
        ("realtime", Realtime()),
        ("speed=60", Realtime(60.0)),
        ("lockstep", Lockstep()),
        ("lockstep=60", Lockstep(60.0)),
    ],
)
def test_a_pace_is_read(text: str, pace: Pace) -> None:
    assert parse_pace(text) == pace


@pytest.mark.parametrize("text", ["", "fast", "speed", "speed=0", "speed=-1", "speed=x", "lockstep=inf", "realtime=2"])
def test_a_wrong_pace_is_told_what_is_right(text: str) -> None:
    with pytest.raises(IgrowError, match="realtime, speed=N"):
        parse_pace(text)


def test_a_plc_of_one_coil_is_served_like_any_other() -> None:
    coil = parse_register_map(
        "title: a relay\nsource: this test\nbuses: {line: {transport: tcp, host: 127.0.0.1, port: 5020}}\n"
        "devices: {relay: {bus: line, device_id: 1}}\n"
        'points:\n  lamp_on: {device: relay, function: coil, address: 0, type: bool, unit: "1", writable: true}\n'
        '  rain: {device: relay, function: input, address: 0, type: bit, bit: 3, unit: "1"}\n'
    )
    virtual = VirtualPlc(ToyPlant(), coil, Realtime(1.0))
    assert virtual.memory.value("lamp_on") == 0.0


def test_a_register_of_the_humidity_setpoint_is_obeyed_and_falls_back_to_the_computers_own() -> None:
    path = Path(__file__).parents[2] / "config" / "register-maps" / "virtual-plc.yaml"
    damp = parse_register_map(path.read_text().replace("  # humidity_setpoint:   {", "  humidity_setpoint: {"))

    async def story(virtual: VirtualPlc, client: RegisterPlc) -> None:
        assert await value(client, "humidity_setpoint") == SAFE_SETPOINTS["humidity_setpoint"] == 86.0
        await client.write("humidity_setpoint", 78.0)
        await client.write("heartbeat", 1)

    assert against(Lockstep(), story, damp).history[-1]["humidity_setpoint"] == 78.0
