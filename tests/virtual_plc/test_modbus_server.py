"""The server's answers, byte by byte, by the specification."""

from __future__ import annotations

import asyncio

import pytest

from igrow.edge.registers.model import Function
from igrow.edge.virtual_plc.modbus_server import ModbusServer, answer, crc
from tests.bus.coded_unit import CodedUnit, code


@pytest.mark.parametrize(
    ("request_pdu", "exception"),
    [
        ("07", 1),
        ("08 0001 0000", 1),
        ("03 0000 0000", 3),
        ("03 0000 007e", 3),
        ("01 0000 07d1", 3),
        ("03 00ff 0002", 2),
        ("03 ffff 0001", 2),
        ("05 012c 0001", 3),
        ("06 0000 0001", 2),
        ("10 012c 0001 03 0001", 3),
        ("10 012c 0002 04 0001", 3),
        ("0f 012c 0009 01 ff", 3),
        ("03 00", 3),
    ],
)
def test_a_request_that_cannot_be_served_gets_its_exception(request_pdu: str, exception: int) -> None:
    request = bytes.fromhex(request_pdu)
    assert answer(CodedUnit(1), request) == bytes((request[0] | 0x80, exception))


def test_bits_are_packed_lowest_first() -> None:
    reply = answer(CodedUnit(1), bytes.fromhex("01 0003 000a"))
    bits = [code(1, Function.COIL, address) for address in range(3, 13)]
    assert reply == bytes((1, 2, sum(bit << i for i, bit in enumerate(bits[:8])), bits[8] | bits[9] << 1))


def test_several_coils_are_written_lowest_first() -> None:
    unit = CodedUnit(1)
    assert answer(unit, bytes.fromhex("0f 012c 000a 02 cd01")) == bytes.fromhex("0f 012c 000a")
    assert unit.writes == [(Function.COIL, 300, (1, 0, 1, 1, 0, 0, 1, 1, 1, 0))]


def test_a_loop_back_comes_back() -> None:
    assert answer(CodedUnit(1), bytes.fromhex("08 0000 a537")) == bytes.fromhex("08 0000 a537")


async def talk(data: list[bytes], *, rtu: bool) -> bytes:
    server = ModbusServer({1: CodedUnit(1)})
    reader, writer = await asyncio.open_connection("127.0.0.1", await server.listen("127.0.0.1", 0, rtu=rtu))
    for piece in data:
        writer.write(piece)
        await writer.drain()
        await asyncio.sleep(0.01)
    writer.write_eof()
    received = await reader.read()
    writer.close()
    await server.close()
    return received


def framed(text: str) -> bytes:
    body = bytes.fromhex(text)
    return body + crc(body)


async def test_two_requests_in_one_segment_are_both_answered() -> None:
    first, second = bytes.fromhex("0001 0000 0006 01 03 0000 0001"), bytes.fromhex("0002 0000 0006 01 03 0001 0001")
    received = await talk([first + second], rtu=False)
    assert (received[:2], received[11:13]) == (b"\0\1", b"\0\2")


async def test_a_serial_unit_is_silent_when_it_is_not_meant() -> None:
    assert await talk([framed("02 03 0000 0001")], rtu=True) == b""


async def test_a_serial_unit_is_silent_when_the_check_sum_is_wrong_and_answers_the_next() -> None:
    request = framed("01 03 0000 0001")
    received = await talk([request[:-1] + b"\0", request], rtu=True)
    assert received == framed(f"01 03 02 {code(1, Function.HOLDING, 0):04x}")


async def test_a_serial_request_may_come_in_pieces() -> None:
    request = framed("01 10 012c 0002 04 00010002")
    assert await talk([request[:3], request[3:9], request[9:]], rtu=True) == framed("01 10 012c 0002")
