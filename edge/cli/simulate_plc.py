"""`igrow-edge simulate-plc`: a greenhouse that is not there, behind a PLC that is not there, over Modbus."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import signal
from pathlib import Path

import numpy as np

from igrow.core.greenhouse import GreenhouseParameters, HiddenEffect, VirtualGreenhouse, generate_weather
from igrow.core.greenhouse.described import parameters_of, parse_effect
from igrow.core.greenhouse.weather import WeatherClimate
from igrow.core.site import Site, load_site
from igrow.core.telemetry import Telemetry, read_csv
from igrow.edge.cli.common import parse_time
from igrow.edge.registers.loading import load_register_map
from igrow.edge.registers.model import Parity, RegisterMap
from igrow.edge.virtual_plc.pace import parse_pace
from igrow.edge.virtual_plc.virtual_plc import VirtualPlc

EXAMPLE = (
    "igrow-edge simulate-plc --site config/site.yaml --map config/register-maps/virtual-plc.yaml \\\n"
    "      --pace speed=60 --effect wind_infiltration=0.1@2020-03-14"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("--site", type=Path, help="the greenhouse to simulate (default: the built-in one)")
    parser.add_argument("--map", type=Path, required=True, help="the register map by which its registers are laid out")
    parser.add_argument("--device", help="which device of the map to play (default: its first)")
    parser.add_argument("--host", default="127.0.0.1", help="address to listen on (default: 127.0.0.1)")
    parser.add_argument("--port", type=int, default=None, help="TCP port (default: the map's; 0 takes a free one)")
    parser.add_argument("--rtu", action="store_true", help="RTU frames inside TCP")
    parser.add_argument("--serial", help="answer on a serial port instead of TCP")
    parser.add_argument("--baudrate", type=int, default=19200, help="of the serial port (default: 19200)")
    parser.add_argument(
        "--parity",
        choices=[parity.value for parity in Parity],
        default="even",
        help="of the serial port (default: even)",
    )
    parser.add_argument(
        "--pace", default="realtime", help="realtime, speed=N, lockstep or lockstep=SECONDS (default: realtime)"
    )
    parser.add_argument("--weather", type=Path, help="telemetry file with measured weather (default: generated)")
    parser.add_argument("--start", default=None, help="UTC time (default: the weather file's first, or 2020-01-15)")
    parser.add_argument("--days", type=float, default=365.0, help="how much weather to generate (default: 365)")
    parser.add_argument("--seed", type=int, default=1, help="of weather, disturbances and sensor noise")
    parser.add_argument(
        "--spread", type=float, default=0.0, help="how far the plant's parameters lie from the site's, relative"
    )
    parser.add_argument("--fallback-after", type=float, default=900.0, help="plant seconds without heartbeat")
    parser.add_argument("--young", action="store_true", help="begin with a young crop")
    parser.add_argument(
        "--effect", action="append", default=[], metavar="NAME[=SIZE][@START]", help="something that no model knows"
    )


def run(options: argparse.Namespace) -> int:
    """Serve until told to stop."""
    register_map = load_register_map(options.map)
    site = load_site(options.site) if options.site else None
    plant = make_plant(
        site,
        weather=read_csv(options.weather) if options.weather else None,
        start=options.start,
        days=options.days,
        seed=options.seed,
        effects=[parse_effect(text) for text in options.effect],
        young=options.young,
        spread=options.spread,
    )
    asyncio.run(_serve(options, plant, register_map))
    return 0


def make_plant(
    site: Site | None,
    *,
    weather: Telemetry | None,
    start: str | None,
    days: float,
    seed: int,
    effects: list[HiddenEffect],
    young: bool = False,
    spread: float = 0.0,
) -> VirtualGreenhouse:
    """Return the greenhouse that a site describes, under measured or generated weather. Raises IgrowError."""
    if start is not None:
        begin = np.datetime64(int(parse_time(start)), "s")
    else:
        begin = np.datetime64("2020-01-15T00:00:00", "s") if weather is None else weather.time[0]
    if weather is None:
        place = WeatherClimate() if site is None else WeatherClimate(site.latitude, site.longitude)
        end = begin + np.timedelta64(int(days * 86_400), "s")
        weather = generate_weather(begin, end, seed=seed, climate=place)
    parameters = GreenhouseParameters() if site is None else parameters_of(site)
    return VirtualGreenhouse(
        parameters.varied(np.random.default_rng(seed), spread) if spread else parameters, weather, begin,
        effects=effects, seed=seed, crop="young" if young else "mature",
    )  # fmt: skip


async def _serve(options: argparse.Namespace, plant: VirtualGreenhouse, register_map: RegisterMap) -> None:
    plc = VirtualPlc(
        plant, register_map, parse_pace(options.pace), device=options.device, fallback_after=options.fallback_after
    )
    stop = asyncio.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        asyncio.get_running_loop().add_signal_handler(number, stop.set)
    if options.serial:
        await plc.start_serial(options.serial, options.baudrate, Parity(options.parity))
        where = options.serial
    else:
        port = _port_of(options, register_map)
        where = f"{options.host}:{await plc.start(options.host, port, rtu=options.rtu)}"
    print(f"simulated PLC on {where}, {options.pace}, plant time {plant.time}", flush=True)
    with contextlib.suppress(asyncio.CancelledError):
        await stop.wait()
    await plc.close()


def _port_of(options: argparse.Namespace, register_map: RegisterMap) -> int:
    if options.port is not None:
        return int(options.port)
    device = register_map.devices[options.device or next(iter(register_map.devices))]
    return register_map.buses[device.bus].port
