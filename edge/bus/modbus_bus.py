"""A bus put together: whose turn, who rests, how long to wait, is the line there, and what comes after a failure."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable, Mapping
from typing import TypeVar

from igrow.edge.bus.connect_supervisor import ConnectSupervisor
from igrow.edge.bus.errors import (
    BadAnswerError,
    ConnectionLostError,
    NoAnswerError,
    NotConnectedError,
    RefusedError,
    UnitRestingError,
)
from igrow.edge.bus.pacing import Pacer
from igrow.edge.bus.protocol import Priority, ReadRequest, WriteRequest
from igrow.edge.bus.pymodbus_link import QUIET, PymodbusLink
from igrow.edge.bus.request_slot import RequestSlot, Turn
from igrow.edge.bus.unit_health import HealthBook
from igrow.edge.registers.model import BusSettings

T = TypeVar("T")

SILENCES_BEFORE_RECONNECT = 3
"""Failures in a row, of whatever units, without one answer between, after which the line itself is suspected: a
connection whose other end was switched off looks open for a quarter of an hour."""


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
    ) -> None:
        """`unit_gaps`: seconds of rest after each request, by device id. To be made inside an event loop."""
        self.settings = settings
        self.health = HealthBook(monotonic, rest_step)
        self._link = PymodbusLink(settings, self._line_lost, quiet)
        self._supervisor = ConnectSupervisor(self._link, settings.name, monotonic=monotonic, first_wait=first_wait)
        self._slot = RequestSlot(longest_queue)
        self._pacer = Pacer(monotonic, settings.gap, unit_gaps or {})
        self._unsure: set[int] = set()
        self._loop_back_unanswered: set[int] = set()
        self._deaf_to_loop_back: set[int] = set()
        self._marker = 0
        self._silences = 0

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

    async def close(self) -> None:
        """Drop the line; requests that wait fail with NotConnectedError."""
        self._slot.close()
        await self._supervisor.close()

    async def read(self, request: ReadRequest, priority: Priority) -> tuple[int, ...]:
        """Return exactly `request.count` registers or bits; raises BusError."""
        return await self._serve(request.device_id, priority, lambda: self._link.read(request))

    async def write(self, request: WriteRequest, priority: Priority) -> None:
        """Return when the unit has confirmed the very values; never repeats by itself. Raises BusError."""
        await self._serve(request.device_id, priority, lambda: self._link.write(request))

    def _line_lost(self) -> None:
        self._supervisor.lost()

    async def _serve(self, device_id: int, priority: Priority, exchange: Callable[[], Awaitable[T]]) -> T:
        self._refuse_if_resting(device_id)
        async with Turn(self._slot, priority):
            self._refuse_if_resting(device_id)
            if not self._link.connected:
                await self._supervisor.attempt()
                if not self._link.connected:
                    raise NotConnectedError(f"bus {self.settings.name}: not connected")
            if device_id in self._unsure:
                await self._settle(device_id)
            return await self._paced(device_id, exchange)

    async def _paced(self, device_id: int, exchange: Callable[[], Awaitable[T]]) -> T:
        if wait := self._pacer.wait(device_id):
            await asyncio.sleep(wait)
        try:
            result = await exchange()
        except RefusedError:
            self._answered(device_id)
            raise
        except (NoAnswerError, BadAnswerError) as error:
            await self._failed(device_id, silent=isinstance(error, NoAnswerError))
            raise
        except (asyncio.CancelledError, ConnectionLostError):
            if self.settings.transport.is_rtu:  # a converter hands a late answer to the next connection
                self._unsure.add(device_id)
            raise
        finally:
            self._pacer.finished(device_id)
        self._answered(device_id)
        return result

    def _answered(self, device_id: int) -> None:
        self.health.answered(device_id)
        self._silences = 0
        if device_id in self._loop_back_unanswered:
            self._loop_back_unanswered.discard(device_id)
            self._deaf_to_loop_back.add(device_id)

    async def _failed(self, device_id: int, *, silent: bool) -> None:
        self._silences += 1
        if self._silences >= SILENCES_BEFORE_RECONNECT:
            self._silences = 0
            self._link.close()
        if not self.settings.transport.is_rtu:
            self.health.failed(device_id, silent=silent)
            return
        # An answer may still be on its way on the line, and would look like the answer to the next request: the
        # unit rests for one timeout more, at the cost of nobody else, and is asked for a loop back (`_settle`).
        self.health.failed(device_id, silent=silent, at_least=self.settings.timeout)
        self._loop_back_unanswered.discard(device_id)
        if device_id not in self._deaf_to_loop_back:
            self._unsure.add(device_id)
        await self._link.drain()

    async def _settle(self, device_id: int) -> None:
        """Make sure that no old answer of a unit is still on its way, before it is asked again.

        A unit answers its requests in order. So it is asked to echo a marker (function 8); a refusal of that
        function does as well. If the unit is silent, the line has been quiet for one timeout more, and the next
        request goes ahead without; a unit that answers it although it ignored the marker is not asked again.
        """
        self._marker = (self._marker + 1) % 0x10000
        marker = self._marker
        try:
            await self._paced(device_id, lambda: self._link.loop_back(device_id, marker))
        except RefusedError:
            pass
        except NoAnswerError:
            self._unsure.discard(device_id)
            self._loop_back_unanswered.add(device_id)
            raise
        self._unsure.discard(device_id)

    def _refuse_if_resting(self, device_id: int) -> None:
        if rest := self.health.rest_left(device_id):
            failures = self.health.unit(device_id).failures
            raise UnitRestingError(
                f"bus {self.settings.name}, unit {device_id}: left alone for {rest:.0f} s after {failures} failures"
            )
