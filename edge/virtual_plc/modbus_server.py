"""Answers Modbus requests over TCP or a serial line.

It shares no code for frames with the client, so that the client meets a stranger.
Why not pymodbus' server: it answers for units that it does not have (a serial line needs silence there), and each
request waits for two more turns of its event loop (`python -m benchmarks.bus` compares the two).
"""

from __future__ import annotations

import asyncio
import struct
from collections.abc import Mapping, Sequence
from typing import Protocol, cast

from igrow.edge.bus.serial_port import open_serial_port
from igrow.edge.hand_off import HandOff
from igrow.edge.registers.model import Function, Parity
from igrow.edge.virtual_plc.memory import AnswerWithExceptionError

ILLEGAL_FUNCTION = 1
ILLEGAL_VALUE = 3

_READS = {function.read_code: function for function in Function}
_STALE = 0.1
"""Seconds after which half a request on a serial line is noise."""


class Unit(Protocol):
    """One Modbus unit. Both calls may raise AnswerWithExceptionError."""

    def read(self, function: Function, address: int, count: int) -> Sequence[int]:
        """Return registers (0 to 65535) or bits (0, 1)."""
        ...

    def write(self, function: Function, address: int, values: Sequence[int]) -> None:
        """Store registers or bits."""
        ...


def answer(unit: Unit, request: bytes) -> bytes:
    """Return the answer to a request, both from the function code on."""
    code = request[0]
    try:
        if code in _READS:
            return _read(unit, request)
        if code in (5, 6):
            address, value = struct.unpack(">HH", request[1:5])
            if code == 5 and value not in (0, 0xFF00):
                raise AnswerWithExceptionError(ILLEGAL_VALUE)
            function, content = (Function.COIL, int(value != 0)) if code == 5 else (Function.HOLDING, value)
            unit.write(function, address, [content])
            return request[:5]
        if code in (15, 16):
            return _write_many(unit, request)
        if code == 8 and request[1:3] == b"\0\0":
            return request
        raise AnswerWithExceptionError(ILLEGAL_FUNCTION)
    except AnswerWithExceptionError as error:
        return bytes((code | 0x80, error.code))
    except struct.error:
        return bytes((code | 0x80, ILLEGAL_VALUE))


def _read(unit: Unit, request: bytes) -> bytes:
    function = _READS[request[0]]
    address, count = struct.unpack(">HH", request[1:5])
    if not 1 <= count <= function.longest_read:
        raise AnswerWithExceptionError(ILLEGAL_VALUE)
    values = unit.read(function, address, count)
    if function.holds_bits:
        data = sum(bit << place for place, bit in enumerate(values)).to_bytes((count + 7) // 8, "little")
    else:
        data = struct.pack(f">{count}H", *values)
    return bytes((request[0], len(data))) + data


def _write_many(unit: Unit, request: bytes) -> bytes:
    address, count, size = struct.unpack(">HHB", request[1:6])
    data = request[6:]
    bits = request[0] == 15
    expected = (count + 7) // 8 if bits else 2 * count
    if not 1 <= count <= (1968 if bits else 123) or size != expected or len(data) != size:
        raise AnswerWithExceptionError(ILLEGAL_VALUE)
    if bits:
        word = int.from_bytes(data, "little")
        unit.write(Function.COIL, address, [word >> place & 1 for place in range(count)])
    else:
        unit.write(Function.HOLDING, address, struct.unpack(f">{count}H", data))
    return request[:5]


def crc(frame: bytes) -> bytes:
    """Return the two bytes of check sum that end an RTU frame (Modbus over Serial Line V1.02, section 6.2.2)."""
    register = 0xFFFF
    for byte in frame:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ 0xA001 if register & 1 else register >> 1
    return register.to_bytes(2, "little")


class _TcpConnection(asyncio.Protocol):
    def __init__(self, units: Mapping[int, Unit], connections: set[asyncio.Transport]) -> None:
        self._units = units
        self._connections = connections
        self._received = b""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)
        self._connections.add(self._transport)

    def connection_lost(self, exc: Exception | None) -> None:
        self._connections.discard(self._transport)

    def data_received(self, data: bytes) -> None:
        self._received += data
        while len(self._received) >= 8:
            protocol, length = struct.unpack(">HH", self._received[2:6])
            if protocol != 0 or not 2 <= length <= 254:
                self._transport.close()
                return
            if len(self._received) < 6 + length:
                return
            frame, self._received = self._received[: 6 + length], self._received[6 + length :]
            unit = self._units.get(frame[6])
            if unit is not None:
                reply = answer(unit, frame[7:])
                head = frame[:4] + (len(reply) + 1).to_bytes(2, "big") + frame[6:7]
                self._transport.write(head + reply)


class _SerialConnection(asyncio.Protocol):
    """RTU frames, from a serial port or inside TCP. Silent for units that are not here and for broken frames."""

    def __init__(self, units: Mapping[int, Unit], connections: set[asyncio.Transport]) -> None:
        self._units = units
        self._connections = connections
        self._received = b""
        self._last = 0.0
        self._loop = asyncio.get_running_loop()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)
        self._connections.add(self._transport)

    def connection_lost(self, exc: Exception | None) -> None:
        self._connections.discard(self._transport)

    def data_received(self, data: bytes) -> None:
        now = self._loop.time()
        if now - self._last > _STALE:
            self._received = b""
        self._last = now
        self._received += data
        while len(self._received) >= 8:
            size = 8
            if self._received[1] in (15, 16):
                size = 9 + self._received[6]
            if len(self._received) < size:
                return
            frame = self._received[:size]
            if crc(frame[:-2]) != frame[-2:]:
                self._received = self._received[1:]
                continue
            self._received = self._received[size:]
            unit = self._units.get(frame[0])
            if unit is not None:
                reply = frame[:1] + answer(unit, frame[1:-2])
                self._transport.write(reply + crc(reply))


class ModbusServer:
    """Serves units on TCP (Modbus TCP, or RTU frames with `rtu=True`) and on serial ports."""

    def __init__(self, units: Mapping[int, Unit]) -> None:
        """`units` by device id."""
        self._units = units
        self._listeners: list[asyncio.Server] = []
        self._connections: set[asyncio.Transport] = set()

    async def listen(self, host: str, port: int, *, rtu: bool = False) -> int:
        """Listen on a TCP port (0 takes a free one) and return its number. Raises OSError."""
        kind = _SerialConnection if rtu else _TcpConnection
        loop = asyncio.get_running_loop()
        listener = await loop.create_server(lambda: kind(self._units, self._connections), host, port)
        self._listeners.append(listener)
        return int(listener.sockets[0].getsockname()[1])

    async def serve_serial(self, serial_port: str, baudrate: int, parity: Parity) -> None:
        """Answer on a serial port. Raises OSError."""
        await open_serial_port(
            _SerialConnection(self._units, self._connections),
            serial_port,
            baudrate,
            parity,
            1,
            HandOff("serial port"),
        )

    def drop_connections(self) -> None:
        """Hang up on every client, as a PLC does that restarts; it may connect again."""
        for connection in tuple(self._connections):
            connection.close()

    async def close(self) -> None:
        """Stop listening and hang up."""
        for listener in self._listeners:
            listener.close()
        self.drop_connections()
        for listener in self._listeners:
            await listener.wait_closed()
        self._listeners.clear()
