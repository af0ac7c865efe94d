"""Is this the answer to what was asked? Pure checks on bytes, stricter than pymodbus' own.

Measured with pymodbus 3.16.1, its client takes 2 registers for a request of 10, function 4 for 3, a write echo
with another address and value, an odd byte count, and on a serial line a late answer to the request before.
Here an answer counts only if unit, function, length and echo are exactly those that the request calls for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

READ_BITS = (1, 2)
READ_REGISTERS = (3, 4)
WRITE_ONE = (5, 6)
WRITE_MANY = (15, 16)

LONGEST_PDU = 253
"""Bytes, function code included (Modbus Application Protocol V1.1b3, section 4.1)."""


class MisfitError(Exception):
    """The bytes are no answer to the request."""


class TornStreamError(MisfitError):
    """The byte stream has lost its frame borders: nothing that follows on it can be trusted."""


def check_pdu(request: bytes, answer: bytes) -> None:
    """Raise MisfitError unless `answer` can be the answer to `request` (both from the function code on)."""
    function = request[0]
    if not answer:
        raise MisfitError("an empty answer")
    if answer[0] == function | 0x80:
        if len(answer) != 2 or answer[1] == 0:
            raise MisfitError(f"a malformed exception of {len(answer)} bytes")
        return
    if answer[0] != function:
        raise MisfitError(f"function {answer[0]} instead of {function}")
    if function in READ_BITS or function in READ_REGISTERS:
        expected = _data_bytes(request)
        if len(answer) != 2 + expected or answer[1] != expected:
            raise MisfitError(f"{len(answer) - 2} data bytes, byte count {answer[1:2].hex()}, instead of {expected}")
    elif function in WRITE_MANY:
        if answer != request[:5]:
            raise MisfitError("the echo names another address or count than was written")
    elif answer != request:
        raise MisfitError("the echo differs from what was sent")


def _data_bytes(request: bytes) -> int:
    count = int.from_bytes(request[3:5], "big")
    return (count + 7) // 8 if request[0] in READ_BITS else 2 * count


def first_tcp_frame(stream: bytes) -> int:
    """Return the length of the whole frame that `stream` begins with, 0 while it is incomplete.

    Raises TornStreamError where the stream does not begin with a Modbus TCP header.
    """
    if len(stream) >= 4 and stream[2:4] != b"\0\0":
        raise TornStreamError(f"protocol {stream[2:4].hex()} instead of 0000")
    if len(stream) < 6:
        return 0
    length = int.from_bytes(stream[4:6], "big")
    if not 2 <= length <= LONGEST_PDU + 1:
        raise TornStreamError(f"a frame length of {length}")
    return length + 6 if len(stream) >= length + 6 else 0


def only_whole_frames(piece: bytes) -> bool:
    """Tell whether `piece` is nothing but sound frames, so that it is hardly the second half of one."""
    try:
        while piece and (size := first_tcp_frame(piece)):
            piece = piece[size:]
    except TornStreamError:
        return False
    return not piece


def find_rtu_answer(request: bytes, line: bytes, crc: Callable[[bytes], bytes]) -> bytes | None:
    """Look for the answer to `request` in what came over the line since it was sent.

    `request` is the frame without its check sum, `crc` gives the two bytes that end a frame. Returns the
    answer from its function code on, or None while there is none yet. Bytes before the answer are
    passed over (line noise, or the end of a frame for somebody else). Raises MisfitError for a sound frame from
    the right unit and function that does not fit, and for bytes after the answer: one of the two is then the
    answer to something else.
    """
    unit, function = request[0], request[1]
    for start, end in sound_frames(line, crc):
        if line[start] != unit or line[start + 1] & 0x7F != function:
            continue
        check_pdu(request[1:], line[start + 1 : end - 2])
        if end != len(line):
            raise MisfitError(f"{len(line) - end} bytes more than one answer")
        return line[start + 1 : end - 2]
    return None


def sound_frames(line: bytes, crc: Callable[[bytes], bytes]) -> Iterator[tuple[int, int]]:
    """Yield where each answer with a right check sum begins and ends, one after the other."""
    start = 0
    while start < len(line) - 4:
        end = _rtu_end(line, start)
        if end and end <= len(line) and crc(line[start : end - 2]) == line[end - 2 : end]:
            yield start, end
            start = end
        else:
            start += 1


def _rtu_end(line: bytes, start: int) -> int:
    """Return where an answer that begins at `start` ends, by its own function code and byte count; 0 for no answer."""
    function = line[start + 1]
    if function & 0x80:
        return start + 5
    if function in READ_BITS or function in READ_REGISTERS:
        return start + 5 + line[start + 2]
    return start + 8 if function in (*WRITE_ONE, *WRITE_MANY) else 0
