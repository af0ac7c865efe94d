"""The probe: which unit answers, what its registers hold, and what that may mean."""

from __future__ import annotations

import asyncio

from igrow.edge.probe import Answers, decoded, probe, scan
from igrow.edge.registers.codec import encode_raw
from igrow.edge.registers.model import BusSettings, ByteOrder, DataType, Device, Function, Identity, Transport
from igrow.edge.virtual_plc.modbus_server import ModbusServer
from tests.bus.coded_unit import CodedUnit
from tests.bus.simulated_loop import run

SETTINGS = BusSettings("probe", Transport.TCP, host="127.0.0.1", port=5020, timeout=1.0)


def against(*units: CodedUnit, first: int = 0, count: int = 4) -> list[str]:
    async def main() -> list[str]:
        server = ModbusServer({unit.device_id: unit for unit in units})
        await server.listen("127.0.0.1", 5020)
        return (await probe(SETTINGS, [1, 2], Function.HOLDING, first, count)).lines

    return run(main())


def test_whole_numbers_are_shown_with_all_their_digits() -> None:
    words = encode_raw(1_304_186_123, DataType.INT32)
    assert any("int32    ABCD 1304186123 " in line for line in decoded(dict(enumerate(words)), Function.HOLDING))


def test_a_value_is_shown_in_the_byte_order_in_which_it_was_written() -> None:
    for order in ByteOrder:
        words = encode_raw(23.5, DataType.FLOAT32, order)
        lines = list(decoded(dict(enumerate(words)), Function.HOLDING))
        assert any(line.strip().startswith("float32") and f"{order.value} 23.5" in line for line in lines)


def test_raw_content_comes_with_its_bits_and_both_whole_numbers() -> None:
    lines = list(decoded({7: 0xFFFE}, Function.HOLDING))
    assert lines[0].split() == ["7", "0xfffe", "bits", "1111111111111110"]
    assert "ABCD -2" in lines[1]
    assert "ABCD 65534" in lines[2]


def test_a_unit_of_a_map_is_asked_who_it_is() -> None:
    async def main() -> list[str]:
        unit = CodedUnit(1)
        shown = tuple(unit.read(Function.HOLDING, 2, 2))
        server = ModbusServer({1: unit, 2: CodedUnit(2)})
        await server.listen("127.0.0.1", 5020)
        identity = Identity(Function.HOLDING, 2, shown)
        devices = [Device(name, "net", number, identity=identity) for number, name in ((1, "plc"), (2, "other"))]
        return (await probe(SETTINGS, [1], devices=devices)).lines[-2:]

    right, wrong = run(main())
    assert right.startswith("unit plc shows its identity: ")
    assert wrong.startswith("unit other shows ")
    assert "but its `identity` in the map is" in wrong


def test_a_silent_unit_and_an_answering_one_are_told_apart() -> None:
    lines = against(CodedUnit(1))
    assert lines[0] == "unit 1, holding 0 to 3: answers"
    assert lines[-1] == "unit 2, holding 0 to 3: no answer within 1 s"


def test_a_refused_block_is_asked_for_address_by_address() -> None:
    lines = against(CodedUnit(1, refused=[1, 2]))
    assert "asking for each address alone" in lines[0]
    assert [line.split()[0] for line in lines if "bits" in line] == ["0", "3"]


def test_a_unit_that_has_nothing_there_is_told_from_one_that_is_not_there() -> None:
    lines = against(CodedUnit(1), first=1000)
    assert lines[1] == "  the unit is there, but holds nothing at these addresses"


def test_a_server_that_is_not_there_is_told() -> None:
    answers = run(probe(SETTINGS, [1]))
    assert not answers.any
    assert len(answers.lines) == 1
    assert "nobody listens" in answers.lines[0] or "not connected" in answers.lines[0]


def test_a_scan_finds_the_units_that_answer_at_all() -> None:
    async def main() -> Answers:
        refusing = CodedUnit(5, refused=[0])
        server = ModbusServer({3: CodedUnit(3), 5: refusing})
        await server.listen("127.0.0.1", 5020)
        return await scan(SETTINGS, range(1, 10))

    answers = run(main())
    assert answers.any
    assert answers.lines[0] == "unit 3: answers"
    assert answers.lines[1].startswith("unit 5: is there")
    assert len(answers.lines) == 2


def test_a_scan_that_nobody_answers_says_so() -> None:
    answers = run(scan(SETTINGS, range(1, 3)))
    assert not answers.any
    assert answers.lines[0].startswith("no unit answers")


def test_a_probe_closes_its_connection() -> None:
    async def main() -> int:
        server = ModbusServer({1: CodedUnit(1)})
        await server.listen("127.0.0.1", 5020)
        await probe(SETTINGS, [1])
        await asyncio.sleep(0.1)
        return len(asyncio.all_tasks())

    assert run(main()) == 1
