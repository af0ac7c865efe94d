"""Against Modbus software that nobody here wrote. `tests/peers/install.sh` installs it."""

from __future__ import annotations

import asyncio
import contextlib
import re
import socket
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path

import pytest

from igrow.edge.bus.errors import AddressRefusedError, BadAnswerError, BusError, NoAnswerError, UnitBusyError
from igrow.edge.bus.modbus_bus import ModbusBus
from igrow.edge.bus.plc import RegisterPlc
from igrow.edge.bus.protocol import Priority, ReadRequest, WriteRequest
from igrow.edge.registers.loading import load_register_map, parse_register_map
from igrow.edge.registers.model import BusSettings, Function, Parity, Transport
from igrow.edge.virtual_plc.pace import Lockstep
from igrow.edge.virtual_plc.virtual_plc import VirtualPlc
from tests import needs
from tests.patience import PATIENCE
from tests.virtual_plc.toy_plant import ToyPlant

HERE = Path(__file__).parent
MAP = load_register_map(HERE.parents[1] / "config" / "register-maps" / "virtual-plc.yaml")
LIBMODBUS = HERE / "build" / "unit-test-server"
INSTALL = "tests/peers/install.sh"


def node_package(name: str) -> None:
    needs.program("node", INSTALL)
    needs.file(HERE / "node_modules" / name, INSTALL)


def libmodbus() -> None:
    needs.file(LIBMODBUS, INSTALL)


def free_port() -> int:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        return int(taken.getsockname()[1])


@contextlib.asynccontextmanager
async def running(*command: str, ready: str = "") -> AsyncIterator[None]:
    """Run a peer; wait for the line `ready` on its output, if given. Its own output is not of interest."""
    process = await asyncio.create_subprocess_exec(
        *command, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT, cwd=HERE
    )
    assert process.stdout is not None
    try:
        async with asyncio.timeout(PATIENCE):
            while ready:
                line = (await process.stdout.readline()).decode()
                assert line, f"{command[0]} ended before it was ready"
                if ready in line:
                    break
        drain = asyncio.ensure_future(process.stdout.read())
        yield
        drain.cancel()
    finally:
        with contextlib.suppress(ProcessLookupError):
            process.kill()
        await process.wait()


@contextlib.asynccontextmanager
async def serial_pair(folder: Path) -> AsyncIterator[tuple[str, str]]:
    needs.program("socat", INSTALL)
    ends = folder / "a", folder / "b"
    async with running("socat", *(f"pty,rawer,link={end}" for end in ends)):
        async with asyncio.timeout(PATIENCE):
            while not all(end.exists() for end in ends):  # noqa: ASYNC110 - a file, of which no event tells
                await asyncio.sleep(0.02)
        yield str(ends[0]), str(ends[1])


@contextlib.asynccontextmanager
async def opened(settings: BusSettings) -> AsyncIterator[ModbusBus]:
    bus = ModbusBus(settings, rest_step=0.0, first_wait=0.05)
    bus.start()
    try:
        async with asyncio.timeout(PATIENCE):
            while not bus.connected:  # noqa: ASYNC110 - the bus connects in the background
                await asyncio.sleep(0.05)
        yield bus
    finally:
        await bus.close()


def tcp(port: int, timeout: float = 1.0) -> BusSettings:
    return BusSettings("peer", Transport.TCP, host="127.0.0.1", port=port, timeout=timeout)


def rtu(port: str, timeout: float = 1.0) -> BusSettings:
    return BusSettings("peer", Transport.RTU, serial_port=port, parity=Parity.NONE, timeout=timeout, gap=0.01)


async def run_tool(*command: str) -> str:
    process = await asyncio.create_subprocess_exec(
        *command, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT
    )
    output, _ = await asyncio.wait_for(process.communicate(), PATIENCE)
    assert process.returncode == 0, output.decode()
    return output.decode()


def values_of(output: str) -> list[float]:
    return [float(value) for value in re.findall(r"^\[\d+\]:\s+(\S+)", output, re.MULTILINE)]


async def answers_again(bus: ModbusBus, request: ReadRequest, expected: tuple[int, ...]) -> None:
    """Ask until there is an answer, which must be the right one."""
    for _ in range(40):
        with contextlib.suppress(BusError):
            assert await bus.read(request, Priority.CONTROL) == expected
            return
        await asyncio.sleep(0.1)
    pytest.fail("the unit never answered again")


# mbpoll, a client, against the virtual PLC


async def test_mbpoll_reads_and_writes_the_virtual_plc_over_tcp() -> None:
    needs.program("mbpoll", INSTALL)
    plant = ToyPlant()
    virtual = VirtualPlc(plant, MAP, Lockstep())
    port = await virtual.start()
    mbpoll = ("mbpoll", "-m", "tcp", "-p", str(port), "-a", "1", "-0", "-1", "-B")
    temperature = MAP.points["air_temperature"].address
    try:
        inputs = await run_tool(*mbpoll, "-t", "3:float", "-r", str(temperature), "-c", "2", "127.0.0.1")
        assert values_of(inputs) == pytest.approx([15.0, 80.0])
        await run_tool(*mbpoll, "-t", "4:float", "-r", "0", "127.0.0.1", "21.5", "800")
        assert values_of(await run_tool(*mbpoll, "-t", "4:float", "-r", "0", "-c", "2", "127.0.0.1")) == [21.5, 800.0]
        await run_tool(*mbpoll, "-t", "4", "-r", str(MAP.points["heartbeat"].address), "127.0.0.1", "7")
        assert plant.history[0]["heating_setpoint"] == 21.5
        assert plant.history[0]["co2_setpoint"] == 800.0
    finally:
        await virtual.close()


async def test_mbpoll_reads_and_writes_the_virtual_plc_over_a_serial_line(tmp_path: Path) -> None:
    needs.program("mbpoll", INSTALL)
    async with serial_pair(tmp_path) as (ours, theirs):
        virtual = VirtualPlc(ToyPlant(), MAP, Lockstep())
        await virtual.start_serial(ours, parity=Parity.NONE)
        mbpoll = ("mbpoll", "-m", "rtu", "-b", "19200", "-P", "none", "-a", "1", "-0", "-1", "-B")
        try:
            await run_tool(*mbpoll, "-t", "4:float", "-r", "0", theirs, "19.25")
            assert values_of(await run_tool(*mbpoll, "-t", "4:float", "-r", "0", "-c", "1", theirs)) == [19.25]
        finally:
            await virtual.close()


# libmodbus' unit-test-server: unit 17; 0x160 holds 3 registers, 0x170 is busy, 0x171 answers as somebody else,
# 0x172 answers after 0.5 s, 0x173 byte by byte; two registers at once are answered with one.


@contextlib.asynccontextmanager
async def libmodbus_bus(transport: Transport, folder: Path) -> AsyncIterator[ModbusBus]:
    libmodbus()
    if transport is Transport.TCP:
        port = free_port()
        async with running("stdbuf", "-oL", str(LIBMODBUS), "tcp", str(port)), opened(tcp(port)) as bus:
            yield bus
    else:
        async with (
            serial_pair(folder) as (ours, theirs),
            running("stdbuf", "-oL", str(LIBMODBUS), "rtu", theirs),
            opened(rtu(ours)) as bus,
        ):
            await asyncio.sleep(0.3)  # the server says nothing when it has opened its port
            yield bus


LINES = pytest.mark.parametrize("transport", [Transport.TCP, Transport.RTU], ids=lambda transport: transport.value)


@LINES
async def test_libmodbus_is_read_and_written(transport: Transport, tmp_path: Path) -> None:
    async with libmodbus_bus(transport, tmp_path) as bus:
        holding = ReadRequest(17, Function.HOLDING, 0x160, 3)
        await bus.write(WriteRequest(17, Function.HOLDING, 0x160, (1, 2, 3)), Priority.WRITE)
        assert await bus.read(holding, Priority.CONTROL) == (1, 2, 3)
        await bus.write(WriteRequest(17, Function.HOLDING, 0x161, (99,)), Priority.WRITE)
        assert await bus.read(holding, Priority.CONTROL) == (1, 99, 3)
        await bus.write(WriteRequest(17, Function.COIL, 0x130, (1,)), Priority.WRITE)
        coils = await bus.read(ReadRequest(17, Function.COIL, 0x130, 37), Priority.CONTROL)
        assert (coils[0], len(coils)) == (1, 37)
        inputs = await bus.read(ReadRequest(17, Function.DISCRETE_INPUT, 0x1C4, 22), Priority.CONTROL)
        assert inputs[:8] == (0, 0, 1, 1, 0, 1, 0, 1)  # 0xAC, lowest bit first
        assert await bus.read(ReadRequest(17, Function.INPUT, 0x108, 1), Priority.CONTROL) == (10,)


@LINES
async def test_libmodbus_misbehaviour_is_seen_and_costs_one_answer(transport: Transport, tmp_path: Path) -> None:
    async with libmodbus_bus(transport, tmp_path) as bus:
        await bus.write(WriteRequest(17, Function.HOLDING, 0x160, (1, 2, 3)), Priority.WRITE)
        bad: list[tuple[int, int, type[BusError] | tuple[type[BusError], ...]]] = [
            (0x100, 1, AddressRefusedError),
            (0x160, 2, BadAnswerError),
            (0x170, 1, UnitBusyError),
            (0x171, 1, (BadAnswerError, NoAnswerError)),
        ]
        for address, count, error in bad:
            with pytest.raises(error):
                await bus.read(ReadRequest(17, Function.HOLDING, address, count), Priority.CONTROL)
            await answers_again(bus, ReadRequest(17, Function.HOLDING, 0x160, 3), (1, 2, 3))


async def test_a_libmodbus_answer_that_comes_too_late_is_not_taken_for_the_next(tmp_path: Path) -> None:
    libmodbus()
    async with (
        serial_pair(tmp_path) as (ours, theirs),
        running("stdbuf", "-oL", str(LIBMODBUS), "rtu", theirs),
        opened(rtu(ours, timeout=0.3)) as bus,
    ):
        await asyncio.sleep(0.3)
        await bus.write(WriteRequest(17, Function.HOLDING, 0x161, (77,)), Priority.WRITE)
        with pytest.raises(NoAnswerError):
            await bus.read(ReadRequest(17, Function.HOLDING, 0x172, 1), Priority.CONTROL)
        await answers_again(bus, ReadRequest(17, Function.HOLDING, 0x161, 1), (77,))


# npm modbus-serial


@contextlib.asynccontextmanager
async def modbus_serial(transport: Transport, folder: Path) -> AsyncIterator[ModbusBus]:
    node_package("modbus-serial")
    script = str(HERE / "modbus_serial_server.js")
    if transport is Transport.TCP:
        port = free_port()
        async with running("node", script, "tcp", str(port), ready="ready"), opened(tcp(port, 0.3)) as bus:
            yield bus
    else:
        async with (
            serial_pair(folder) as (ours, theirs),
            running("node", script, "rtu", theirs, ready="ready"),
            opened(rtu(ours, 0.3)) as bus,
        ):
            yield bus


@LINES
async def test_modbus_serial_is_read_and_written(transport: Transport, tmp_path: Path) -> None:
    async with modbus_serial(transport, tmp_path) as bus:
        holding = await bus.read(ReadRequest(1, Function.HOLDING, 10, 50), Priority.CONTROL)
        assert holding == tuple(range(1010, 1060))
        inputs = await bus.read(ReadRequest(1, Function.INPUT, 0, 5), Priority.CONTROL)
        assert inputs == (2000, 2001, 2002, 2003, 2004)
        await bus.write(WriteRequest(1, Function.HOLDING, 20, (7, 8)), Priority.WRITE)
        await bus.write(WriteRequest(1, Function.HOLDING, 22, (9,)), Priority.WRITE)
        assert await bus.read(ReadRequest(1, Function.HOLDING, 20, 3), Priority.CONTROL) == (7, 8, 9)
        await bus.write(WriteRequest(1, Function.COIL, 3, (1,)), Priority.WRITE)
        assert await bus.read(ReadRequest(1, Function.COIL, 2, 3), Priority.CONTROL) == (0, 1, 0)


@LINES
async def test_modbus_serial_refusals_and_late_answers(transport: Transport, tmp_path: Path) -> None:
    async with modbus_serial(transport, tmp_path) as bus:
        with pytest.raises(AddressRefusedError):
            await bus.read(ReadRequest(1, Function.HOLDING, 155, 1), Priority.CONTROL)
        with pytest.raises(UnitBusyError):
            await bus.read(ReadRequest(1, Function.HOLDING, 160, 1), Priority.CONTROL)
        with pytest.raises(NoAnswerError):
            await bus.read(ReadRequest(1, Function.HOLDING, 170, 1), Priority.CONTROL)
        await answers_again(bus, ReadRequest(1, Function.HOLDING, 5, 1), (1005,))


async def test_a_block_over_registers_that_modbus_serial_refuses_is_split(tmp_path: Path) -> None:
    text = """
title: peer
source: modbus_serial_server.js
buses:
  peer: {transport: tcp, host: 127.0.0.1}
devices:
  peer: {bus: peer, device_id: 1, bridge: 20}
points:
  air_temperature: {device: peer, function: holding, address: 148, type: uint16, unit: degC}
  air_humidity: {device: peer, function: holding, address: 155, type: uint16, unit: "%"}
  air_co2: {device: peer, function: holding, address: 161, type: uint16, unit: ppm}
"""
    node_package("modbus-serial")
    port = free_port()
    register_map = parse_register_map(text)
    buses = {name: replace(bus, port=port) for name, bus in register_map.buses.items()}
    async with running("node", str(HERE / "modbus_serial_server.js"), "tcp", str(port), ready="ready"):
        plc = RegisterPlc(replace(register_map, buses=buses))
        plc.start()
        readings = await plc.read()
        await plc.close()
    assert readings["air_temperature"].value == 1148.0
    assert isinstance(readings["air_humidity"].error, AddressRefusedError)
    assert readings["air_co2"].value == 1161.0


# npm jsmodbus


async def test_jsmodbus_is_read_and_its_short_answers_are_refused() -> None:
    node_package("jsmodbus")
    port = free_port()
    async with (
        running("node", str(HERE / "jsmodbus_server.js"), str(port), ready="ready"),
        opened(tcp(port, 0.5)) as bus,
    ):
        first = ReadRequest(1, Function.HOLDING, 0, 100)
        assert await bus.read(first, Priority.CONTROL) == tuple(range(3000, 3100))
        for address, count in ((90, 20), (100, 1), (500, 10)):
            with pytest.raises((BadAnswerError, NoAnswerError, AddressRefusedError)):
                await bus.read(ReadRequest(1, Function.HOLDING, address, count), Priority.CONTROL)
        await asyncio.sleep(0.2)
        assert await bus.read(first, Priority.CONTROL) == tuple(range(3000, 3100))
