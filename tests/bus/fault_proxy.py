"""A proxy between client and server that spoils answers, driven by a seeded generator.

It understands frames, so that each fault is one that a network, a gateway, a line or a bad device makes. What it
does not do is what no client can see: on a serial line (no transaction numbers, but a check sum) it does not
replay old answers; on TCP (the reverse) it does not alter the data bytes of an answer.
"""

from __future__ import annotations

import asyncio
import random
from dataclasses import dataclass
from enum import Enum
from typing import cast

from igrow.edge.virtual_plc.modbus_server import crc


class Fault(Enum):
    """What happens to one answer."""

    NONE = "none"
    SLOW = "slow"
    LATE = "late"
    PIECES = "pieces"
    NO_REQUEST = "no request"
    NO_ANSWER = "no answer"
    TRUNCATED = "truncated"
    TORN = "truncated, the rest late"
    GARBLED = "garbled"
    GARBLED_REQUEST = "garbled request"
    DUPLICATED = "duplicated"
    REPLAYED = "an old answer first"
    WRONG_UNIT = "wrong unit"
    WRONG_FUNCTION = "wrong function"
    WRONG_COUNT = "wrong count"
    WRONG_ECHO = "wrong content or echo"
    WRONG_TRANSACTION = "wrong transaction"
    EXCEPTION = "exception"
    NOISE = "noise around it"
    HANG_UP = "hang up"
    HALF_AND_HANG_UP = "half of it, then hang up"
    RECONNECT_STORM = "hang up, then on each of the next connections too"


SERIAL = [fault for fault in Fault if fault not in (Fault.REPLAYED, Fault.WRONG_TRANSACTION)]
NETWORK = [fault for fault in Fault if fault not in (Fault.GARBLED_REQUEST, Fault.NOISE)]


@dataclass
class Frame:
    """One Modbus frame taken apart."""

    rtu: bool
    transaction: int
    unit: int
    pdu: bytes

    def to_bytes(self) -> bytes:
        if self.rtu:
            body = bytes((self.unit,)) + self.pdu
            return body + crc(body)
        head = self.transaction.to_bytes(2, "big") + b"\0\0" + (len(self.pdu) + 1).to_bytes(2, "big")
        return head + bytes((self.unit,)) + self.pdu


def take_frame(stream: bytes, rtu: bool, request: bool) -> tuple[Frame | None, bytes]:
    """Cut the first whole frame off a stream of sound frames."""
    if not rtu:
        if len(stream) < 8 or len(stream) < (size := int.from_bytes(stream[4:6], "big") + 6):
            return None, stream
        return Frame(False, int.from_bytes(stream[:2], "big"), stream[6], stream[7:size]), stream[size:]
    if len(stream) < 5:
        return None, stream
    function = stream[1]
    if function & 0x80:
        size = 5
    elif request:
        size = 9 + stream[6] if function in (15, 16) and len(stream) > 6 else 8
    else:
        size = 5 + stream[2] if function in (1, 2, 3, 4) else 8
    if len(stream) < size:
        return None, stream
    return Frame(True, 0, stream[0], stream[1 : size - 2]), stream[size:]


class FaultProxy:
    """Listens, and passes on to a server what it hears, with faults at a given rate."""

    def __init__(self, port: int, *, rtu: bool, seed: int, rate: float, timeout: float) -> None:
        """`port` of the server behind; `timeout` is the client's, in seconds, which "late" refers to."""
        self.behind = port
        self.rtu = rtu
        self.rate = rate
        self.timeout = timeout
        self.random = random.Random(seed)
        self.faults: list[Fault] = []
        """What was done, answer by answer."""
        self.slow = 0.0
        """Seconds that each answer takes, one after the other."""
        self.refuses_truly = False
        """A write that is answered with an exception was not done; else the exception takes the place of its echo."""
        self.most_requests: int | None = None
        """It hangs up when it has answered so many on one connection."""
        self.storm = 0
        """How many of the next connections are hung up on at once."""
        self.old_answers: list[Frame] = []
        self.last_sent = 0.0
        self.newest: asyncio.Transport | None = None
        self._server: asyncio.Server | None = None

    async def listen(self) -> int:
        self._server = await asyncio.get_running_loop().create_server(lambda: _Front(self), "127.0.0.1", 0)
        return int(self._server.sockets[0].getsockname()[1])

    def close(self) -> None:
        if self._server is not None:
            self._server.close()

    def next_fault(self) -> Fault:
        fault = Fault.NONE
        if self.random.random() < self.rate:
            fault = self.random.choice(SERIAL if self.rtu else NETWORK)
        self.faults.append(fault)
        return fault


class _Back(asyncio.Protocol):
    """The connection to the server behind."""

    def __init__(self, front: _Front) -> None:
        self.front = front
        self.received = b""

    def data_received(self, data: bytes) -> None:
        self.received += data
        while True:
            frame, self.received = take_frame(self.received, self.front.proxy.rtu, request=False)
            if frame is None:
                return
            self.front.answer(frame)


class _Front(asyncio.Protocol):
    """The connection from the client."""

    def __init__(self, proxy: FaultProxy) -> None:
        self.proxy = proxy
        self.received = b""
        self.answers = 0
        self.pending: list[Fault] = []
        self.back: asyncio.Transport | None = None
        self.unsent = b""
        self.loop = asyncio.get_running_loop()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport = cast(asyncio.Transport, transport)
        if self.proxy.storm > 0:
            self.proxy.storm -= 1
            self.loop.call_soon(self.transport.close)
            return
        self.proxy.newest = self.transport
        self.connecting = self.loop.create_task(self.connect())

    async def connect(self) -> None:
        transport, _ = await self.loop.create_connection(lambda: _Back(self), "127.0.0.1", self.proxy.behind)
        self.back = transport
        self.back.write(self.unsent)
        if self.transport.is_closing():
            self.back.close()

    def connection_lost(self, exc: Exception | None) -> None:
        if self.back is not None:
            self.back.close()

    def data_received(self, data: bytes) -> None:
        self.received += data
        while True:
            frame, self.received = take_frame(self.received, self.proxy.rtu, request=True)
            if frame is None:
                return
            fault = self.proxy.next_fault()
            if fault is Fault.NO_REQUEST:
                continue
            if fault is Fault.EXCEPTION and self.proxy.refuses_truly and frame.pdu[0] in (5, 6, 15, 16):
                self.send(self.spoil(frame, fault).to_bytes())
                continue
            raw = frame.to_bytes()
            if fault is Fault.GARBLED_REQUEST:
                self.pass_on(self.garble(raw, 0, len(raw)))
                continue
            self.pending.append(fault)
            self.pass_on(raw)

    def pass_on(self, data: bytes) -> None:
        if self.back is None:
            self.unsent += data
        else:
            self.back.write(data)

    def garble(self, raw: bytes, start: int, end: int) -> bytes:
        """Flip one to eight bits of one byte: a CRC of 16 bits sees every such burst."""
        place = self.proxy.random.randrange(start, end)
        flipped = raw[place] ^ self.proxy.random.randrange(1, 256)
        return raw[:place] + bytes((flipped,)) + raw[place + 1 :]

    def send(self, data: bytes, after: float = 0.0) -> None:
        """Deliver `after` seconds from now; on a serial line never before what was sent earlier."""
        at = self.loop.time() + after
        if self.proxy.slow:
            at = self.proxy.last_sent = max(self.loop.time(), self.proxy.last_sent) + self.proxy.slow
        elif self.proxy.rtu:
            at = self.proxy.last_sent = max(at, self.proxy.last_sent + 1e-6)
        self.loop.call_at(at, self.deliver, data)

    def deliver(self, data: bytes) -> None:
        transport = self.transport
        if self.proxy.rtu and self.proxy.newest is not None:
            transport = self.proxy.newest  # a converter hands what the line says to whoever is connected
        if not transport.is_closing():
            transport.write(data)
        self.answers += 1
        if self.answers == self.proxy.most_requests:
            self.transport.close()

    def answer(self, frame: Frame) -> None:
        fault = self.pending.pop(0) if self.pending else Fault.NONE
        random_, timeout = self.proxy.random, self.proxy.timeout
        raw = frame.to_bytes()
        half = random_.randrange(1, len(raw))
        if fault is Fault.SLOW:
            self.send(raw, random_.uniform(0.05, 0.9) * timeout)
        elif fault is Fault.LATE:
            self.send(raw, random_.uniform(1.01, 1.9) * timeout)
        elif fault is Fault.PIECES:
            self.send(raw[:half])
            self.send(raw[half:], 0.02 * timeout)
        elif fault is Fault.NONE:
            self.send(raw, random_.choice([0.0, random_.uniform(0.0, 0.3)]) * timeout)
        elif fault is Fault.NO_ANSWER:
            pass
        elif fault is Fault.TRUNCATED:
            self.send(raw[:half])
        elif fault is Fault.TORN:
            self.send(raw[:half])
            self.send(raw[half:], random_.uniform(1.01, 1.9) * timeout)
        elif fault is Fault.GARBLED:
            self.send(self.garble(raw, 0, len(raw) if frame.rtu else 8))
        elif fault is Fault.DUPLICATED:
            self.send(raw)
            self.send(raw, 0.0 if frame.rtu else random_.uniform(0.0, 0.1) * timeout)
        elif fault is Fault.REPLAYED:
            for old in self.proxy.old_answers[-3:]:
                self.send(old.to_bytes())
            self.send(raw)
        elif fault is Fault.NOISE:
            noise = bytes(random_.randrange(256) for _ in range(random_.randrange(1, 6)))
            self.send(noise + raw if random_.random() < 0.5 else raw + noise)
        elif fault in (Fault.HANG_UP, Fault.HALF_AND_HANG_UP, Fault.RECONNECT_STORM):
            if fault is Fault.HALF_AND_HANG_UP:
                self.send(raw[:half])
            if fault is Fault.RECONNECT_STORM:
                self.proxy.storm = random_.randrange(1, 6)
            self.transport.close()
        else:
            self.send(self.spoil(frame, fault).to_bytes())
        self.proxy.old_answers = [*self.proxy.old_answers[-3:], frame]

    def spoil(self, frame: Frame, fault: Fault) -> Frame:
        """Return a well-formed frame that is not the right one."""
        random_ = self.proxy.random
        unit, pdu, transaction = frame.unit, frame.pdu, frame.transaction
        if fault is Fault.WRONG_UNIT:
            unit = random_.choice([other for other in (1, 2, 3, 255) if other != unit])
        elif fault is Fault.WRONG_TRANSACTION:
            transaction = random_.choice([0, transaction + 1, transaction - 1]) & 0xFFFF
        elif fault is Fault.WRONG_FUNCTION:
            pdu = bytes((random_.choice([f for f in (1, 3, 4, 6, 16) if f != pdu[0] & 0x7F]),)) + pdu[1:]
        elif fault is Fault.EXCEPTION:
            pdu = bytes((pdu[0] | 0x80, random_.choice((1, 2, 3, 4, 5, 6, 10, 11))))
        elif fault is Fault.WRONG_COUNT and pdu[0] in (1, 2, 3, 4):
            data = pdu[2:]
            data = random_.choice([data[:-1], data[:-2], data + data[:1], data + data[:2], b""])
            pdu = bytes((pdu[0], random_.choice([len(data), pdu[1]]))) + data
            if pdu == frame.pdu:
                pdu = bytes((pdu[0], 0))
        elif fault in (Fault.WRONG_ECHO, Fault.WRONG_COUNT) and pdu[0] in (5, 6, 8, 15, 16):
            pdu = self.garble(pdu, 1, 5)
        return Frame(frame.rtu, transaction, unit, pdu)
