# ruff: noqa: RUF009 - `setting` makes a dataclass field, as `dataclasses.field` does
"""Reads a register map from YAML. Every error names file, line and column, and what would be right."""

from __future__ import annotations

import itertools
import os
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path

from igrow.core.yaml_schema import SettingError, load, parse, setting
from igrow.edge.registers.bus_file import RtuBus, RtuOverTcpBus, TcpBus, TlsBus, bus_settings
from igrow.edge.registers.bus_load import estimate
from igrow.edge.registers.codec import NotEncodableError, encode
from igrow.edge.registers.identity_file import IdentitySettings
from igrow.edge.registers.model import (
    POINT_NAMES,
    ByteOrder,
    DataType,
    Device,
    Function,
    Point,
    RegisterMap,
    expected_unit,
    valid_range,
)

_ZERO = timedelta(0)
_SECOND = timedelta(seconds=1)


@dataclass(frozen=True)
class AddressRange:
    """Addresses of one table, both ends included."""

    function: Function = setting(help="table")
    first: int = setting(help="first address", low=0, high=65535)
    last: int = setting(help="last address", low=0, high=65535)

    def __post_init__(self) -> None:
        if self.last < self.first:
            raise SettingError(f"last is {self.last}: it must not be less than first, {self.first}", "last")


@dataclass(frozen=True)
class DeviceSettings:
    """One Modbus unit."""

    bus: str = setting(help="name of the bus it is on")
    device_id: int = setting(help="its unit number", low=0, high=255)
    gap: timedelta = setting(help="rest that it needs after each answer", low=_ZERO, default=_ZERO)
    longest_block: int = setting(help="most registers in one answer", low=1, high=125, default=125)
    longest_bit_block: int = setting(help="most bits in one answer", low=1, high=2000, default=2000)
    bridge: int = setting(help="unused addresses that one read may span", low=0, high=124, default=8)
    unreadable: tuple[AddressRange, ...] = setting(help="addresses that it refuses to read", default=())
    identity: IdentitySettings | None = setting(help="registers that no other unit shows so", default=None)


@dataclass(frozen=True)
class PointSettings:
    """One value in a device."""

    device: str = setting(help="name of the device")
    function: Function = setting(help="table: coil, discrete_input, holding or input")
    address: int = setting(help="address as sent, the first is 0 (40001 in many manuals)", low=0, high=65535)
    type: DataType = setting(help="data type")
    unit: str = setting(help="unit of the value after scale and offset")
    bit: int | None = setting(help="bit of a register, 0 is the lowest", low=0, high=15, default=None)
    order: ByteOrder = setting(help="order of the bytes", default=ByteOrder.ABCD)
    scale: float = setting(help="value = raw x scale + offset", default=1.0)
    offset: float = setting(help="value = raw x scale + offset", default=0.0)
    low: float | None = setting(help="smallest value, where it is not the quantity's own", default=None)
    high: float | None = setting(help="largest value, where it is not the quantity's own", default=None)
    writable: bool = setting(help="whether the daemon may write it", default=False)
    poll: timedelta = setting(help="time between reads, 0 s for every cycle", low=_ZERO, default=_ZERO)
    refresh: timedelta | None = setting(help="the device forgets a written value after", low=_SECOND, default=None)
    non_volatile: bool = setting(help="whether writes wear the device's memory", default=False)
    no_value: int | None = setting(help="raw content that means 'no value'", default=None)

    def __post_init__(self) -> None:
        self._check_type()
        if self.scale == 0:
            raise SettingError("scale is 0: every value would read the same; 1 changes nothing", "scale")
        if self.writable and not self.function.can_be_written:
            raise SettingError(f"{self.function.value} cannot be written: only coil and holding can", "writable")
        if self.writable and self.type is DataType.BIT:
            raise SettingError(
                "one bit of a register cannot be written alone: use a coil or a whole register", "writable"
            )
        for key, given in (("refresh", self.refresh is not None), ("non_volatile", self.non_volatile)):
            if given and not self.writable:
                raise SettingError(f"{key} is for points with `writable: true`", key)
        if self.refresh is not None and self.non_volatile:
            raise SettingError(
                "a non-volatile register would wear out if it were refreshed: keep one of the two", "refresh"
            )

    def _check_type(self) -> None:
        if self.function.holds_bits != (self.type is DataType.BOOL):
            right = "bool" if self.function.holds_bits else "bit, int16, uint16 or a longer type"
            raise SettingError(f"{self.function.value} cannot hold {self.type.value}: {right} is right", "type")
        if (self.bit is not None) != (self.type is DataType.BIT):
            what = "type bit needs `bit:` 0 to 15" if self.bit is None else "`bit` is for type bit only"
            raise SettingError(what, "bit")
        if self.address + self.type.width > 65536:
            raise SettingError(f"{self.type.value} at {self.address} reaches past the last address, 65535", "address")
        if self.no_value is not None and self.type in (DataType.FLOAT32, DataType.FLOAT64, DataType.BIT, DataType.BOOL):
            raise SettingError("no_value is for whole-number types; a float has NaN for it", "no_value")

    def point(self, name: str) -> Point:
        """Return the point of this name."""
        low, high = valid_range(name)
        return Point(
            name=name,
            device=self.device,
            function=self.function,
            address=self.address,
            type=self.type,
            bit=self.bit or 0,
            order=self.order,
            scale=self.scale,
            offset=self.offset,
            unit=self.unit,
            low=low if self.low is None else self.low,
            high=high if self.high is None else self.high,
            writable=self.writable,
            poll=self.poll.total_seconds(),
            refresh=None if self.refresh is None else self.refresh.total_seconds(),
            non_volatile=self.non_volatile,
            no_value=self.no_value,
        )


@dataclass(frozen=True)
class MapFile:
    """The whole file."""

    title: str = setting(help="what this map is for")
    source: str = setting(help="manual or program that the addresses come from")
    buses: Mapping[str, TcpBus | RtuBus | RtuOverTcpBus | TlsBus] = setting(help="the lines")
    devices: Mapping[str, DeviceSettings] = setting(help="the Modbus units")
    points: Mapping[str, PointSettings] = setting(help="the values", keys=POINT_NAMES)
    hardware_tested: bool = setting(help="whether it was ever used with the real device", default=False)
    check_on_site: tuple[str, ...] = setting(help="what the source does not state or the site decides", default=())

    def __post_init__(self) -> None:
        self._check_devices()
        for name, point in self.points.items():
            self._check_point(name, point)
        self._check_overlaps()
        for load_of_bus in estimate(self.register_map()):
            if not load_of_bus.acceptable:
                advice = "poll less often, shorten the gaps, or raise the baud rate"
                raise SettingError(f"{load_of_bus}: {advice}", "buses", load_of_bus.bus)

    def register_map(self, path: Path | None = None) -> RegisterMap:
        """Return the map that the file describes; files it names are looked for beside it."""
        folder = path.parent if path else Path()
        return RegisterMap(
            title=self.title,
            source=self.source,
            buses={name: bus_settings(name, bus, folder) for name, bus in self.buses.items()},
            devices={name: _device(name, device) for name, device in self.devices.items()},
            points={name: point.point(name) for name, point in self.points.items()},
            hardware_tested=self.hardware_tested,
            check_on_site=self.check_on_site,
            path=path,
        )

    def _check_devices(self) -> None:
        seen: dict[tuple[object, int], str] = {}
        for name, device in self.devices.items():
            if device.bus not in self.buses:
                raise SettingError(_unknown("bus", device.bus, self.buses), "devices", name, "bus")
            # Two buses may name one line: what two points have there in common would be written by both.
            other = seen.setdefault((_line(self.buses[device.bus]), device.device_id), name)
            if other != name:
                buses = " and ".join(sorted({device.bus, self.devices[other].bus}))
                what = f"device_id {device.device_id} is {other}'s already on bus {buses}: one of them is another"
                raise SettingError(what, "devices", name, "device_id")
            if device.device_id == 0 and self.buses[device.bus].transport in ("rtu", "rtu_over_tcp"):
                what = "device_id 0 is the broadcast, which nobody answers: 1 to 247 on a serial line"
                raise SettingError(what, "devices", name, "device_id")
        self._check_identities()

    def _check_identities(self) -> None:
        seen: dict[IdentitySettings, str] = {}
        for name, device in self.devices.items():
            if device.identity is None:
                continue
            other = seen.setdefault(device.identity, name)
            if other != name:
                what = f"it is {other}'s as well, so it would not tell the one from the other"
                raise SettingError(what, "devices", name, "identity")
            identity = device.identity.identity
            for point_name, settings in self.points.items():
                point = settings.point(point_name)
                shared = point.address < identity.end and identity.address < point.end
                if point.device == name and point.function is identity.function and shared:
                    where = f"{point.function.value} {point.address}"
                    what = f"{where} holds {point_name}, which changes: take what never does"
                    raise SettingError(what, "devices", name, "identity", "address")

    def _check_point(self, name: str, settings: PointSettings) -> None:
        if settings.device not in self.devices:
            raise SettingError(_unknown("device", settings.device, self.devices), "points", name, "device")
        if settings.unit != expected_unit(name):
            what = (
                f"{name} is in {expected_unit(name)}, not {settings.unit}: give the scale and offset that convert to it"
            )
            raise SettingError(what, "points", name, "unit")
        device = _device(settings.device, self.devices[settings.device])
        if settings.type.width > device.block_limit(settings.function):
            what = f"{settings.type.value} is longer than the longest block of {settings.device}"
            raise SettingError(what, "points", name, "type")
        point = settings.point(name)
        for table, first, last in device.unreadable:
            if table is point.function and first < point.end and point.address <= last:
                what = f"{point.function.value} {first} to {last} is unreadable by this map's own word"
                raise SettingError(what, "points", name, "address")
        if not point.low < point.high:
            raise SettingError(
                f"low is {point.low:g}: it must be less than high, {point.high:g}", "points", name, "low"
            )
        if point.writable:
            for key, bound in (("low", point.low), ("high", point.high)):
                try:
                    encode(point, bound)
                except NotEncodableError as error:
                    what = f"{error}: give a `{key}` that does, or another type or scale"
                    raise SettingError(what, "points", name, key) from None
        if name == "heartbeat" and not point.writable:
            raise SettingError(
                "heartbeat needs `writable: true`: it is how the PLC hears of the daemon", "points", name
            )

    def _check_overlaps(self) -> None:
        """Refuse two points in the same registers, mostly a copied line; bits of one register are meant to be."""
        ordered = sorted(((p.device, p.function.value, p.address, p.bit or 0, name) for name, p in self.points.items()))
        for (*first_table, _, _, first), (*table, address, bit, name) in itertools.pairwise(ordered):
            earlier, point = self.points[first], self.points[name]
            if first_table[:2] != table[:2] or address >= earlier.address + earlier.type.width:
                continue
            if earlier.type is point.type is DataType.BIT and earlier.bit != bit:
                continue
            what = f"{name} shares {point.function.value} {address} with {first}: one of the addresses is wrong"
            raise SettingError(what, "points", name, "address")


def _line(bus: TcpBus | RtuBus | RtuOverTcpBus | TlsBus) -> object:
    """Return what tells a line from another one."""
    return bus.serial_port if isinstance(bus, RtuBus) else (bus.host.lower().rstrip("."), bus.port)


def _unknown(kind: str, name: str, known: Mapping[str, object]) -> str:
    return f"there is no {kind} {name}: known here: {', '.join(known)}"


def _device(name: str, device: DeviceSettings) -> Device:
    return Device(
        name=name,
        bus=device.bus,
        device_id=device.device_id,
        gap=device.gap.total_seconds(),
        longest_block=device.longest_block,
        longest_bit_block=device.longest_bit_block,
        bridge=device.bridge,
        unreadable=tuple((r.function, r.first, r.last) for r in device.unreadable),
        identity=None if device.identity is None else device.identity.identity,
    )


def load_register_map(path: str | os.PathLike[str]) -> RegisterMap:
    """Read and check a register map; raises igrow.core.yaml_schema.SchemaError."""
    return load(path, MapFile).register_map(Path(path))


def parse_register_map(text: str) -> RegisterMap:
    """Read and check a register map from YAML text; raises igrow.core.yaml_schema.SchemaError."""
    return parse(text, MapFile).register_map()
