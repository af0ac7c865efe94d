"""Answers that a serial line still owes: what may come late, and must not pass for the answer to something else.

Modbus RTU has no transaction number. An answer tells its unit, its function, and how many bytes it holds (a write's:
what was written where); nothing else tells it from an answer to an older request. So every request that was given up
is remembered for as long as its answer may come, and nothing is asked meanwhile whose answer would look the same: a
block is asked for with a few registers more (`distinct`), which no late answer can be taken for, whatever their order.
A refusal tells its unit and function only. It counts when more of them came than older requests of other content are
without an answer, since each request has one answer at the most.
"""

from __future__ import annotations

import math
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
    request: bytes
    look: Look
    until: float
    """Monotonic seconds."""
    refusal_came: bool
    """It was given up because of a refusal that may have been for an older request."""


class OwedAnswers:
    """The answers that one line owes."""

    def __init__(
        self,
        monotonic: Callable[[], float],
        timeout: float,
        crc: Callable[[bytes], bytes],
        *,
        others_asked: bool = False,
    ) -> None:
        """`timeout` in seconds; `crc` gives the two bytes that end a frame.

        `others_asked`: until a moment ago another process may have used the line, and what it asked is not known.
        """
        self._monotonic = monotonic
        self._seconds = LATEST * timeout
        self._crc = crc
        self._owed: list[_Owed] = []
        self._unknown_until = monotonic() + self._seconds if others_asked else -math.inf
        self._edges: set[tuple[int, int, int]] = set()
        """Unit, function and address that a unit refused to be asked for beside what the map names."""

    def give_up(self, request: bytes, *, refusal_came: bool = False) -> None:
        """Remember that the answer to a request (its frame without check sum) was not waited for any longer."""
        until = self._monotonic() + self._seconds
        self._owed = [*self._running(), _Owed(request, look_of(request), until, refusal_came)]

    def is_owed(self, look: Look) -> bool:
        """Tell whether an older answer that looks so may still come."""
        return any(owed.look == look for owed in self._running())

    def may_be_older(self, request: bytes) -> bool:
        """Tell whether a refusal that has just come for a request may be the answer to an older one."""
        if self._monotonic() < self._unknown_until:
            return True
        owed = [owed for owed in self._running() if owed.request[:2] == request[:2]]
        refusals = 1 + sum(one.refusal_came for one in owed)
        return refusals <= sum(one.request != request for one in owed)

    def owes_nothing_like(self, request: bytes) -> bool:
        """Tell whether no older answer of this unit and function can come."""
        known = self._monotonic() >= self._unknown_until
        return known and all(owed.request[:2] != request[:2] for owed in self._running())

    def wait(self, request: ReadRequest) -> float:
        """Return the seconds until no older answer that looks like this one's can come any more."""
        look = _read_look(request)
        until = max((owed.until for owed in self._running() if owed.look == look), default=-math.inf)
        return max(0.0, until - self._monotonic(), self._unknown_until - self._monotonic())

    def distinct(self, request: ReadRequest) -> ReadRequest | None:
        """Return a read of the same addresses, and a few more, whose answer looks like none that is owed; or None."""
        if self._monotonic() < self._unknown_until:
            return None
        step = 8 if request.function.holds_bits else 1
        for extra in range(MOST_EXTRA + 1):
            count = request.count + extra * step
            for address in (request.address, request.address - extra * step)[: 2 if extra else 1]:
                asked = replace(request, address=address, count=count)
                if self._may_be_asked(asked, request) and not self.is_owed(_read_look(asked)):
                    return asked
        return None

    def refused(self, asked: ReadRequest, request: ReadRequest) -> None:
        """Remember that a unit refused to be read beyond what the map asks for."""
        for address in _beside(asked, request):
            self._edges.add((request.device_id, request.function.read_code, address))

    def _may_be_asked(self, asked: ReadRequest, request: ReadRequest) -> bool:
        if asked.count > request.function.longest_read or asked.address < 0 or asked.address + asked.count > 0x10000:
            return False
        key = (request.device_id, request.function.read_code)
        return all((*key, address) not in self._edges for address in _beside(asked, request))

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


def _beside(asked: ReadRequest, request: ReadRequest) -> range:
    """Return the addresses that are asked for beside those of the request."""
    if asked.address < request.address:
        return range(asked.address, request.address)
    return range(request.address + request.count, asked.address + asked.count)
