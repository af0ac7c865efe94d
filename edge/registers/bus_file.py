# ruff: noqa: RUF009 - `setting` makes a dataclass field, as `dataclasses.field` does
"""How the buses of a register map are written in its file: one class for each kind of line."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import timedelta
from pathlib import Path
from typing import Literal

from igrow.core.yaml_schema import setting
from igrow.edge.host_names import check_host
from igrow.edge.registers.model import BusSettings, Parity, Transport

_ZERO = timedelta(0)
_SECOND = timedelta(seconds=1)
_SERIAL_GAP = timedelta(milliseconds=30)
_LONGEST_TIMEOUT = timedelta(seconds=60)

_TIMEOUT = "longest wait for an answer"
_GAP = "rest between two requests on the bus"


class _OverNetwork:
    host: str

    def __post_init__(self) -> None:
        check_host(self.host)


@dataclass(frozen=True)
class TcpBus(_OverNetwork):
    """A device or gateway that speaks Modbus TCP."""

    transport: Literal["tcp"] = setting(help="how the bus carries its frames")
    host: str = setting(help="address or name")
    port: int = setting(help="TCP port", low=1, high=65535, default=502)
    timeout: timedelta = setting(help=_TIMEOUT, low=_ZERO, high=_LONGEST_TIMEOUT, default=_SECOND)
    gap: timedelta = setting(help=_GAP, low=_ZERO, default=_ZERO)


@dataclass(frozen=True)
class RtuOverTcpBus(_OverNetwork):
    """A converter that carries the frames of a serial line over TCP."""

    transport: Literal["rtu_over_tcp"] = setting(help="how the bus carries its frames")
    host: str = setting(help="address or name")
    port: int = setting(help="TCP port", low=1, high=65535)
    baudrate: int = setting(help="speed of the line behind the converter", low=300, high=4_000_000, default=19200)
    parity: Parity = setting(help="parity of that line", default=Parity.EVEN)
    stop_bits: int = setting(help="stop bits of that line", low=1, high=2, default=1)
    timeout: timedelta = setting(help=_TIMEOUT, low=_ZERO, high=_LONGEST_TIMEOUT, default=_SECOND)
    gap: timedelta = setting(help=_GAP, low=_ZERO, default=_SERIAL_GAP)


@dataclass(frozen=True)
class RtuBus:
    """A serial line (RS-485 or RS-232)."""

    transport: Literal["rtu"] = setting(help="how the bus carries its frames")
    serial_port: str = setting(help="such as /dev/ttyUSB0, or better a name under /dev/serial/by-id")
    baudrate: int = setting(help="speed of the line", low=300, high=4_000_000, default=19200)
    parity: Parity = setting(help="parity bit", default=Parity.EVEN)
    stop_bits: int = setting(help="stop bits", low=1, high=2, default=1)
    timeout: timedelta = setting(help=_TIMEOUT, low=_ZERO, high=_LONGEST_TIMEOUT, default=_SECOND)
    gap: timedelta = setting(help=_GAP, low=_ZERO, default=_SERIAL_GAP)


@dataclass(frozen=True)
class TlsBus(_OverNetwork):
    """Modbus TCP inside TLS (Modbus/TCP Security)."""

    transport: Literal["tls"] = setting(help="how the bus carries its frames")
    host: str = setting(help="address or name")
    certificate_authority: str = setting(help="file of the authority that signed the server's certificate")
    port: int = setting(help="TCP port", low=1, high=65535, default=802)
    server_name: str = setting(help="name in the server's certificate, if it is not the host", default="")
    certificate: str | None = setting(help="file of our own certificate", default=None)
    private_key: str | None = setting(help="file of the key to our certificate", default=None)
    timeout: timedelta = setting(help=_TIMEOUT, low=_ZERO, high=_LONGEST_TIMEOUT, default=_SECOND)
    gap: timedelta = setting(help=_GAP, low=_ZERO, default=_ZERO)


def bus_settings(name: str, bus: TcpBus | RtuBus | RtuOverTcpBus | TlsBus, folder: Path) -> BusSettings:
    """Return what the bus is opened with; files that it names are looked for in `folder`."""
    common = BusSettings(
        name, Transport(bus.transport), timeout=bus.timeout.total_seconds(), gap=bus.gap.total_seconds()
    )
    if isinstance(bus, RtuBus):
        return replace(
            common, serial_port=bus.serial_port, baudrate=bus.baudrate, parity=bus.parity, stop_bits=bus.stop_bits
        )
    common = replace(common, host=bus.host, port=bus.port)
    if isinstance(bus, RtuOverTcpBus):
        return replace(common, baudrate=bus.baudrate, parity=bus.parity, stop_bits=bus.stop_bits)
    if isinstance(bus, TlsBus):
        return replace(
            common,
            server_name=bus.server_name,
            certificate_authority=folder / bus.certificate_authority,
            certificate=folder / bus.certificate if bus.certificate else None,
            private_key=folder / bus.private_key if bus.private_key else None,
        )
    return common
