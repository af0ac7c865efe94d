"""A serial line whose units answer late, up to twenty timeouts, driven by a seeded generator.

Two kinds of lateness: a unit that works off its requests in their order, so that one late answer delays those behind
it; and a line with something clever on it, whose every answer takes its own time.
"""

from __future__ import annotations

import asyncio
import random
from collections.abc import Mapping
from typing import cast

from igrow.edge.registers.model import Function
from igrow.edge.virtual_plc.memory import AnswerWithExceptionError
from tests.bus.coded_unit import CodedUnit
from tests.bus.fault_proxy import Frame, take_frame

TABLES = {1: Function.COIL, 2: Function.DISCRETE_INPUT, 3: Function.HOLDING, 4: Function.INPUT}


class LateLine:
    """Listens as RTU over TCP; what it says goes to whoever is connected, as with a converter."""

    def __init__(
        self, units: Mapping[int, CodedUnit], *, seed: int, share: float, timeout: float, latest: float, in_order: bool
    ) -> None:
        """A `share` of the answers comes 1 to `latest` times `timeout` seconds after its request, others at once."""
        self.units = units
        self.random = random.Random(seed)
        self.share = share
        self.timeout = timeout
        self.latest = latest
        self.in_order = in_order
        self.late = 0
        """Answers that came later than the timeout."""
        self.requests = 0
        self.last_sent = 0.0
        self.newest: asyncio.Transport | None = None

    async def listen(self) -> int:
        server = await asyncio.get_running_loop().create_server(lambda: _End(self), "127.0.0.1", 0)
        return int(server.sockets[0].getsockname()[1])

    def take(self, frame: Frame) -> None:
        """Work off one request."""
        self.requests += 1
        if frame.unit not in self.units:
            return
        loop = asyncio.get_running_loop()
        delay = self.random.uniform(0.001, 0.3) * self.timeout
        if self.random.random() < self.share:
            delay = self.random.uniform(1.0, self.latest) * self.timeout
        at = loop.time() + delay
        if self.in_order:
            at = min(max(at, self.last_sent + 1e-4), loop.time() + self.latest * self.timeout)
            self.last_sent = at
        self.late += at - loop.time() > self.timeout
        answer = Frame(True, 0, frame.unit, self.answer(self.units[frame.unit], frame.pdu)).to_bytes()
        loop.call_at(at, self.say, answer)

    def say(self, answer: bytes) -> None:
        if self.newest is not None and not self.newest.is_closing():
            self.newest.write(answer)

    def answer(self, unit: CodedUnit, pdu: bytes) -> bytes:
        function, address, count = pdu[0], int.from_bytes(pdu[1:3], "big"), int.from_bytes(pdu[3:5], "big")
        try:
            if function in TABLES:
                content = unit.read(TABLES[function], address, count)
                if TABLES[function].holds_bits:
                    body = sum(bit << place for place, bit in enumerate(content)).to_bytes((count + 7) // 8, "little")
                else:
                    body = b"".join(word.to_bytes(2, "big") for word in content)
                return bytes((function, len(body))) + body
            if function == 6:
                unit.write(Function.HOLDING, address, (count,))
                return pdu
            words = [int.from_bytes(pdu[place : place + 2], "big") for place in range(6, 6 + pdu[5], 2)]
            unit.write(Function.HOLDING, address, words)
            return pdu[:5]
        except AnswerWithExceptionError as error:
            return bytes((function | 0x80, error.code))


class _End(asyncio.Protocol):
    """The far end of one connection."""

    def __init__(self, line: LateLine) -> None:
        self.line = line
        self.received = b""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.line.newest = cast(asyncio.Transport, transport)

    def data_received(self, data: bytes) -> None:
        self.received += data
        while True:
            frame, self.received = take_frame(self.received, True, request=True)
            if frame is None:
                return
            self.line.take(frame)
