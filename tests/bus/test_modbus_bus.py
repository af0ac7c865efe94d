"""The bus against a server: what it does when lines, units and answers fail. In simulated time."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from typing import Any

import pytest

from igrow.edge.bus.errors import (
    AddressRefusedError,
    BadAnswerError,
    BusError,
    ConnectionLostError,
    GatewayRefusedError,
    NoAnswerError,
    NotConnectedError,
    OldAnswerError,
    RefusedError,
    UnitBusyError,
    UnitRestingError,
)
from igrow.edge.bus.modbus_bus import ModbusBus
from igrow.edge.bus.protocol import Priority, ReadRequest, WriteRequest
from igrow.edge.registers.model import BusSettings, Function, Transport
from igrow.edge.virtual_plc.modbus_server import ModbusServer
from tests.bus.coded_unit import CodedUnit, code
from tests.bus.fault_proxy import Fault, FaultProxy
from tests.bus.late_line import LateLine
from tests.bus.simulated_loop import run

PORT = 5020
TRANSPORTS = pytest.mark.parametrize("transport", [Transport.TCP, Transport.RTU_OVER_TCP], ids=lambda t: t.value)


def make_bus(transport: Transport = Transport.TCP, port: int = PORT, **more: Any) -> ModbusBus:
    settings = BusSettings("line", transport, host="127.0.0.1", port=port, timeout=1.0)
    bus = ModbusBus(settings, monotonic=asyncio.get_running_loop().time, **more)
    bus.start()
    return bus


async def serve(*units: CodedUnit, transport: Transport = Transport.TCP) -> ModbusServer:
    server = ModbusServer({unit.device_id: unit for unit in units})
    await server.listen("127.0.0.1", PORT, rtu=transport.is_rtu)
    return server


async def behind_proxy(
    *faults: Fault, transport: Transport, units: tuple[CodedUnit, ...] = ()
) -> tuple[ModbusBus, CodedUnit]:
    """Return a bus that meets these faults in this order, and then none, and the unit behind."""
    units = units or (CodedUnit(1),)
    await serve(*units, transport=transport)
    proxy = FaultProxy(PORT, rtu=transport.is_rtu, seed=1, rate=0.0, timeout=1.0)
    script = list(faults)
    proxy.next_fault = lambda: script.pop(0) if script else Fault.NONE
    return make_bus(transport, await proxy.listen()), units[0]


def read(bus: ModbusBus, address: int = 5, count: int = 2, unit: int = 1) -> Coroutine[Any, Any, tuple[int, ...]]:
    return bus.read(ReadRequest(unit, Function.HOLDING, address, count), Priority.CONTROL)


def coded(address: int = 5, count: int = 2, unit: int = 1) -> tuple[int, ...]:
    return tuple(code(unit, Function.HOLDING, a) for a in range(address, address + count))


def now() -> float:
    return asyncio.get_running_loop().time()


@TRANSPORTS
def test_registers_and_bits_of_all_four_tables_are_read(transport: Transport) -> None:
    async def main() -> None:
        await serve(CodedUnit(1), transport=transport)
        bus = make_bus(transport)
        for function in Function:
            for address, count in ((0, 1), (3, 9), (100, 120)):
                content = await bus.read(ReadRequest(1, function, address, count), Priority.CONTROL)
                assert content == tuple(code(1, function, a) for a in range(address, address + count))

    run(main())


@TRANSPORTS
def test_coils_and_registers_are_written(transport: Transport) -> None:
    async def main() -> None:
        unit = CodedUnit(1)
        await serve(unit, transport=transport)
        bus = make_bus(transport)
        wanted = [(Function.COIL, 300, (1,)), (Function.HOLDING, 301, (77,)), (Function.HOLDING, 302, (1, 2, 3, 4))]
        for function, address, values in wanted:
            await bus.write(WriteRequest(1, function, address, values), Priority.WRITE)
        assert unit.writes == wanted

    run(main())


def test_a_server_that_is_down_at_boot_is_found_when_it_comes() -> None:
    async def main() -> None:
        bus = make_bus()
        with pytest.raises(NotConnectedError):
            await read(bus)
        await asyncio.sleep(60)
        await serve(CodedUnit(1))
        await asyncio.sleep(10.1)
        assert await read(bus) == coded()

    run(main())


def test_a_request_waits_for_a_connection_that_is_being_made() -> None:
    async def main() -> None:
        await serve(CodedUnit(1))
        assert await read(make_bus()) == coded()

    run(main())


def test_a_line_that_is_lost_is_connected_again_at_once() -> None:
    async def main() -> None:
        server = await serve(CodedUnit(1))
        bus = make_bus()
        await read(bus)
        await asyncio.sleep(30)
        server.drop_connections()
        await asyncio.sleep(0.1)
        assert await read(bus) == coded()
        assert bus.connects == 2

    run(main())


def test_a_server_that_hangs_up_on_everybody_is_not_stormed() -> None:
    async def main() -> int:
        await serve(CodedUnit(1))
        proxy = FaultProxy(PORT, rtu=False, seed=1, rate=0.0, timeout=1.0)
        proxy.storm = 10**6
        bus = make_bus(port=await proxy.listen())
        await asyncio.sleep(600)
        return bus.connects

    assert run(main()) <= 66


def test_a_request_fails_in_the_instant_in_which_the_line_breaks() -> None:
    async def main() -> float:
        bus, _ = await behind_proxy(Fault.HANG_UP, transport=Transport.TCP)
        await asyncio.sleep(0.1)
        begin = now()
        with pytest.raises(ConnectionLostError):
            await read(bus)
        return now() - begin

    assert run(main()) < 0.01


def test_a_dead_unit_costs_the_others_nothing_but_one_timeout_now_and_then() -> None:
    """Unit 9 is silent. In ten minutes of polling each second it may take the bus for few seconds in all."""

    async def main() -> tuple[float, int]:
        await serve(CodedUnit(1))
        bus = make_bus()
        waited = 0.0
        tries = 0
        for _ in range(600):
            begin = now()
            try:
                await read(bus, unit=9)
            except UnitRestingError:
                pass
            except NoAnswerError:
                tries += 1
            assert await read(bus) == coded()
            waited += now() - begin
            await asyncio.sleep(1.0)
        return waited, tries

    waited, tries = run(main())
    assert 5 < tries < 30
    assert waited < 1.1 * tries + 1.0


@pytest.mark.parametrize(
    ("exception", "kind"),
    [
        (1, RefusedError),
        (2, AddressRefusedError),
        (3, AddressRefusedError),
        (4, RefusedError),
        (5, UnitBusyError),
        (6, UnitBusyError),
        (10, GatewayRefusedError),
        (11, GatewayRefusedError),
    ],
)
def test_each_exception_answer_becomes_its_error(exception: int, kind: type[BusError]) -> None:
    async def main() -> None:
        unit = CodedUnit(1)
        unit.failing_with = exception
        await serve(unit)
        bus = make_bus()
        with pytest.raises(kind, match=f"exception {exception}") as caught:
            await read(bus)
        assert type(caught.value) is kind
        assert bus.health.unit(1).failures == 0

    run(main())


@TRANSPORTS
@pytest.mark.parametrize("fault", [Fault.WRONG_UNIT, Fault.WRONG_FUNCTION, Fault.WRONG_COUNT, Fault.GARBLED])
def test_an_answer_that_does_not_fit_is_thrown_away_and_the_next_is_right(transport: Transport, fault: Fault) -> None:
    async def main() -> None:
        bus, _ = await behind_proxy(fault, transport=transport)
        with pytest.raises((BadAnswerError, NoAnswerError)):
            await read(bus)
        await asyncio.sleep(1.0)
        assert await read(bus, 50) == coded(50)

    run(main())


@TRANSPORTS
def test_a_late_answer_is_not_taken_for_the_next_one(transport: Transport) -> None:
    async def main() -> None:
        bus, unit = await behind_proxy(Fault.LATE, Fault.SLOW, Fault.SLOW, transport=transport)
        with pytest.raises(NoAnswerError):
            await read(bus, 5)
        if transport.is_rtu:  # nothing tells the answers apart, so the unit first gets a silence
            with pytest.raises(UnitRestingError):
                await read(bus, 50)
            await asyncio.sleep(1.1)
        assert await read(bus, 50) == coded(50)
        assert unit.reads == [(Function.HOLDING, 5, 2), (Function.HOLDING, 50, 2)]

    run(main())


@pytest.mark.parametrize("cut", range(1, 13))
def test_a_cut_answer_and_a_stale_frame_do_not_join_to_a_value(cut: int) -> None:
    """Found by the random sequences: 13 bytes of an answer, cut, and filled up by the repetition of an older one."""

    class Cutter(asyncio.Protocol):
        def connection_made(self, transport: Any) -> None:
            self.transport = transport
            self.last = b""

        def data_received(self, data: bytes) -> None:
            registers = b"".join(word.to_bytes(2, "big") for word in (7, 8))
            frame = data[:2] + bytes((0, 0, 0, 7, data[6], 3, 4)) + registers
            if self.last:
                self.transport.write(frame[:cut])
                asyncio.get_running_loop().call_later(0.1, self.transport.write, self.last)
            else:
                self.transport.write(frame)
            self.last = frame

    async def main() -> None:
        await asyncio.get_running_loop().create_server(Cutter, "127.0.0.1", PORT)
        bus = make_bus()
        assert await read(bus) == (7, 8)
        with pytest.raises(BadAnswerError):
            await read(bus)

    run(main())


@TRANSPORTS
@pytest.mark.parametrize("fault", [Fault.NO_ANSWER, Fault.LATE, Fault.WRONG_ECHO, Fault.HANG_UP, Fault.TRUNCATED])
def test_a_write_that_failed_is_never_repeated_by_the_bus(transport: Transport, fault: Fault) -> None:
    async def main() -> None:
        bus, unit = await behind_proxy(fault, transport=transport)
        with pytest.raises(BusError) as caught:
            await bus.write(WriteRequest(1, Function.HOLDING, 300, (7, 8)), Priority.WRITE)
        assert caught.value.sent
        await asyncio.sleep(30)
        assert unit.writes == [(Function.HOLDING, 300, (7, 8))]

    run(main())


def test_after_a_missing_answer_a_block_is_asked_for_with_a_register_more_until_no_late_one_can_come() -> None:
    async def main() -> None:
        bus, unit = await behind_proxy(Fault.NO_ANSWER, transport=Transport.RTU_OVER_TCP)
        with pytest.raises(NoAnswerError):
            await read(bus)
        await asyncio.sleep(1.1)
        assert await read(bus) == coded()
        await asyncio.sleep(20.0)
        assert await read(bus) == coded()
        assert [count for _, _, count in unit.reads] == [2, 3, 2]

    run(main())


def test_a_late_answer_that_has_come_is_waited_for_no_longer() -> None:
    async def main() -> None:
        bus, unit = await behind_proxy(Fault.LATE, transport=Transport.RTU_OVER_TCP)
        with pytest.raises(NoAnswerError):
            await read(bus)
        await asyncio.sleep(2.0)
        assert await read(bus) == coded()
        assert [count for _, _, count in unit.reads] == [2, 2]

    run(main())


def test_a_unit_that_holds_nothing_more_is_left_alone_until_no_late_answer_can_come() -> None:
    async def main() -> float:
        units = (CodedUnit(1, refused=[253]),)
        bus, unit = await behind_proxy(Fault.NO_ANSWER, transport=Transport.RTU_OVER_TCP, units=units)
        last = 254  # of two registers, the last ones of the unit, and none before them
        with pytest.raises(NoAnswerError):
            await read(bus, last)
        await asyncio.sleep(1.1)
        begin = now()
        for _ in range(2):
            with pytest.raises(OldAnswerError):
                await read(bus, last)
        while True:
            try:
                assert await read(bus, last) == coded(last)
                break
            except UnitRestingError:
                await asyncio.sleep(0.5)
        assert [count for _, _, count in unit.reads] == [2, 3, 4, 2]
        return now() - begin

    assert run(main()) == pytest.approx(19.0, abs=1.0)


def test_a_refusal_that_may_be_an_older_requests_is_not_taken_for_the_address_s() -> None:
    """A block that is refused is split for good, a point left alone for a while: not for somebody else's refusal."""

    async def main() -> None:
        bus, _ = await behind_proxy(Fault.NO_ANSWER, Fault.EXCEPTION, transport=Transport.RTU_OVER_TCP)
        with pytest.raises(NoAnswerError):
            await read(bus)
        await asyncio.sleep(1.1)
        with pytest.raises(OldAnswerError):
            await read(bus)
        await asyncio.sleep(21.0)
        assert await read(bus) == coded()

    run(main())


def test_a_late_echo_does_not_confirm_the_next_write_to_the_same_registers() -> None:
    """The echo of several registers names where they stand, and not what was written."""

    async def main() -> None:
        line = LateLine({1: CodedUnit(1)}, seed=1, share=0.0, timeout=1.0, latest=1.0, in_order=False)
        bus = make_bus(Transport.RTU_OVER_TCP, await line.listen())
        echoes = iter((2.2, 60.0))  # the second request is lost, as good as

        def say_later(answer: bytes) -> None:
            asyncio.get_running_loop().call_later(next(echoes), LateLine.say, line, answer)

        line.say = say_later
        first, second = (WriteRequest(1, Function.HOLDING, 300, values) for values in ((1, 1), (2, 2)))
        with pytest.raises(NoAnswerError):
            await bus.write(first, Priority.WRITE)
        await asyncio.sleep(1.01)
        with pytest.raises(NoAnswerError) as caught:
            await bus.write(second, Priority.WRITE)
        assert caught.value.sent

    run(main())


@TRANSPORTS
def test_a_request_whose_asker_goes_away_keeps_the_line_until_it_is_answered(transport: Transport) -> None:
    async def main() -> None:
        bus, unit = await behind_proxy(*[Fault.SLOW] * 9, transport=transport)
        await read(bus)
        job = asyncio.ensure_future(read(bus, 50))
        await asyncio.sleep(0.01)
        job.cancel()
        assert await read(bus, 60) == coded(60)
        assert [address for _, address, _ in unit.reads] == [5, 50, 60]
        assert bus.health.unit(1).answers == 3

    run(main())


@TRANSPORTS
def test_a_bus_is_closed_while_nobody_waits_for_the_answer_any_more(transport: Transport) -> None:
    async def main() -> None:
        bus, _ = await behind_proxy(Fault.NONE, Fault.NO_ANSWER, transport=transport)
        await read(bus)
        job = asyncio.ensure_future(read(bus, 50))
        await asyncio.sleep(0.01)
        job.cancel()
        begin = now()
        await bus.close()
        assert now() - begin < 0.5

    run(main())


def test_last_orders_wait_for_no_unit_that_rests_and_no_attempt_to_connect() -> None:
    async def main() -> None:
        bus = make_bus()
        for _ in range(10):
            with pytest.raises(NotConnectedError):
                await read(bus)
            await asyncio.sleep(5.0)
        unit = CodedUnit(1)
        await serve(unit)
        bus.health.failed(1, silent=True)
        bus.health.failed(1, silent=True)
        bus.last_orders()
        begin = now()
        await bus.write(WriteRequest(1, Function.HOLDING, 300, (7,)), Priority.WRITE)
        assert now() - begin < 0.5
        assert unit.writes == [(Function.HOLDING, 300, (7,))]

    run(main())


def test_a_connection_whose_other_end_has_vanished_is_given_up_after_three_silences() -> None:
    """No error comes when a PLC is switched off or a router forgets: the line just stays silent."""

    async def main() -> int:
        await serve(CodedUnit(1))
        proxy = FaultProxy(PORT, rtu=False, seed=1, rate=0.0, timeout=1.0)
        bus = make_bus(port=await proxy.listen())
        await read(bus)
        proxy.next_fault = lambda: Fault.NO_REQUEST if bus.connects == 1 else Fault.NONE
        for _ in range(3):
            with pytest.raises(NoAnswerError):
                await read(bus)
            await asyncio.sleep(5.0)
        assert await read(bus) == coded()
        return bus.connects

    assert run(main()) == 2


def test_units_that_answer_keep_the_line_of_a_dead_one_open() -> None:
    async def main() -> int:
        await serve(CodedUnit(1))
        bus = make_bus()
        for _ in range(100):
            with pytest.raises(BusError):
                await read(bus, unit=9)
            assert await read(bus) == coded()
            await asyncio.sleep(30.0)
        return bus.connects

    assert run(main()) == 1


def test_a_line_that_does_not_stop_talking_is_given_up_for_the_request() -> None:
    class Babbler(asyncio.Protocol):
        def connection_made(self, transport: Any) -> None:
            self.transport = transport

        def data_received(self, data: bytes) -> None:
            self.transport.write(bytes(3000))

    async def main() -> None:
        await asyncio.get_running_loop().create_server(Babbler, "127.0.0.1", PORT)
        bus = make_bus(Transport.RTU_OVER_TCP)
        with pytest.raises(BadAnswerError, match="does not stop talking"):
            await read(bus)

    run(main())


def test_only_one_request_is_on_the_line_at_a_time() -> None:
    async def main() -> None:
        bus, unit = await behind_proxy(*[Fault.SLOW] * 20, transport=Transport.RTU_OVER_TCP)
        results = await asyncio.gather(*(read(bus, address) for address in range(20)))
        assert results == [coded(address) for address in range(20)]
        assert [address for _, address, _ in unit.reads] == list(range(20))

    run(main())


def test_requests_that_wait_fail_when_the_bus_is_closed() -> None:
    async def main() -> None:
        bus, _ = await behind_proxy(Fault.NO_ANSWER, transport=Transport.TCP)
        jobs = [asyncio.ensure_future(read(bus)) for _ in range(3)]
        await asyncio.sleep(0.1)
        await bus.close()
        results = await asyncio.gather(*jobs, return_exceptions=True)
        assert all(isinstance(result, (ConnectionLostError, NotConnectedError)) for result in results)

    run(main())
