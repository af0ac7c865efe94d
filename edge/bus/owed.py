"""Answers that a serial line still owes: what may come late, and must not pass for the answer to something else.

Modbus RTU has no transaction number. An answer tells its unit, its function, and how many bytes it holds (a write's:
what was written where); nothing else tells it from an answer to an older request. So every request that was given up
is remembered for as long as its answer may come, and nothing is asked meanwhile whose answer would look the same: a
block is asked for with a register more (`distinct`), which no late answer can be taken for, whatever their order.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from igrow.edge.bus.answer_check import READ_BITS, READ_REGISTERS, sound_frames
from igrow.edge.bus.protocol import ReadRequest

LATEST = 20.0
"""Timeouts after which an answer no longer comes. Slower than this is no unit, nor a converter that queues for it."""
MOST_EXTRA = 4
"""Registers (or bytes of bits) that a block is lengthened by at most, when several of its answers are owed."""

Look = tuple[int, int, bytes]
"""What an answer looks like: unit, function, and the bytes that must follow (a read's byte count, a write's echo)."""


@dataclass(frozen=True, slots=True)
class _Owed:
    look: Look
    until: float
    """Monotonic seconds."""


class OwedAnswers:
    """The answers that one line owes."""

    def __init__(self, monotonic: Callable[[], float], timeout: float, crc: Callable[[bytes], bytes]) -> None:
        """`timeout` in seconds; `crc` gives the two bytes that end a frame."""
        self._monotonic = monotonic
        self._seconds = LATEST * timeout
        self._crc = crc
        self._owed: list[_Owed] = []
        self._ends: set[tuple[int, int, int]] = set()
        """Unit, function and address beyond which a unit refused to be read."""

    def give_up(self, request: bytes) -> None:
        """Remember that the answer to a request (its frame without check sum) was not waited for any longer."""
        self._owed = [*self._running(), _Owed(look_of(request), self._monotonic() + self._seconds)]

    def is_owed(self, look: Look) -> bool:
        """Tell whether an older answer that looks so may still come."""
        return any(owed.look == look for owed in self._running())

    def owes_any(self, unit: int, function: int) -> bool:
        """Tell whether an older answer of this function may still come; a refusal tells no more than that."""
        return any(owed.look[:2] == (unit, function) for owed in self._running())

    def wait(self, request: ReadRequest) -> float:
        """Return the seconds until no older answer that looks like this one's can come any more."""
        look = _read_look(request)
        return max((owed.until - self._monotonic() for owed in self._running() if owed.look == look), default=0.0)

    def distinct(self, request: ReadRequest) -> ReadRequest | None:
        """Return a read of the same addresses, and a few more, whose answer looks like none that is owed; or None."""
        step = 8 if request.function.holds_bits else 1
        for extra in range(MOST_EXTRA + 1):
            asked = replace(request, count=request.count + extra * step)
            if asked.count > request.function.longest_read or asked.address + asked.count > 0x10000:
                break
            if extra and any(end <= asked.address + asked.count for end in self._refused_ends(request)):
                break
            if not self.is_owed(_read_look(asked)):
                return asked
        return None

    def refused(self, asked: ReadRequest, request: ReadRequest) -> None:
        """Remember that a unit refused to be read beyond what the map asks for."""
        self._ends.add((request.device_id, request.function.read_code, asked.address + asked.count))

    def arrived(self, piece: bytes) -> bytes:
        """Cross off what is owed and stands in a piece of the line's talk; returns the piece without it."""
        if not self._owed:
            return piece
        for start, end in sound_frames(piece, self._crc):
            if self._cross_off(piece[start:end]):
                return piece[:start] + self.arrived(piece[end:])
        return piece

    def _cross_off(self, frame: bytes) -> bool:
        look = look_of_answer(frame)
        for owed in self._running():
            if owed.look == look:
                self._owed.remove(owed)
                return True
        return False

    def _running(self) -> list[_Owed]:
        now = self._monotonic()
        self._owed = [owed for owed in self._owed if owed.until > now]
        return self._owed

    def _refused_ends(self, request: ReadRequest) -> list[int]:
        key = (request.device_id, request.function.read_code)
        first = request.address + request.count
        return [end for unit, function, end in self._ends if (unit, function) == key and end > first]


def look_of(request: bytes) -> Look:
    """Return what the answer to a request (its frame without check sum) looks like."""
    unit, function = request[0], request[1]
    count = int.from_bytes(request[4:6], "big")
    if function in READ_BITS:
        return unit, function, bytes(((count + 7) // 8,))
    if function in READ_REGISTERS:
        return unit, function, bytes((2 * count,))
    return unit, function, request[2:6]


def look_of_answer(frame: bytes) -> Look:
    """Return what an answer (its whole frame) looks like."""
    function = frame[1]
    return frame[0], function, frame[2:3] if function in READ_BITS or function in READ_REGISTERS else frame[2:6]


def _read_look(request: ReadRequest) -> Look:
    function, count = request.function, request.count
    size = (count + 7) // 8 if function.holds_bits else 2 * count
    return request.device_id, function.read_code, bytes((size,))
