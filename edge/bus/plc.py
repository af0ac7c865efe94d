"""What the control cycle sees of the greenhouse: values by name, read and written, each with its error."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from igrow.edge.bus.block_reader import BlockReader
from igrow.edge.bus.errors import (
    BusError,
    NoValueError,
    OtherUnitError,
    TurnedWordsError,
    UnknownPointError,
    ValueDoesNotFitError,
)
from igrow.edge.bus.identity import not_itself
from igrow.edge.bus.modbus_bus import ModbusBus
from igrow.edge.bus.protocol import Bus, Priority, WriteRequest
from igrow.edge.clock import since_boot
from igrow.edge.registers.codec import NotEncodableError, decode, encode, turned
from igrow.edge.registers.model import BusSettings, Device, Point, RegisterMap


@dataclass(frozen=True)
class Reading:
    """One value as it came from the PLC, or why it did not."""

    value: float | None
    error: BusError | None
    at: float
    """Monotonic seconds of the answer."""


POLL_SLACK = 0.95
"""Share of its poll period after which a point counts as due: a cycle that comes some milliseconds early must not
halve the rate."""


class Plc(Protocol):
    """The greenhouse's registers by the names of quantities and system points."""

    async def read(self, names: Collection[str] | None = None) -> Mapping[str, Reading]:
        """Read the named points, or all that are due. Never raises BusError: each reading carries its own."""
        ...

    async def write(self, name: str, value: float) -> None:
        """Write one point; raises BusError. Only the guard's writer may call it."""
        ...

    async def close(self) -> None:
        """Drop all lines."""
        ...


def make_bus(settings: BusSettings, devices: Iterable[Device], *, others_asked: bool = False) -> ModbusBus:
    """Make the bus for one entry of a register map. To be called inside an event loop."""
    gaps = {device.device_id: device.gap for device in devices if device.bus == settings.name}
    return ModbusBus(settings, gaps, others_asked=others_asked)


class RegisterPlc:
    """A Plc made of a register map: buses in parallel, on each one request at a time."""

    def __init__(
        self,
        register_map: RegisterMap,
        *,
        monotonic: Callable[[], float] = since_boot,
        buses: Mapping[str, Bus] | None = None,
        others_asked: bool = False,
    ) -> None:
        """`buses` by name replaces the real ones (tests). Made inside an event loop; connects after `start`.

        `others_asked`: a process before this one may have asked; its late answers must pass for none of ours.
        """
        devices = register_map.devices
        self.register_map = register_map
        self._monotonic = monotonic
        self.buses: Mapping[str, Bus] = buses or {
            name: make_bus(settings, devices.values(), others_asked=others_asked)
            for name, settings in register_map.buses.items()
        }
        self._readers = {name: BlockReader(bus, devices, monotonic) for name, bus in self.buses.items()}
        self._bus_of = {name: devices[point.device].bus for name, point in register_map.points.items()}
        self._due: dict[str, float] = {}
        identified = {
            point.device: name for name, point in register_map.points.items() if devices[point.device].identity
        }
        self._in_each_cycle = set(identified.values())
        """One point of each unit that can say who it is: nothing is written to another one."""

    def start(self) -> None:
        """Begin to connect to every bus, in the background. Never waits."""
        for bus in self.buses.values():
            bus.start()

    def last_orders(self) -> None:
        """Let what is written from now on wait for no unit that rests, and for no line to be tried again."""
        for bus in self.buses.values():
            bus.last_orders()

    async def close(self) -> None:
        """Drop all lines."""
        await asyncio.gather(*(bus.close() for bus in self.buses.values()))

    async def read(self, names: Collection[str] | None = None) -> Mapping[str, Reading]:
        """Read the named points, or all whose poll period has passed, with as few requests as possible."""
        readings: dict[str, Reading] = {}
        shares: dict[str, list[Point]] = {}
        for name in self._due_names() if names is None else names:
            point = self.register_map.points.get(name)
            if point is None:
                readings[name] = Reading(None, _unknown(name), self._monotonic())
            else:
                shares.setdefault(self._bus_of[name], []).append(point)
        jobs = [self._read_share(bus, share, readings) for bus, share in shares.items()]
        if len(jobs) == 1:
            await jobs[0]
        else:
            await asyncio.gather(*jobs)
        return readings

    async def write(self, name: str, value: float) -> None:
        """Write one point, once; returns when the unit has echoed it.

        Raises UnknownPointError, ValueDoesNotFitError (nothing sent), or another BusError; its `sent` tells whether
        the write may have been done all the same. Range and pace are the guard's affair.
        """
        point = self.register_map.points.get(name)
        if point is None:
            raise _unknown(name)
        if not point.writable:
            raise UnknownPointError(f"{name}: the register map does not let it be written; `writable: true` would")
        device = self.register_map.devices[point.device]
        try:
            content = encode(point, value)
        except NotEncodableError as error:
            raise ValueDoesNotFitError(str(error)) from None
        request = WriteRequest(device.device_id, point.function, point.address, content)
        priority = Priority.HEARTBEAT if name == "heartbeat" else Priority.WRITE
        await self.buses[device.bus].write(request, priority)

    async def not_itself(self, device: str) -> BusError | None:
        """Ask a unit who it is; returns why nothing of it may be believed, or None."""
        settings = self.register_map.devices[device]
        return await not_itself(self.buses[settings.bus], settings)

    def _due_names(self) -> list[str]:
        now = self._monotonic()
        due: list[str] = []
        for point in self.register_map.points.values():
            if point.poll > 0 and point.name not in self._in_each_cycle:
                if now < self._due.get(point.name, now):
                    continue
                self._due[point.name] = now + POLL_SLACK * point.poll
            due.append(point.name)
        return due

    async def _read_share(self, bus: str, points: list[Point], readings: dict[str, Reading]) -> None:
        contents = await self._readers[bus].read(points)
        # Asked after the rest, so that what was read before another unit took the place is not believed either.
        for device in dict.fromkeys(point.device for point in points):
            stranger = await self.not_itself(device)
            for point in points if stranger is not None else ():
                answered = contents[point.name][0] is not None or isinstance(stranger, OtherUnitError)
                if point.device == device and answered:
                    contents[point.name] = None, stranger, self._monotonic()
        for point in points:
            content, error, at = contents[point.name]
            value = None
            if content is not None:
                value = decode(point, content)
                if value is None:
                    error = _no_value(point, content)
            readings[point.name] = Reading(value, error, at)


def _no_value(point: Point, content: Sequence[int]) -> NoValueError:
    number = turned(point, content)
    if number is not None:
        return TurnedWordsError(
            f"{point.name}: the registers do not hold what the map says; they may mean {number:g}", number
        )
    return NoValueError(f"{point.name}: the device says that it has no value")


def _unknown(name: str) -> UnknownPointError:
    return UnknownPointError(f"{name}: the register map has no such point")
