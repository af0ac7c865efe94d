"""`igrow-edge probe`: what a device answers; helps to find a register map."""

from __future__ import annotations

import argparse
import asyncio
from dataclasses import replace

from igrow.core.errors import IgrowError
from igrow.edge.probe import probe, scan
from igrow.edge.registers.loading import load_register_map
from igrow.edge.registers.model import BusSettings, Device, Function, Parity, Transport

EXAMPLE = "igrow-edge probe --tcp 192.168.1.20 --units 1 --function input --first 0 --count 20"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    line = parser.add_mutually_exclusive_group(required=True)
    line.add_argument("--tcp", metavar="HOST[:PORT]", help="Modbus TCP")
    line.add_argument("--rtu-over-tcp", metavar="HOST:PORT", help="RTU frames through a converter")
    line.add_argument("--serial", metavar="PORT", help="a serial port, such as /dev/ttyUSB0")
    line.add_argument("--map", metavar="FILE", help="the buses of a register map")
    parser.add_argument("--bus", help="which bus of the map (default: its first)")
    parser.add_argument("--baudrate", type=int, default=19200, help="of a serial line (default: 19200)")
    parser.add_argument(
        "--parity", choices=[parity.value for parity in Parity], default="even", help="of a serial line (default: even)"
    )
    parser.add_argument("--stop-bits", type=int, choices=(1, 2), default=1, help="of a serial line (default: 1)")
    parser.add_argument("--timeout", type=float, default=1.0, help="seconds to wait for an answer")
    parser.add_argument("--scan", action="store_true", help="only say which units answer")
    parser.add_argument(
        "--units", default=None, help="unit numbers, such as 1 or 1,4 or 1-16 (default: 1; scan: 1-247)"
    )
    parser.add_argument(
        "--function", choices=[function.value for function in Function], default="holding", help="(default: holding)"
    )
    parser.add_argument("--first", type=int, default=0, help="first address, counted from 0 (default: 0)")
    parser.add_argument("--count", type=int, default=16, help="how many addresses (default: 16)")


def run(options: argparse.Namespace) -> int:
    """Ask and print; the exit code is 0 where a unit answered, else 1."""
    settings, devices = _settings(options)
    settings = replace(settings, timeout=options.timeout)
    if options.scan:
        answers = asyncio.run(scan(settings, parse_units(options.units or "1-247")))
    else:
        if not (options.first >= 0 and 1 <= options.count <= 125 and options.first + options.count <= 65536):
            raise IgrowError("--first and --count: 1 to 125 addresses between 0 and 65535 are right")
        units = parse_units(options.units or "1")
        answers = asyncio.run(probe(settings, units, Function(options.function), options.first, options.count, devices))
    print("\n".join(answers.lines))
    return 0 if answers.any else 1


def _settings(options: argparse.Namespace) -> tuple[BusSettings, list[Device]]:
    """Return the line, and what a map says of the devices on it."""
    if options.map:
        register_map = load_register_map(options.map)
        buses = register_map.buses
        name = options.bus or next(iter(buses))
        if name not in buses:
            raise IgrowError(f"{options.map}: there is no bus {name}: {', '.join(buses)}")
        return buses[name], [device for device in register_map.devices.values() if device.bus == name]
    if options.serial:
        return BusSettings(
            options.serial, Transport.RTU, serial_port=options.serial, baudrate=options.baudrate,
            parity=Parity(options.parity), stop_bits=options.stop_bits, gap=0.03,
        ), []  # fmt: skip
    host, port = _host_and_port(options.tcp or options.rtu_over_tcp)
    transport = Transport.TCP if options.tcp else Transport.RTU_OVER_TCP
    return BusSettings(f"{host}:{port}", transport, host=host, port=port, baudrate=options.baudrate), []


def _host_and_port(text: str) -> tuple[str, int]:
    host, separator, port = text.rpartition(":")
    if not separator:
        return text, 502
    try:
        return host, int(port)
    except ValueError:
        raise IgrowError(f"{text!r}: HOST or HOST:PORT is right") from None


def parse_units(text: str) -> list[int]:
    """Return the unit numbers of a text such as `1,4,8-12`; raises IgrowError."""
    units: list[int] = []
    try:
        for part in text.split(","):
            first, separator, last = part.partition("-")
            units.extend(range(int(first), int(last if separator else first) + 1))
    except ValueError:
        units = []
    if not units or not all(0 <= unit <= 255 for unit in units):
        raise IgrowError(f"--units {text!r}: numbers from 0 to 255, such as 1 or 1,4 or 1-16, are right")
    return units
