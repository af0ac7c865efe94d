"""The one file of the bus that knows pymodbus (3.16.1, pinned: it does not follow semantic versioning).

pymodbus gives the request and answer classes, the framers with their check sum, and the serial port. Its
transaction manager is replaced, because of what it was measured to do (see `answer_check`), because it lets a
request wait out its timeout when the line breaks under it, and because it closes a TCP line that all units share
after the fifth timeout of one. A link carries one exchange at a time; who sees to that is `request_slot`.
"""

from __future__ import annotations

import asyncio
import errno
import os
import ssl
from collections.abc import Callable
from typing import cast

from pymodbus.framer import FramerRTU, FramerSocket
from pymodbus.pdu import DecodePDU, ModbusPDU
from pymodbus.pdu.bit_message import ReadCoilsRequest, ReadDiscreteInputsRequest, WriteSingleCoilRequest
from pymodbus.pdu.diag_message import ReturnQueryDataRequest
from pymodbus.pdu.register_message import (
    ReadHoldingRegistersRequest,
    ReadInputRegistersRequest,
    WriteMultipleRegistersRequest,
    WriteSingleRegisterRequest,
)
from pymodbus.transport.serialtransport import create_serial_connection

from igrow.edge.bus.answer_check import (
    MisfitError,
    TornStreamError,
    check_pdu,
    find_rtu_answer,
    first_tcp_frame,
    only_whole_frames,
)
from igrow.edge.bus.errors import (
    BadAnswerError,
    BusError,
    ConnectionLostError,
    NoAnswerError,
    NotConnectedError,
    refusal,
)
from igrow.edge.bus.protocol import ReadRequest, WriteRequest
from igrow.edge.registers.model import BusSettings, Function, Parity, Transport

_READS: dict[Function, type[ModbusPDU]] = {
    Function.COIL: ReadCoilsRequest,
    Function.DISCRETE_INPUT: ReadDiscreteInputsRequest,
    Function.HOLDING: ReadHoldingRegistersRequest,
    Function.INPUT: ReadInputRegistersRequest,
}

QUIET = 0.05
"""Seconds of silence after which a serial line counts as quiet; bridges between networks and lines chop frames
into pieces some 10 to 20 ms apart."""

LONGEST_NOISE = 1024
"""Bytes without an answer among them after which a line is given up for this request."""


async def open_serial_port(
    protocol: Callable[[], asyncio.Protocol], port: str, baudrate: int, parity: Parity, stop_bits: int
) -> None:
    """Connect a protocol to a serial port, 8 data bits. Raises OSError where the port is absent or taken."""
    await create_serial_connection(
        asyncio.get_running_loop(),
        protocol,
        port,
        baudrate=baudrate,
        bytesize=8,
        parity={Parity.NONE: "N", Parity.EVEN: "E", Parity.ODD: "O"}[parity],
        stopbits=stop_bits,
        timeout=0,
    )


class PymodbusLink(asyncio.Protocol):
    """One connection: opened, used for one exchange at a time, closed, opened again."""

    def __init__(self, settings: BusSettings, on_lost: Callable[[], None], quiet: float = QUIET) -> None:
        """`on_lost` is called whenever an open line breaks, whoever broke it."""
        self._settings = settings
        self._on_lost = on_lost
        self._quiet = quiet
        self._rtu = settings.transport.is_rtu
        self._decoder = DecodePDU(False)
        self._framer = (FramerRTU if self._rtu else FramerSocket)(self._decoder)
        self._transport: asyncio.Transport | None = None
        self._received = b""
        self._request = b""
        self._waiter: asyncio.Future[bytes] | None = None
        self._transaction = 0
        self._owed = 0
        self._last_byte = 0.0
        self._opened = asyncio.Event()
        self._loop = asyncio.get_running_loop()

    @property
    def connected(self) -> bool:
        """Tell whether the line is up."""
        return self._transport is not None

    async def open(self) -> None:
        """Connect; raises NotConnectedError, within the bus' timeout."""
        settings = self._settings
        try:
            async with asyncio.timeout(settings.timeout):
                if settings.transport is Transport.RTU:
                    self._opened.clear()
                    port = settings.serial_port
                    await open_serial_port(lambda: self, port, settings.baudrate, settings.parity, settings.stop_bits)
                    await self._opened.wait()  # pyserial's transport reports in a later turn of the event loop
                else:
                    tls = _tls_context(settings) if settings.transport is Transport.TLS else None
                    name = (settings.server_name or settings.host) if tls else None
                    await self._loop.create_connection(
                        lambda: self, settings.host, settings.port, ssl=tls, server_hostname=name
                    )
        except (OSError, TimeoutError, ValueError) as error:
            raise NotConnectedError(f"bus {settings.name}: {self._reason(error)}") from error

    def close(self) -> None:
        """Drop the line; an exchange in progress fails with ConnectionLostError."""
        transport, self._transport = self._transport, None
        self._received = b""
        if transport is not None:
            self._fail(ConnectionLostError(f"bus {self._settings.name}: the line was closed"))
            transport.close()
            self._on_lost()

    async def read(self, request: ReadRequest) -> tuple[int, ...]:
        """Return the registers or bits asked for; raises BusError."""
        pdu = _READS[request.function](address=request.address, count=request.count, dev_id=request.device_id)
        answer = await self._exchange(pdu, request)
        if request.function.holds_bits:
            return tuple(int(bit) for bit in answer.bits[: request.count])
        return tuple(answer.registers)

    async def write(self, request: WriteRequest) -> None:
        """Return once the unit has echoed the write; raises BusError."""
        pdu: ModbusPDU
        if request.function is Function.COIL:
            pdu = WriteSingleCoilRequest(address=request.address, bits=[request.values[0] != 0])
        elif len(request.values) == 1:
            pdu = WriteSingleRegisterRequest(address=request.address, registers=list(request.values))
        else:
            pdu = WriteMultipleRegistersRequest(address=request.address, registers=list(request.values))
        pdu.dev_id = request.device_id
        await self._exchange(pdu, request)

    async def loop_back(self, device_id: int, marker: int) -> None:
        """Let a unit echo `marker` (0 to 65535; diagnostics, function 8). Raises BusError.

        Function 8 reads and writes no point, so neither its echo nor its refusal can be mistaken for the answer
        to anything else: once it has come, every older request of the unit has been answered or never will be.
        """
        pdu = ReturnQueryDataRequest(message=marker.to_bytes(2, "big"), dev_id=device_id)
        await self._exchange(pdu, f"unit {device_id}, loop back")

    async def drain(self) -> None:
        """Throw away what still comes in, until the line is quiet; at most one timeout long."""
        now = self._loop.time()
        end = now + self._settings.timeout
        self._last_byte = now
        while now < (quiet_at := min(self._last_byte + self._quiet, end)):
            await asyncio.sleep(quiet_at - now)
            now = self._loop.time()
        self._received = b""

    def _reason(self, error: Exception) -> str:
        """Return why the line could not be opened, for people."""
        settings = self._settings
        if isinstance(error, TimeoutError):
            return f"no connection to {self._where} within {settings.timeout:g} s"
        if isinstance(error, OSError) and error.strerror:
            return f"no connection to {self._where}: {_words(error)}"
        return str(error)

    @property
    def _where(self) -> str:
        settings = self._settings
        return settings.serial_port or f"{settings.host}:{settings.port}"

    async def _exchange(self, pdu: ModbusPDU, what: object) -> ModbusPDU:
        transport = self._transport
        if transport is None or transport.is_closing():
            raise NotConnectedError(f"bus {self._settings.name}: not connected")
        if self._rtu:
            self._received = b""
        else:
            self._owed += 1
            self._transaction = self._transaction % 0xFFFF + 1
            pdu.transaction_id = self._transaction
        self._request = self._framer.buildFrame(pdu)
        self._waiter = waiter = self._loop.create_future()
        transport.write(self._request)
        timer = self._loop.call_later(self._settings.timeout, self._time_out)
        try:
            answer = await waiter
        except BusError as error:
            raise type(error)(f"{what}: {error}") from None
        finally:
            timer.cancel()
            self._waiter = None
        if answer[0] & 0x80:
            raise refusal(str(what), answer[1])
        decoded = self._decoder.decode(answer)
        if decoded is None:
            raise BadAnswerError(f"{what}: pymodbus cannot read the answer {answer.hex()}")
        return decoded

    def _time_out(self) -> None:
        if self._received:
            self._fail(BadAnswerError(f"{len(self._received)} bytes came that are no answer"))
            if not self._rtu:
                self.close()  # half a frame: its other half would be read as the head of the next answer
        else:
            self._fail(NoAnswerError(f"no answer within {self._settings.timeout:g} s"))

    def _fail(self, error: BusError) -> None:
        if self._waiter is not None and not self._waiter.done():
            self._waiter.set_exception(error)

    # what asyncio calls

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Take the line into use."""
        self._transport = cast(asyncio.Transport, transport)
        self._owed = 0
        self._opened.set()
        self._received = b""

    def connection_lost(self, exc: Exception | None) -> None:
        """Tell those who wait, at once, and the supervisor."""
        if self._transport is not None:
            self._transport = None
            self._fail(ConnectionLostError(f"the line broke{f' ({_words(exc)})' if exc else ''}"))
            self._on_lost()

    def data_received(self, data: bytes) -> None:
        """Gather bytes until they are the answer, or cannot become it."""
        self._last_byte = self._loop.time()
        try:
            if self._rtu:
                self._take_from_line(data)
            else:
                self._take_from_stream(data)
        except TornStreamError as error:
            self._fail(BadAnswerError(str(error)))
            self.close()
        except MisfitError as error:
            self._fail(BadAnswerError(str(error)))

    def _take_from_line(self, data: bytes) -> None:
        waiter = self._waiter
        if waiter is None or waiter.done():
            return
        self._received += data
        if len(self._received) > LONGEST_NOISE:
            self._received = b""
            raise MisfitError("the line does not stop talking")
        answer = find_rtu_answer(self._request[:-2], self._received, _check_sum)
        if answer is not None:
            waiter.set_result(answer)

    def _take_from_stream(self, data: bytes) -> None:
        # A cut answer and the head of a stale frame would join to a frame that looks sound: the three refusals here.
        if self._received and only_whole_frames(data):
            raise TornStreamError("a whole frame where the second half of one was due")
        self._received += data
        frames: list[bytes] = []
        while size := first_tcp_frame(self._received):
            frames.append(self._received[:size])
            self._received = self._received[size:]
        if self._received and self._owed > 1:
            raise TornStreamError("half a frame while older answers are still to come")
        for frame in frames:
            self._owed = max(0, self._owed - 1)
            waiter = self._waiter
            if waiter is None or waiter.done() or frame[:2] != self._request[:2]:
                continue  # the late answer to a request that was given up
            if self._received:
                raise TornStreamError("an answer with half a frame behind it")
            if frame[6] != self._request[6]:
                raise MisfitError(f"unit {frame[6]} answered instead of {self._request[6]}")
            check_pdu(self._request[7:], frame[7:])
            waiter.set_result(frame[7:])


def _check_sum(frame: bytes) -> bytes:
    return FramerRTU.compute_CRC(frame).to_bytes(2, "big")


def _tls_context(settings: BusSettings) -> ssl.SSLContext:
    context = ssl.create_default_context(cafile=settings.certificate_authority)
    if settings.certificate is not None:
        context.load_cert_chain(settings.certificate, settings.private_key)
    return context


def _words(error: Exception) -> str:
    """Return an error's reason without what asyncio and pyserial add for programmers."""
    if not isinstance(error, OSError) or not error.strerror:
        return str(error)
    # A name that is not found has a number of its own.
    return os.strerror(error.errno or 0) if error.errno in errno.errorcode else error.strerror
