"""The bus beside plain pymodbus, and what polling costs. `python -m benchmarks.bus`

Three figures:

- registers per second of `igrow.edge.bus` against pymodbus' own client, the same blocks from the same server
  (pymodbus', in a process of its own), in turns within one run; the ratio is the median over the turns;
- share of one core for ten units of 40 registers, polled every 5 s and decoded to values, measured over a minute;
- milliseconds for one lock-step cycle with the virtual PLC (heartbeat, then all points), and what pymodbus' server
  needs for the same three requests.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import statistics
import sys
import time
from collections.abc import AsyncIterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from pymodbus.client import AsyncModbusTcpClient
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from igrow.edge.bus.modbus_bus import ModbusBus
from igrow.edge.bus.plc import RegisterPlc
from igrow.edge.bus.protocol import Priority, ReadRequest
from igrow.edge.registers.loading import load_register_map
from igrow.edge.registers.model import BusSettings, Device, Function, Point, RegisterMap, Transport
from igrow.edge.registers.model import DataType as PointType
from igrow.edge.virtual_plc.pace import Lockstep
from igrow.edge.virtual_plc.virtual_plc import VirtualPlc

ROOT = Path(__file__).parents[1]
UNITS = range(1, 11)
REGISTERS = 40
GOAL_RATIO, GOAL_SHARE, GOAL_CYCLE = 0.8, 0.03, 0.004


async def serve(port: int) -> None:
    """Run pymodbus' server until killed."""
    devices = [
        SimDevice(unit, simdata=[SimData(0, count=200, values=unit, datatype=DataType.REGISTERS)]) for unit in UNITS
    ]
    await ModbusTcpServer(devices, address=("127.0.0.1", port)).serve_forever()


@contextlib.asynccontextmanager
async def server(port: int) -> AsyncIterator[None]:
    command = (sys.executable, "-m", "benchmarks.bus", "--serve", str(port))
    process = await asyncio.create_subprocess_exec(*command, cwd=ROOT)
    try:
        for _ in range(200):
            with contextlib.suppress(OSError):
                _, writer = await asyncio.open_connection("127.0.0.1", port)
                writer.close()
                break
            await asyncio.sleep(0.05)
        yield
    finally:
        process.kill()
        await process.wait()


def settings(port: int) -> BusSettings:
    return BusSettings("bench", Transport.TCP, host="127.0.0.1", port=port, timeout=3.0)


async def compare(port: int, requests: int, turns: int) -> None:
    """Print registers per second, ours and pymodbus', for short and long blocks."""
    client = AsyncModbusTcpClient("127.0.0.1", port=port, retries=0)
    await client.connect()
    bus = ModbusBus(settings(port))
    bus.start()
    for count in (1, REGISTERS, 100):
        ours, theirs = [], []
        for turn in range(turns + 1):
            begin = time.perf_counter()
            for _ in range(requests):
                answer = await client.read_holding_registers(0, count=count, device_id=1)
                if len(answer.registers) != count:
                    raise SystemExit("pymodbus got a wrong answer")
            middle = time.perf_counter()
            request = ReadRequest(1, Function.HOLDING, 0, count)
            for _ in range(requests):
                await bus.read(request, Priority.CONTROL)
            end = time.perf_counter()
            if turn:  # the first turn warms up
                theirs.append(requests * count / (middle - begin))
                ours.append(requests * count / (end - middle))
        ratio = statistics.median(a / b for a, b in zip(ours, theirs, strict=True))
        print(
            f"blocks of {count:>3} registers: {statistics.median(ours):>9,.0f} registers/s, "
            f"plain pymodbus {statistics.median(theirs):>9,.0f}, ratio {ratio:.2f} (goal at least {GOAL_RATIO})"
        )
    client.close()
    await bus.close()


def ten_units(port: int) -> RegisterMap:
    """Return a map of ten units with 20 float32 values each; the names are only labels here."""
    devices = {f"unit{unit}": Device(f"unit{unit}", "bench", unit) for unit in UNITS}
    points = {
        f"{name}.{place}": Point(f"{name}.{place}", name, Function.HOLDING, 2 * place, PointType.FLOAT32)
        for name in devices
        for place in range(REGISTERS // 2)
    }
    return RegisterMap("bench", "none", {"bench": settings(port)}, devices, points)


async def share(port: int, seconds: float) -> None:
    """Print the share of one core that polling ten units every 5 s takes."""
    plc = RegisterPlc(ten_units(port))
    plc.start()
    await plc.read()
    begin, used = time.perf_counter(), time.process_time()
    polls = 0
    while time.perf_counter() - begin < seconds:
        await plc.read()
        polls += 1
        await asyncio.sleep(max(0.0, begin + 5 * polls - time.perf_counter()))
    part = (time.process_time() - used) / (time.perf_counter() - begin)
    print(
        f"ten units of {REGISTERS} registers every 5 s: {100 * part:.2f} % of one core over {seconds:.0f} s "
        f"(goal at most {100 * GOAL_SHARE:.0f} %)"
    )
    await plc.close()


class StillPlant:
    """A plant that costs nothing, so that the cycle's own time is seen."""

    def __init__(self) -> None:
        self.time = np.datetime64("2020-01-01T00:00:00", "s")

    def step(self, seconds: float, setpoints: Mapping[str, float]) -> None:
        self.time = self.time + np.timedelta64(round(seconds), "s")

    def measurements(self) -> Mapping[str, float]:
        return {"air_temperature": 20.0, "air_humidity": 80.0, "air_co2": 600.0}


async def cycle(port: int, cycles: int) -> None:
    """Print the time of a lock-step cycle, server and client in this one process."""
    register_map = load_register_map(ROOT / "config" / "register-maps" / "virtual-plc.yaml")
    virtual = VirtualPlc(StillPlant(), register_map, Lockstep())
    bound = await virtual.start()
    buses = {name: replace(bus, port=bound) for name, bus in register_map.buses.items()}
    plc = RegisterPlc(replace(register_map, buses=buses))
    plc.start()
    begin = time.perf_counter()
    for beat in range(1, cycles + 1):
        await plc.write("heartbeat", beat % 65536)
        await plc.read()
    ours = (time.perf_counter() - begin) / cycles
    await plc.close()
    await virtual.close()
    bus = ModbusBus(settings(port))
    bus.start()
    begin = time.perf_counter()
    for _ in range(cycles):
        for count in (1, 48, 9):
            await bus.read(ReadRequest(1, Function.HOLDING, 0, count), Priority.CONTROL)
    theirs = (time.perf_counter() - begin) / cycles
    await bus.close()
    print(
        f"lock-step cycle, {len(register_map.points)} points: {1000 * ours:.2f} ms with plant step and decoding "
        f"(goal at most {1000 * GOAL_CYCLE:.0f} ms); "
        f"three such requests to pymodbus' server alone: {1000 * theirs:.2f} ms"
    )


async def main(quick: bool) -> None:
    port = 15020
    async with server(port):
        await compare(port, 300 if quick else 2000, 3 if quick else 7)
        await cycle(port, 300 if quick else 3000)
        await share(port, 10 if quick else 60)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="The bus beside plain pymodbus.")
    parser.add_argument("--quick", action="store_true", help="fewer requests and 10 s of polling")
    parser.add_argument("--serve", type=int, metavar="PORT", help=argparse.SUPPRESS)
    options = parser.parse_args()
    asyncio.run(serve(options.serve) if options.serve else main(options.quick))
