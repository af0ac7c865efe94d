"""Only the answer to what was asked counts: the mistakes that were measured with pymodbus, one by one."""

from __future__ import annotations

from pathlib import Path

import pytest

from igrow.edge.bus.answer_check import (
    MisfitError,
    TornStreamError,
    check_pdu,
    find_rtu_answer,
    first_tcp_frame,
    only_whole_frames,
)
from igrow.edge.registers.codec import decode
from igrow.edge.registers.loading import load_register_map
from igrow.edge.virtual_plc.modbus_server import crc

MAPS = Path(__file__).parents[2] / "config" / "register-maps"

READ_10 = bytes((3, 0, 0, 0, 10))
READ_COILS_9 = bytes((1, 0, 0, 0, 9))
WRITE_ONE = bytes((6, 0, 5, 0x12, 0x34))
WRITE_TWO = bytes((16, 0, 5, 0, 2, 4, 1, 2, 3, 4))


@pytest.mark.parametrize(
    ("request_pdu", "answer"),
    [
        (READ_10, bytes((3, 20)) + bytes(20)),
        (READ_COILS_9, bytes((1, 2, 0xFF, 1))),
        (WRITE_ONE, WRITE_ONE),
        (WRITE_TWO, WRITE_TWO[:5]),
        (READ_10, bytes((0x83, 2))),
    ],
    ids=["registers", "bits", "one register written", "two registers written", "an exception"],
)
def test_the_right_answer_is_taken(request_pdu: bytes, answer: bytes) -> None:
    check_pdu(request_pdu, answer)


@pytest.mark.parametrize(
    ("request_pdu", "answer"),
    [
        (READ_10, bytes((3, 4)) + bytes(4)),
        (READ_10, bytes((3, 20)) + bytes(19)),
        (READ_10, bytes((3, 21)) + bytes(21)),
        (READ_10, bytes((3, 19)) + bytes(20)),
        (READ_10, bytes((4, 20)) + bytes(20)),
        (READ_10, bytes((0x84, 2))),
        (READ_10, bytes((0x83,))),
        (READ_10, bytes((0x83, 0))),
        (READ_10, b""),
        (READ_COILS_9, bytes((1, 1, 0xFF))),
        (WRITE_ONE, bytes((6, 0, 6, 0x12, 0x34))),
        (WRITE_ONE, bytes((6, 0, 5, 0x12, 0x35))),
        (WRITE_TWO, bytes((16, 0, 5, 0, 1))),
        (WRITE_TWO, bytes((16, 0, 6, 0, 2))),
        (WRITE_TWO, WRITE_TWO),
    ],
    ids=[
        "2 registers for 10",
        "short by a byte",
        "an odd byte count",
        "a byte count that lies",
        "function 4 for 3",
        "an exception of another function",
        "an exception without code",
        "exception 0",
        "nothing",
        "too few bits",
        "an echo with another address",
        "an echo with another value",
        "an echo with another count",
        "an echo of another place",
        "an echo too long",
    ],
)
def test_an_answer_that_does_not_fit_is_refused(request_pdu: bytes, answer: bytes) -> None:
    with pytest.raises(MisfitError):
        check_pdu(request_pdu, answer)


@pytest.mark.parametrize(
    ("stream", "size"),
    [
        (bytes.fromhex("0001 0000 0005 01 03 02 0007"), 11),
        (bytes.fromhex("0001 0000 0005 01 03 02 00"), 0),
        (bytes.fromhex("0001 0000 00"), 0),
        (b"", 0),
        (bytes.fromhex("0001 0000 0005 01 03 02 0007 0002 0000"), 11),
    ],
    ids=["whole", "incomplete", "half a header", "nothing yet", "more behind it"],
)
def test_a_tcp_stream_is_cut_into_frames(stream: bytes, size: int) -> None:
    assert first_tcp_frame(stream) == size


@pytest.mark.parametrize("stream", ["0001 0003 0005", "0001 0000 0001", "0001 0000 0100"])
def test_a_stream_without_a_header_is_torn(stream: str) -> None:
    with pytest.raises(TornStreamError):
        first_tcp_frame(bytes.fromhex(stream))


def test_a_piece_of_whole_frames_is_told_from_half_a_frame() -> None:
    frame = bytes.fromhex("0001 0000 0005 01 03 02 0007")
    assert only_whole_frames(frame)
    assert only_whole_frames(frame + frame)
    assert not any(only_whole_frames(frame[start:]) for start in range(1, len(frame)))
    assert not any(only_whole_frames(frame[:end]) for end in range(1, len(frame)))


def framed(body: bytes) -> bytes:
    return body + crc(body)


REQUEST = bytes((7, 3, 0, 0, 0, 2))
ANSWER = framed(bytes((7, 3, 4, 1, 2, 3, 4)))


def found(line: bytes) -> bytes | None:
    return find_rtu_answer(REQUEST, line, crc)


def test_an_answer_on_a_line_is_found_once_it_is_complete() -> None:
    assert [found(ANSWER[:end]) for end in range(len(ANSWER))] == [None] * len(ANSWER)
    assert found(ANSWER) == ANSWER[1:-2]


def test_noise_before_the_answer_is_passed_over() -> None:
    assert found(b"\x00\x07\x03\xff" + ANSWER) == ANSWER[1:-2]


def test_an_answer_of_another_unit_is_passed_over() -> None:
    assert found(framed(bytes((8, 3, 4, 1, 2, 3, 4)))) is None


def test_a_broken_check_sum_is_no_answer() -> None:
    assert found(ANSWER[:-1] + bytes((ANSWER[-1] ^ 1,))) is None


def test_two_answers_at_once_are_refused_since_one_belongs_to_another_request() -> None:
    with pytest.raises(MisfitError, match="more than one answer"):
        found(ANSWER + ANSWER)


def test_a_sound_answer_with_another_count_is_refused() -> None:
    with pytest.raises(MisfitError, match="instead of 4"):
        found(framed(bytes((7, 3, 2, 1, 2))))


def test_an_exception_on_a_line_is_an_answer() -> None:
    assert found(framed(bytes((7, 0x83, 2)))) == bytes((0x83, 2))


def test_the_check_sum_is_the_one_of_the_specification() -> None:
    """A frame worked out in many introductions to Modbus: 01 03 00 00 00 0A ends with C5 CD."""
    assert crc(bytes.fromhex("01030000000a")) == bytes.fromhex("c5cd")


def test_the_example_of_a_co2_probes_manual_reads_as_its_manual_says() -> None:
    """Vaisala GMP252 User Guide M211897EN-D, A.3: 43E8D47A, least significant word first, is 465.65997 ppm."""
    point = load_register_map(MAPS / "vaisala-gmp252.yaml").points["air_co2"]
    request = bytes.fromhex("f0 03 0000 0002")
    assert crc(request) == bytes.fromhex("d12a")
    answer = find_rtu_answer(request, bytes.fromhex("f0 03 04 d47a 43e8 33ab"), crc)
    assert answer is not None
    value = decode(point, (int.from_bytes(answer[2:4], "big"), int.from_bytes(answer[4:6], "big")))
    assert value == pytest.approx(465.65997)
