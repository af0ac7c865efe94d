"""A bus put together: whose turn, who rests, how long to wait, is the line there, and what comes after a failure."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable, Mapping
from typing import TypeVar

from igrow.edge.bus.connect_supervisor import ConnectSupervisor
from igrow.edge.bus.errors import (
    AddressRefusedError,
    BadAnswerError,
    BusError,
    NoAnswerError,
    NotConnectedError,
    OldAnswerError,
    RefusedError,
    UnitRestingError,
)
from igrow.edge.bus.pacing import Pacer
from igrow.edge.bus.protocol import Priority, ReadRequest, WriteRequest
from igrow.edge.bus.pymodbus_link import QUIET, PymodbusLink
from igrow.edge.bus.request_slot import RequestSlot
from igrow.edge.bus.unit_health import HealthBook
from igrow.edge.registers.model import BusSettings

T = TypeVar("T")

SILENCES_BEFORE_RECONNECT = 3
"""Failures in a row, of whatever units, without one answer between, after which the line itself is suspected: a
connection whose other end was switched off looks open for a quarter of an hour."""
BEYOND_THE_END = (2, 3)
"""Exceptions by which a unit refuses to be read beyond its last register."""


class ModbusBus:
    """The Bus of `igrow.edge.bus.protocol` over one Modbus line."""

    def __init__(
        self,
        settings: BusSettings,
        unit_gaps: Mapping[int, float] | None = None,
        *,
        monotonic: Callable[[], float] = time.monotonic,
        longest_queue: int = 64,
        rest_step: float = 2.0,
        first_wait: float = 0.5,
        quiet: float = QUIET,
        others_asked: bool = False,
    ) -> None:
        """`unit_gaps`: seconds of rest after each request, by device id. To be made inside an event loop.

        `others_asked`: answers to another process' requests may still come on a serial line.
        """
        self.settings = settings
        self.health = HealthBook(monotonic, rest_step)
        self._link = PymodbusLink(settings, self._line_lost, quiet, others_asked=others_asked)
        self._supervisor = ConnectSupervisor(self._link, settings.name, monotonic=monotonic, first_wait=first_wait)
        self._slot = RequestSlot(longest_queue)
        self._pacer = Pacer(monotonic, settings.gap, unit_gaps or {})
        self._silences = 0
        self._finishing: asyncio.Task[None] | None = None
        self._last_orders = False

    @property
    def connected(self) -> bool:
        """Tell whether the line is up."""
        return self._link.connected

    @property
    def connects(self) -> int:
        """How often the line came up."""
        return self._supervisor.connects

    def start(self) -> None:
        """Begin to connect, in the background and for ever."""
        self._supervisor.start()

    def last_orders(self) -> None:
        """Let what is asked from now on wait for nothing: no unit rests any more, and a lost line is opened at once."""
        self._last_orders = True
        self._supervisor.hurry()

    async def close(self) -> None:
        """Drop the line; requests that wait fail with NotConnectedError."""
        self._slot.close()
        await self._supervisor.close()
        if self._finishing is not None:
            await asyncio.wait((self._finishing,))
        self._link.retire()

    async def read(self, request: ReadRequest, priority: Priority) -> tuple[int, ...]:
        """Return exactly `request.count` registers or bits; raises BusError."""
        return await self._serve(request.device_id, priority, lambda: self._read(request))

    async def write(self, request: WriteRequest, priority: Priority) -> None:
        """Return when the unit has confirmed the very values; never repeats by itself. Raises BusError."""
        await self._serve(request.device_id, priority, lambda: self._link.write(request))

    async def _read(self, request: ReadRequest) -> tuple[int, ...]:
        """Read so that no older answer of the line can pass for this one's."""
        owed = self._link.owed
        asked = request if owed is None else owed.distinct(request)
        if owed is not None and asked is None:
            seconds = owed.wait(request)
            raise UnitRestingError(f"{request}: an older answer that looks the same may come for {seconds:.0f} s more")
        assert asked is not None
        try:
            skipped = request.address - asked.address
            return (await self._link.read(asked))[skipped:][: request.count]
        except (OldAnswerError, AddressRefusedError) as error:
            if owed is None or asked == request or error.code not in BEYOND_THE_END:
                raise
            owed.refused(asked, request)
            raise OldAnswerError(f"{request}: it cannot be read with the registers beside it", error.code) from None

    def _line_lost(self) -> None:
        self._supervisor.lost()

    async def _serve(self, device_id: int, priority: Priority, exchange: Callable[[], Awaitable[T]]) -> T:
        self._refuse_if_resting(device_id)
        await self._slot.acquire(priority)
        try:
            self._refuse_if_resting(device_id)
            if not self._link.connected:
                await self._supervisor.attempt()
                if not self._link.connected:
                    raise NotConnectedError(f"bus {self.settings.name}: not connected")
            return await self._paced(device_id, exchange)
        finally:
            if self._link.exchanging:
                # Who asked went away while the answer was still to come: nobody else may talk before that is over.
                self._finishing = asyncio.get_running_loop().create_task(self._finish(device_id))
            else:
                self._slot.release()

    async def _finish(self, device_id: int) -> None:
        try:
            await self._judged(device_id, self._link.abandoned)
        except BusError:
            pass
        finally:
            self._slot.release()

    async def _paced(self, device_id: int, exchange: Callable[[], Awaitable[T]]) -> T:
        if wait := self._pacer.wait(device_id):
            await asyncio.sleep(wait)
        return await self._judged(device_id, exchange)

    async def _judged(self, device_id: int, exchange: Callable[[], Awaitable[T]]) -> T:
        """Await an exchange, and learn from its end about the unit and the line."""
        try:
            result = await exchange()
        except RefusedError:
            self._answered(device_id)
            raise
        except (NoAnswerError, BadAnswerError) as error:
            await self._failed(device_id, silent=isinstance(error, NoAnswerError))
            raise
        finally:
            self._pacer.finished(device_id)
        self._answered(device_id)
        return result

    def _answered(self, device_id: int) -> None:
        self._supervisor.served()
        self.health.answered(device_id)
        self._silences = 0

    async def _failed(self, device_id: int, *, silent: bool) -> None:
        self._silences += 1
        if self._silences >= SILENCES_BEFORE_RECONNECT:
            self._silences = 0
            self._link.close()
        if not self.settings.transport.is_rtu:
            self.health.failed(device_id, silent=silent)
            return
        # An answer may still be on its way. Most come soon: the unit rests for one timeout more, at the cost of nobody
        # else, and an answer that comes meanwhile is crossed off (`owed`).
        self.health.failed(device_id, silent=silent, at_least=self.settings.timeout)
        await self._link.drain()

    def _refuse_if_resting(self, device_id: int) -> None:
        rest = 0.0 if self._last_orders else self.health.rest_left(device_id)
        if rest:
            failures = self.health.unit(device_id).failures
            raise UnitRestingError(
                f"bus {self.settings.name}, unit {device_id}: left alone for {rest:.0f} s after {failures} failures"
            )
