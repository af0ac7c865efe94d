"""What the bus needs of pymodbus (3.16.1, pinned: it does not follow semantic versioning); no other file but
`serial_port` knows it.

pymodbus gives the request and answer classes, the framers with their check sum, and the serial port. Its
transaction manager is replaced, because of what it was measured to do (see `answer_check`), because it lets a
request wait out its timeout when the line breaks under it, and because it closes a TCP line that all units share
after the fifth timeout of one. A link carries one exchange at a time; who sees to that is `request_slot`.
"""

from __future__ import annotations

import asyncio
import contextlib
import secrets
from collections.abc import Callable
from typing import cast

from pymodbus.framer import FramerRTU, FramerSocket
from pymodbus.pdu import DecodePDU, ModbusPDU
from pymodbus.pdu.bit_message import ReadCoilsRequest, ReadDiscreteInputsRequest, WriteSingleCoilRequest
from pymodbus.pdu.register_message import (
    ReadHoldingRegistersRequest,
    ReadInputRegistersRequest,
    WriteMultipleRegistersRequest,
    WriteSingleRegisterRequest,
)

from igrow.edge.bus.addresses import Addresses
from igrow.edge.bus.answer_check import (
    MisfitError,
    TornStreamError,
    check_pdu,
    find_rtu_answer,
    first_tcp_frame,
    only_whole_frames,
    sound_frames,
)
from igrow.edge.bus.errors import (
    BadAnswerError,
    BusError,
    ConnectionLostError,
    NoAnswerError,
    NotConnectedError,
    OldAnswerError,
    refusal,
)
from igrow.edge.bus.opening import open_socket, why_not_open, words
from igrow.edge.bus.owed import OwedAnswers
from igrow.edge.bus.protocol import ReadRequest, WriteRequest
from igrow.edge.bus.serial_port import drop, open_serial_port
from igrow.edge.hand_off import HandOff, LateError
from igrow.edge.registers.model import BusSettings, Function, Transport

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
LONGEST_FRAME = 256  # bytes, RTU


class PymodbusLink(asyncio.Protocol):
    """One connection: opened, used for one exchange at a time, closed, opened again."""

    def __init__(
        self, settings: BusSettings, on_lost: Callable[[], None], quiet: float = QUIET, *, others_asked: bool = False
    ) -> None:
        """`on_lost` is called whenever an open line breaks, whoever broke it; `others_asked`: see `owed`."""
        self._settings = settings
        self._on_lost = on_lost
        self._quiet = quiet
        self._rtu = settings.transport.is_rtu
        self._decoder = DecodePDU(False)
        self._framer = (FramerRTU if self._rtu else FramerSocket)(self._decoder)
        self._transport: asyncio.Transport | None = None
        self._received = b""
        self._stray = b""
        self._request = b""
        self._what: object = None
        self._waiter: asyncio.Future[bytes] | None = None
        self._timer: asyncio.TimerHandle
        # A gateway that mixes up the answers of its clients would else give us those of one that began when we did.
        self._transaction = secrets.randbelow(0x10000)
        self._unanswered = 0
        self._last_byte = 0.0
        self._opened = asyncio.Event()
        self._aside = HandOff(f"bus {settings.name}")
        self._addresses = Addresses(settings.host)
        self._loop = asyncio.get_running_loop()
        self.owed: OwedAnswers | None = None
        """What the line may still say to requests that were given up; None where answers are numbered."""
        if self._rtu:
            self.owed = OwedAnswers(self._loop.time, settings.timeout, _check_sum, others_asked=others_asked)
        self._answered_badly = False
        """What came was an answer, and to this very request, though no good one: nothing more will come."""

    @property
    def connected(self) -> bool:
        """Tell whether the line is up."""
        return self._transport is not None

    async def open(self) -> None:
        """Connect; raises NotConnectedError, within the bus' timeout."""
        settings = self._settings
        try:
            async with asyncio.timeout(settings.timeout):
                self._opened.clear()
                if settings.transport is Transport.RTU:
                    port = (settings.serial_port, settings.baudrate, settings.parity, settings.stop_bits)
                    await open_serial_port(self, *port, self._aside)
                else:
                    await open_socket(settings, self, self._addresses, self._aside)
                await self._opened.wait()  # pyserial's transport reports in a later turn of the event loop
        except (OSError, TimeoutError, ValueError, LateError) as error:
            raise NotConnectedError(f"bus {settings.name}: {why_not_open(settings, error)}") from error

    def close(self) -> None:
        """Drop the line; an exchange in progress fails with ConnectionLostError."""
        transport, self._transport = self._transport, None
        self._received = b""
        if transport is not None:
            self._fail(ConnectionLostError(f"bus {self._settings.name}: the line was closed"))
            drop(transport)
            self._on_lost()

    def retire(self) -> None:
        """Drop the line for good, and let go of the threads that open it; one that hangs is left behind."""
        self.close()
        self._aside.close(0.0)
        self._addresses.close()

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

    async def drain(self) -> None:
        """Throw away what still comes in, until the line is quiet; at most one timeout long."""
        now = self._loop.time()
        end = now + self._settings.timeout
        self._last_byte = now
        while now < (quiet_at := min(self._last_byte + self._quiet, end)):
            await asyncio.sleep(quiet_at - now)
            now = self._loop.time()
        self._received = b""

    async def _exchange(self, pdu: ModbusPDU, what: object) -> ModbusPDU:
        transport = self._transport
        if transport is None or transport.is_closing():
            raise NotConnectedError(f"bus {self._settings.name}: not connected")
        if self._rtu:
            self._received = self._stray = b""
        else:
            self._unanswered += 1
            self._transaction = self._transaction % 0xFFFF + 1
            pdu.transaction_id = self._transaction
        self._request = self._framer.buildFrame(pdu)
        self._what = what
        self._answered_badly = False
        self._waiter = waiter = self._loop.create_future()
        transport.write(self._request)
        self._timer = self._loop.call_later(self._settings.timeout, self._time_out)
        # Who asked may go away; the line is taken until its answer is here, or its time is over (`abandoned`).
        with contextlib.suppress(BusError):
            await asyncio.shield(waiter)
        return self._finish()

    async def abandoned(self) -> None:
        """Wait for the end of an exchange whose asker went away; raises BusError as the exchange would have."""
        if self._waiter is not None:
            await asyncio.wait((self._waiter,))
            self._finish()

    @property
    def exchanging(self) -> bool:
        """A request was sent, and its answer is neither here nor given up."""
        return self._waiter is not None

    def _finish(self) -> ModbusPDU:
        """Return the answer of an exchange that is over; raises BusError."""
        waiter, what, self._waiter = self._waiter, self._what, None
        assert waiter is not None
        self._timer.cancel()
        try:
            answer = waiter.result()
        except BusError as error:
            if self.owed is not None and not self._answered_badly:
                self.owed.give_up(self._request[:-2])
            raise type(error)(f"{what}: {error}") from None
        if answer[0] & 0x80:
            if self.owed is not None and self.owed.may_be_older(self._request[:-2]):
                self.owed.give_up(self._request[:-2], refusal_came=True)
                raise OldAnswerError(f"{what}: a refusal that may be for an older request", answer[1])
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
        self._unanswered = 0
        self._opened.set()
        self._received = b""

    def connection_lost(self, exc: Exception | None) -> None:
        """Tell those who wait, at once, and the supervisor."""
        if self._transport is not None:
            self._transport = None
            self._fail(ConnectionLostError(f"the line broke{f' ({words(exc)})' if exc else ''}"))
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
        waiter, owed = self._waiter, self.owed
        assert owed is not None
        if waiter is None or waiter.done():
            self._stray = owed.arrived(self._stray + data)[-LONGEST_FRAME:]
            return
        self._received = owed.arrived(self._received + data)
        if len(self._received) > LONGEST_NOISE:
            self._received = b""
            raise MisfitError("the line does not stop talking")
        request = self._request[:-2]
        try:
            answer = find_rtu_answer(request, self._received, _check_sum)
        except MisfitError:
            alone = len(list(sound_frames(self._received, _check_sum))) == 1
            self._answered_badly = alone and owed.owes_nothing_like(request)
            raise
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
        if self._received and self._unanswered > 1:
            raise TornStreamError("half a frame while older answers are still to come")
        for frame in frames:
            self._unanswered = max(0, self._unanswered - 1)
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
