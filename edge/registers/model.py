"""What a register map says: buses, the devices on them, and the points that the devices hold."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from types import MappingProxyType

from igrow.core.quantities import QUANTITIES, Kind, Quantity


class Transport(Enum):
    """How a bus carries its frames."""

    TCP = "tcp"
    RTU = "rtu"
    RTU_OVER_TCP = "rtu_over_tcp"
    TLS = "tls"

    @property
    def is_rtu(self) -> bool:
        """Tell whether the frames are those of a serial line, which carry no transaction number."""
        return self in (Transport.RTU, Transport.RTU_OVER_TCP)


class Parity(Enum):
    """Parity bit of a serial line."""

    NONE = "none"
    EVEN = "even"
    ODD = "odd"


class Function(Enum):
    """The four tables of a Modbus device."""

    COIL = "coil"
    DISCRETE_INPUT = "discrete_input"
    HOLDING = "holding"
    INPUT = "input"

    @property
    def read_code(self) -> int:
        """Function code that reads this table."""
        return {"coil": 1, "discrete_input": 2, "holding": 3, "input": 4}[self.value]

    @property
    def holds_bits(self) -> bool:
        """Tell whether one address holds one bit (otherwise 16)."""
        return self in (Function.COIL, Function.DISCRETE_INPUT)

    @property
    def can_be_written(self) -> bool:
        """Tell whether Modbus has a request that writes this table."""
        return self in (Function.COIL, Function.HOLDING)

    @property
    def longest_read(self) -> int:
        """Largest count that the Modbus specification allows in one read."""
        return 2000 if self.holds_bits else 125


class DataType(Enum):
    """How the bits of one value are meant."""

    BOOL = "bool"
    BIT = "bit"
    INT16 = "int16"
    UINT16 = "uint16"
    INT32 = "int32"
    UINT32 = "uint32"
    FLOAT32 = "float32"
    INT64 = "int64"
    UINT64 = "uint64"
    FLOAT64 = "float64"

    @property
    def width(self) -> int:
        """Number of addresses that one value takes: bits for BOOL, registers for the others."""
        return {"int32": 2, "uint32": 2, "float32": 2, "int64": 4, "uint64": 4, "float64": 4}.get(self.value, 1)


class ByteOrder(Enum):
    """Order in which the bytes of a 32-bit value ABCD (A most significant) travel.

    Values of 64 bits follow the same two rules, words reversed or not and bytes swapped within each word or
    not; values of 16 bits know only the second.
    """

    ABCD = "ABCD"
    CDAB = "CDAB"
    BADC = "BADC"
    DCBA = "DCBA"

    @property
    def words_reversed(self) -> bool:
        """Tell whether the least significant register comes first."""
        return self in (ByteOrder.CDAB, ByteOrder.DCBA)

    @property
    def bytes_swapped(self) -> bool:
        """Tell whether the low byte of each register comes first."""
        return self in (ByteOrder.BADC, ByteOrder.DCBA)


@dataclass(frozen=True)
class SystemPoint:
    """A register that is no quantity of the greenhouse but says how PLC and daemon are."""

    name: str
    unit: str
    low: float
    high: float
    meaning: str


SYSTEM_POINTS: Mapping[str, SystemPoint] = MappingProxyType(
    {
        point.name: point
        for point in (
            SystemPoint("plc_clock", "s", 0.0, 2.0**32 - 1, "the PLC's clock, seconds since 1970-01-01 UTC"),
            SystemPoint("heartbeat", "1", 0.0, 65535.0, "counter that the daemon changes while it is alive"),
            SystemPoint("plc_fallback", "1", 0.0, 1.0, "1 while the PLC uses its own safe setpoints"),
            SystemPoint("plc_manual", "1", 0.0, 1.0, "1 while somebody operates the PLC by hand"),
            SystemPoint("rain_alarm", "1", 0.0, 1.0, "1 while the rain detector is wet"),
            SystemPoint("wind_alarm", "1", 0.0, 1.0, "1 while the PLC closes vents against the wind"),
        )
    }
)
"""Every name that a map may use beside the quantities of the registry."""


@dataclass(frozen=True)
class Identity:
    """Registers by which a unit is told from every other one."""

    function: Function
    address: int
    content: tuple[int, ...]

    @property
    def end(self) -> int:
        """First address after it."""
        return self.address + len(self.content)

    def __str__(self) -> str:
        return f"{', '.join(map(str, self.content))} in {self.function.value} {self.address}"


@dataclass(frozen=True)
class Device:
    """One Modbus unit on a bus and what it can bear."""

    name: str
    bus: str
    device_id: int
    gap: float = 0.0
    """Seconds of rest that the device needs after each answer."""
    longest_block: int = 125
    """Most registers that the device gives in one answer."""
    longest_bit_block: int = 2000
    """Most coils or discrete inputs that the device gives in one answer."""
    bridge: int = 8
    """Unused addresses that a read may span rather than pay for another request."""
    unreadable: tuple[tuple[Function, int, int], ...] = ()
    """Tables and address ranges, both ends included, that the device refuses to read."""
    identity: Identity | None = None

    def block_limit(self, function: Function) -> int:
        """Most addresses of one table that one request may ask for."""
        own = self.longest_bit_block if function.holds_bits else self.longest_block
        return min(own, function.longest_read)


@dataclass(frozen=True)
class BusSettings:
    """How to reach one bus. Times in seconds."""

    name: str
    transport: Transport
    host: str = ""
    port: int = 502
    serial_port: str = ""
    baudrate: int = 19200
    parity: Parity = Parity.EVEN
    stop_bits: int = 1
    timeout: float = 1.0
    gap: float = 0.0
    certificate_authority: Path | None = None
    certificate: Path | None = None
    private_key: Path | None = None
    server_name: str = ""


@dataclass(frozen=True)
class Point:
    """One value in one device."""

    name: str
    device: str
    function: Function
    address: int
    type: DataType
    bit: int = 0
    order: ByteOrder = ByteOrder.ABCD
    scale: float = 1.0
    offset: float = 0.0
    unit: str = ""
    low: float = float("-inf")
    high: float = float("inf")
    writable: bool = False
    poll: float = 0.0
    """Seconds between two reads; 0 reads the point in every cycle."""
    refresh: float | None = None
    """Seconds after which the device forgets a written value unless it is written again."""
    non_volatile: bool = False
    """Each write wears a memory that bears only so many."""
    no_value: int | None = None
    """Raw content by which the device says that it has no value."""

    @property
    def end(self) -> int:
        """First address after the point."""
        return self.address + self.type.width


@dataclass(frozen=True)
class RegisterMap:
    """A whole site's registers. Every point's device and every device's bus exist in it."""

    title: str
    source: str
    buses: Mapping[str, BusSettings]
    devices: Mapping[str, Device]
    points: Mapping[str, Point]
    hardware_tested: bool = False
    check_on_site: tuple[str, ...] = ()
    """Assumptions that the source does not state, or that the site decides, one line each."""
    path: Path | None = field(default=None, compare=False)


TWIN_SUFFIX = "_2"
"""A second sensor of a quantity has the quantity's name with this suffix."""

POINT_NAMES: tuple[str, ...] = (
    *(name for name, quantity in QUANTITIES.items() if quantity.kind is not Kind.MARK),
    *SYSTEM_POINTS,
    *(name + TWIN_SUFFIX for name, quantity in QUANTITIES.items() if quantity.kind in (Kind.WEATHER, Kind.CLIMATE)),
)
"""Every name that a map may give to a point."""


def _definition(name: str) -> Quantity | SystemPoint:
    base = name.removesuffix(TWIN_SUFFIX)
    return SYSTEM_POINTS[name] if name in SYSTEM_POINTS else QUANTITIES[base]


def expected_unit(name: str) -> str:
    """Return the unit in which a point of this name must come out; KeyError for an unknown name."""
    return _definition(name).unit


def valid_range(name: str) -> tuple[float, float]:
    """Return the registry's range of a point name, in its unit; KeyError for an unknown name."""
    definition = _definition(name)
    return definition.low, definition.high


def needed_for_control(name: str) -> bool:
    """Tell whether the control cycle waits for this point; crop and yield are only logged."""
    return name not in QUANTITIES or QUANTITIES[name].kind not in (Kind.GROWTH, Kind.YIELD)
