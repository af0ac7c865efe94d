"""The boundary between those who want registers and the line that brings them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

from igrow.edge.registers.model import Function


class Priority(IntEnum):
    """Whose turn it is when several wait: the smallest first."""

    WRITE = 0
    HEARTBEAT = 1
    CONTROL = 2
    LOG = 3


@dataclass(frozen=True, slots=True)
class ReadRequest:
    """Ask one unit for consecutive addresses of one table."""

    device_id: int
    function: Function
    address: int
    count: int

    def __str__(self) -> str:
        return f"unit {self.device_id}, {self.function.value} {self.address} to {self.address + self.count - 1}"


@dataclass(frozen=True, slots=True)
class WriteRequest:
    """Put values (registers 0 to 65535, or coils 0 and 1) into consecutive addresses of one unit."""

    device_id: int
    function: Function
    address: int
    values: tuple[int, ...]

    def __str__(self) -> str:
        return f"unit {self.device_id}, write {self.function.value} {self.address} <- {list(self.values)}"


class Bus(Protocol):
    """One line with any number of units, serving one request at a time."""

    @property
    def connected(self) -> bool:
        """Tell whether the line is up."""
        ...

    def start(self) -> None:
        """Begin to connect, in the background and for ever. Returns at once."""
        ...

    async def read(self, request: ReadRequest, priority: Priority) -> tuple[int, ...]:
        """Return exactly `request.count` registers (0 to 65535) or bits (0, 1). Raises BusError."""
        ...

    async def write(self, request: WriteRequest, priority: Priority) -> None:
        """Return when the unit has confirmed the very values; never repeats by itself. Raises BusError."""
        ...

    def last_orders(self) -> None:
        """Let what is asked from now on wait for nothing: the daemon stops."""
        ...

    async def close(self) -> None:
        """Drop the line; requests that wait fail with NotConnectedError."""
        ...
