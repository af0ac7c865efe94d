"""What a serial line still owes: which answers may be older than the question, and that nothing waits for ever."""

from __future__ import annotations

import asyncio

import pytest

from igrow.edge.bus.block_reader import BlockReader
from igrow.edge.bus.errors import AddressRefusedError, BadAnswerError, BusError, NoAnswerError, UnitRestingError
from igrow.edge.bus.modbus_bus import ModbusBus
from igrow.edge.bus.owed import LATEST, MOST_EXTRA, OwedAnswers
from igrow.edge.bus.protocol import Priority, ReadRequest
from igrow.edge.registers.loading import parse_register_map
from igrow.edge.registers.model import BusSettings, Function, Transport
from igrow.edge.virtual_plc.modbus_server import crc
from tests.bus.coded_unit import CodedUnit, code
from tests.bus.late_line import LateLine
from tests.bus.simulated_loop import run

TIMEOUT = 0.5
PAIR = ReadRequest(1, Function.HOLDING, 40, 2)


def frame(request: ReadRequest) -> bytes:
    head = bytes((request.device_id, request.function.read_code))
    return head + request.address.to_bytes(2, "big") + request.count.to_bytes(2, "big")


def answer(request: ReadRequest) -> bytes:
    body = bytes((request.device_id, request.function.read_code, 2 * request.count)) + bytes(2 * request.count)
    return body + crc(body)


class Time:
    now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def time() -> Time:
    return Time()


@pytest.fixture
def owed(time: Time) -> OwedAnswers:
    return OwedAnswers(time, TIMEOUT, crc)


def looks(asked: ReadRequest | None) -> tuple[int, int] | None:
    return None if asked is None else (asked.address, asked.count)


def test_a_block_whose_like_is_owed_is_asked_for_with_a_register_more(owed: OwedAnswers, time: Time) -> None:
    assert owed.distinct(PAIR) == PAIR
    owed.give_up(frame(ReadRequest(1, Function.HOLDING, 0, 2)))
    assert looks(owed.distinct(PAIR)) == (40, 3)
    assert looks(owed.distinct(ReadRequest(1, Function.HOLDING, 0, 3))) == (0, 3)
    assert looks(owed.distinct(ReadRequest(2, Function.HOLDING, 40, 2))) == (40, 2)
    assert looks(owed.distinct(ReadRequest(1, Function.INPUT, 40, 2))) == (40, 2)
    time.now += LATEST * TIMEOUT
    assert owed.distinct(PAIR) == PAIR


def test_where_a_unit_ends_the_register_before_is_taken_and_where_it_begins_as_well_the_answer_is_waited_for(
    owed: OwedAnswers,
) -> None:
    owed.give_up(frame(PAIR))
    for address, count in ((40, 3), (39, 3)):
        asked = owed.distinct(PAIR)
        assert looks(asked) == (address, count)
        assert asked is not None
        owed.refused(asked, PAIR)
    assert owed.distinct(PAIR) is None
    assert owed.wait(PAIR) == pytest.approx(LATEST * TIMEOUT)


def test_no_register_outside_the_address_space_is_asked_for(owed: OwedAnswers) -> None:
    first, last = ReadRequest(1, Function.HOLDING, 0, 2), ReadRequest(1, Function.HOLDING, 0xFFFE, 2)
    owed.give_up(frame(first))
    assert looks(owed.distinct(last)) == (0xFFFD, 3)
    owed.refused(ReadRequest(1, Function.HOLDING, 0, 3), first)
    assert owed.distinct(first) is None


def test_the_longest_read_cannot_be_lengthened(owed: OwedAnswers) -> None:
    longest = ReadRequest(1, Function.HOLDING, 0, Function.HOLDING.longest_read)
    owed.give_up(frame(longest))
    assert owed.distinct(longest) is None


def test_bits_are_lengthened_by_whole_bytes_on_either_side(owed: OwedAnswers) -> None:
    coils = ReadRequest(1, Function.COIL, 16, 12)
    owed.give_up(frame(coils))
    asked = owed.distinct(coils)
    assert looks(asked) == (16, 20)
    assert asked is not None
    owed.refused(asked, coils)
    assert looks(owed.distinct(coils)) == (8, 20)


def test_a_late_answer_is_crossed_off_wherever_it_stands_in_what_comes(owed: OwedAnswers) -> None:
    owed.give_up(frame(PAIR))
    assert owed.arrived(b"\xff" + answer(PAIR) + b"\x01") == b"\xff\x01"
    assert owed.distinct(PAIR) == PAIR


def test_each_of_several_owed_answers_is_crossed_off_once(owed: OwedAnswers) -> None:
    owed.give_up(frame(PAIR))
    owed.give_up(frame(PAIR))
    assert owed.arrived(answer(PAIR)) == b""
    assert looks(owed.distinct(PAIR)) == (40, 3)
    assert owed.arrived(answer(PAIR)) == b""
    assert owed.distinct(PAIR) == PAIR
    assert owed.arrived(answer(PAIR)) == answer(PAIR)


def test_a_refusal_counts_once_there_are_more_of_them_than_older_questions(owed: OwedAnswers) -> None:
    asked, other = frame(PAIR), frame(ReadRequest(1, Function.HOLDING, 0, 9))
    assert not owed.may_be_older(asked)
    owed.give_up(other)
    assert owed.may_be_older(asked)
    owed.give_up(asked, refusal_came=True)
    assert not owed.may_be_older(asked)  # two refusals, and one other question
    assert owed.may_be_older(frame(ReadRequest(1, Function.HOLDING, 70, 1)))
    assert not owed.may_be_older(frame(ReadRequest(2, Function.HOLDING, 70, 1)))


def test_a_new_process_believes_nothing_that_may_be_the_answer_to_another_ones_question(time: Time) -> None:
    owed = OwedAnswers(time, TIMEOUT, crc, others_asked=True)
    assert owed.distinct(PAIR) is None
    assert owed.wait(PAIR) == pytest.approx(LATEST * TIMEOUT)
    assert owed.may_be_older(frame(PAIR))
    time.now += LATEST * TIMEOUT
    assert owed.distinct(PAIR) == PAIR
    assert not owed.may_be_older(frame(PAIR))


# the bus


async def a_bus(unit: CodedUnit, **more: object) -> tuple[ModbusBus, LateLine]:
    line = LateLine({1: unit}, seed=1, share=0.0, timeout=TIMEOUT, latest=1.0, in_order=True)
    settings = BusSettings("line", Transport.RTU_OVER_TCP, "127.0.0.1", await line.listen(), timeout=TIMEOUT)
    bus = ModbusBus(settings, monotonic=asyncio.get_running_loop().time, **more)  # type: ignore[arg-type]
    bus.start()
    return bus, line


async def time_out(bus: ModbusBus, line: LateLine, request: ReadRequest) -> None:
    """Let the unit not answer one request."""
    say, line.say = line.say, lambda answer: None
    with pytest.raises(NoAnswerError):
        await bus.read(request, Priority.CONTROL)
    line.say = say
    await asyncio.sleep(1.1 * TIMEOUT)


MAP = """
title: a unit with a gap
source: none
buses:
  line: {transport: rtu_over_tcp, host: 127.0.0.1, port: 502}
devices:
  unit: {bus: line, device_id: 1, bridge: 10}
points:
  air_temperature: {device: unit, function: holding, address: 3, type: uint16, unit: degC}
  air_humidity: {device: unit, function: holding, address: 6, type: uint16, unit: "%"}
"""


@pytest.mark.parametrize("owes", [False, True], ids=["nothing owed", "an answer owed"])
def test_a_block_that_dies_on_one_register_is_split_on_a_serial_line_too(owes: bool) -> None:
    """Also while an answer of the same unit is owed, and the refusal could be for that one."""

    async def main() -> None:
        bus, line = await a_bus(CodedUnit(1, refused=[5]))
        if owes:
            await time_out(bus, line, PAIR)
        points = parse_register_map(MAP)
        reader = BlockReader(bus, points.devices, asyncio.get_running_loop().time)
        rounds = round(2 * LATEST * TIMEOUT) + 2 if owes else 3
        for _ in range(rounds):
            results = await reader.read(points.points.values())
            await asyncio.sleep(1.0)
        assert {name: result[0] for name, result in results.items()} == {
            "air_temperature": (code(1, Function.HOLDING, 3),),
            "air_humidity": (code(1, Function.HOLDING, 6),),
        }

    run(main())


def test_an_address_that_is_refused_for_good_is_called_so_although_an_answer_was_owed() -> None:
    async def main() -> None:
        bus, line = await a_bus(CodedUnit(1))
        await time_out(bus, line, PAIR)
        caught: list[type[BusError]] = []
        for _ in range(8):
            with pytest.raises(BusError) as error:
                await bus.read(ReadRequest(1, Function.HOLDING, 290, 2), Priority.CONTROL)
            caught.append(error.type)
            await asyncio.sleep(2.0)
        assert caught[-1] is AddressRefusedError

    run(main())


def test_an_answer_that_is_wrong_but_to_this_question_leaves_nothing_owed() -> None:
    async def main() -> None:
        bus, line = await a_bus(CodedUnit(1))
        say = line.say

        def short(answer: bytes) -> None:
            body = bytes((answer[0], answer[1], 2)) + answer[3:5]
            say(body + crc(body))

        line.say = short
        with pytest.raises(BadAnswerError):
            await bus.read(PAIR, Priority.CONTROL)
        line.say = say
        await asyncio.sleep(1.1 * TIMEOUT)
        with pytest.raises(AddressRefusedError):
            await bus.read(ReadRequest(1, Function.HOLDING, 290, 2), Priority.CONTROL)

    run(main())


def test_answers_to_the_process_before_pass_for_none_of_this_one() -> None:
    async def main() -> None:
        unit = CodedUnit(1)
        before, line = await a_bus(unit)
        line.share = 1.0
        line.latest = LATEST
        with pytest.raises(NoAnswerError):
            await before.read(ReadRequest(1, Function.HOLDING, 0, 2), Priority.CONTROL)
        await before.close()
        line.share = 0.0
        line.in_order = False
        settings = before.settings
        bus = ModbusBus(settings, monotonic=asyncio.get_running_loop().time, others_asked=True)
        bus.start()
        content, waited = None, 0.0
        while content is None:
            try:
                content = await bus.read(PAIR, Priority.CONTROL)
            except UnitRestingError:
                await asyncio.sleep(1.0)
                waited += 1.0
        assert waited == LATEST * TIMEOUT
        assert content == tuple(code(1, Function.HOLDING, address) for address in (40, 41))

    run(main())


def test_a_unit_of_two_registers_is_read_again_once_its_answer_is_no_longer_owed() -> None:
    """Nothing can be asked of it whose answer would look different."""

    async def main() -> None:
        unit = CodedUnit(1, refused=[*range(40), *range(42, 256)])
        bus, line = await a_bus(unit)
        await time_out(bus, line, PAIR)
        begin = asyncio.get_running_loop().time()
        while True:
            try:
                content = await bus.read(PAIR, Priority.CONTROL)
                break
            except BusError:
                await asyncio.sleep(1.0)
        assert content == tuple(code(1, Function.HOLDING, address) for address in (40, 41))
        assert asyncio.get_running_loop().time() - begin < (LATEST + 2) * TIMEOUT + 1.0
        assert len(unit.reads) <= 3 + 2 * MOST_EXTRA

    run(main())
