"""Devices that are busy for minutes, send byte by byte, or talk without being asked."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable

import pytest

from igrow.edge.bus.errors import BusError
from igrow.edge.bus.modbus_bus import ModbusBus
from igrow.edge.bus.protocol import Priority, ReadRequest
from igrow.edge.image import Quality
from igrow.edge.registers.model import BusSettings, Function, Transport
from igrow.edge.virtual_plc.memory import AnswerWithExceptionError
from igrow.edge.virtual_plc.modbus_server import answer
from tests.bus.plc_bench import INTERVAL, SAFE, make_plc_bench
from tests.bus.simulated_loop import run
from tests.control.control_fakes import FixedSource

WISH = {"heating_setpoint": 21.0, "co2_setpoint": 700.0, "lamp_on": 1.0, "irrigation_on": 0.5}
BUSY = 6


@pytest.mark.parametrize("rtu", [False, True])
@pytest.mark.parametrize("minutes", [1, 10])
def test_a_plc_that_is_busy_for_minutes_is_controlled_again_and_nothing_was_a_hand(rtu: bool, minutes: int) -> None:
    async def played() -> None:
        bench = await make_plc_bench([FixedSource(dict(WISH))], rtu=rtu, respect_hand=600.0)

        async def cycles(number: int) -> None:
            for _ in range(number):
                await bench.cycle.run()
                await asyncio.sleep(INTERVAL)

        await cycles(12)
        assert {name: bench.stands(name) for name in WISH} == WISH
        unit = bench.units["plc"]
        usual = unit.read, unit.write

        def busy(*_: object) -> None:
            raise AnswerWithExceptionError(BUSY)

        unit.read = unit.write = busy  # type: ignore[assignment]
        beats = len(bench.received("heartbeat"))
        await cycles(12 * minutes)
        assert len(bench.received("heartbeat")) == beats
        unit.read, unit.write = usual
        for name in unit.points.keys() & SAFE.keys():
            unit.set_value(name, SAFE[name])  # it has heard no heartbeat
        await cycles(12)
        assert {name: bench.stands(name) for name in WISH} == WISH
        assert "changed_by_hand" not in bench.store.kinds()
        await bench.close()

    run(played())


class Odd(asyncio.Protocol):
    """Answers in a way of its own: what `says` does with the transport and each request."""

    def __init__(self, says: Callable[[asyncio.Transport, bytes], None]) -> None:
        self.says = says

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport

    def data_received(self, data: bytes) -> None:
        self.says(self.transport, data)


class Four:
    """A unit whose registers all hold 4."""

    def read(self, function: Function, address: int, count: int) -> list[int]:
        return [4] * count

    def write(self, function: Function, address: int, values: object) -> None:
        return


def right(request: bytes) -> bytes:
    reply = answer(Four(), request[7:])
    return request[:4] + (len(reply) + 1).to_bytes(2, "big") + request[6:7] + reply


def drips(transport: asyncio.Transport, request: bytes) -> None:
    """One byte, then a pause nearly as long as the timeout: each byte alone is a sign of life."""
    loop = asyncio.get_running_loop()
    for number, byte in enumerate(right(request)):
        loop.call_later(0.4 * number, transport.write, bytes((byte,)))


def floods(transport: asyncio.Transport, request: bytes) -> None:
    """Sound frames that nobody asked for, for ten minutes, twenty a second."""
    loop = asyncio.get_running_loop()
    for number in range(12_000):
        loop.call_later(0.05 * number, transport.write, bytes((0xAB, number % 256, 0, 0, 0, 5, 1, 3, 2, 0, 9)))


def halves(transport: asyncio.Transport, request: bytes) -> None:
    """The first half of each answer, and never the second."""
    whole = right(request)
    transport.write(whole[: len(whole) // 2])


@pytest.mark.parametrize("odd", [drips, floods, halves])
def test_a_device_with_manners_of_its_own_costs_no_more_than_the_timeout_and_is_never_believed(
    odd: Callable[[asyncio.Transport, bytes], None],
) -> None:
    async def played() -> None:
        loop = asyncio.get_running_loop()
        says, served = [odd], list[Odd]()

        def serve() -> Odd:
            served.append(Odd(says[-1]))
            return served[-1]

        await loop.create_server(serve, "127.0.0.1", 502)
        bus = ModbusBus(
            BusSettings("line", Transport.TCP, host="127.0.0.1", port=502, timeout=0.5), monotonic=loop.time
        )
        bus.start()
        await asyncio.sleep(0.1)
        request, read = ReadRequest(1, Function.HOLDING, 0, 2), []
        for _ in range(20):
            began = loop.time()
            with contextlib.suppress(BusError):
                read.append(await bus.read(request, Priority.CONTROL))
            assert loop.time() - began < 2.0
            await asyncio.sleep(20.0)
        assert read == []
        says.append(lambda transport, asked: transport.write(right(asked)))
        for one in served:
            one.says = says[-1]
        await asyncio.sleep(700.0)
        assert await bus.read(request, Priority.CONTROL) == (4, 4)
        await bus.close()

    run(played())


@pytest.mark.parametrize("rtu", [False, True])
def test_a_device_that_hangs_up_after_each_answer_is_read_and_beaten_in_every_cycle(rtu: bool) -> None:
    async def played() -> None:
        bench = await make_plc_bench([FixedSource(dict(WISH))], rtu=rtu, respect_hand=600.0)
        bench.proxies["first"].most_requests = 1
        for _ in range(10):
            await bench.cycle.run()
            await asyncio.sleep(INTERVAL)
        beats = len(bench.received("heartbeat"))
        for _ in range(10):
            result = await bench.cycle.run()
            assert all(value.age < INTERVAL for value in result.image.values.values())
            await asyncio.sleep(INTERVAL)
        assert len(bench.received("heartbeat")) == beats + 10
        assert {name: bench.stands(name) for name in WISH} == WISH
        await bench.close()

    run(played())


def test_a_gateway_that_gives_us_the_answers_of_another_client_is_not_believed() -> None:
    """Both count their requests from one, as most programs do, and ask for as much."""

    async def played() -> None:
        loop, asked = asyncio.get_running_loop(), [0]

        def mixes(transport: asyncio.Transport, request: bytes) -> None:
            asked[0] += 1
            transport.write(asked[0].to_bytes(2, "big") + bytes((0, 0, 0, 7, 1, 3, 4, 0, 9, 0, 9)) + right(request))

        await loop.create_server(lambda: Odd(mixes), "127.0.0.1", 502)
        bus = ModbusBus(BusSettings("line", Transport.TCP, host="127.0.0.1", timeout=0.5), monotonic=loop.time)
        bus.start()
        await asyncio.sleep(0.1)
        for _ in range(20):
            assert await bus.read(ReadRequest(1, Function.HOLDING, 0, 2), Priority.CONTROL) == (4, 4)
        await bus.close()

    run(played())


def test_what_words_in_another_order_show_is_neither_believed_nor_a_hand() -> None:
    """New firmware has turned the order of a number's words: most of its numbers read as no value."""

    async def played() -> None:
        bench = await make_plc_bench([FixedSource(dict(WISH))], respect_hand=600.0)
        for _ in range(5):
            await bench.cycle.run()
            await asyncio.sleep(INTERVAL)
        unit = bench.units["plc"]
        usual = unit.read

        def turned(function: Function, address: int, count: int) -> list[int]:
            words = usual(function, address, count)
            if (function, address) == (Function.HOLDING, 0):
                words[:4] = [words[1], words[0], words[3], words[2]]
            return words

        unit.read = turned
        for _ in range(20):
            result = await bench.cycle.run()
            await asyncio.sleep(INTERVAL)
        assert result.image.value_of("heating_setpoint").quality is Quality.MISSING
        assert "changed_by_hand" not in bench.store.kinds()
        unit.read = usual
        for _ in range(20):
            await bench.cycle.run()
            await asyncio.sleep(INTERVAL)
        assert "changed_by_hand" not in bench.store.kinds()
        assert {name: bench.stands(name) for name in WISH} == WISH
        await bench.close()

    run(played())
