"""How busy a register map keeps its buses, from baud rate, gaps and poll periods. Pure."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

from igrow.edge.registers.model import BusSettings, Device, Parity, Point, RegisterMap
from igrow.edge.registers.read_planner import Block, plan_reads

HIGHEST_LOAD = 0.5
"""Share of the time above which a bus has no room left for retries, writes and a slow device."""

EVERY_CYCLE = 5.0
"""Seconds between two cycles where nobody says: a map alone does not know them."""

TURNAROUND = 0.005
"""Seconds that a device is assumed to think before it answers."""


@dataclass(frozen=True)
class BusLoad:
    """Estimate for one bus."""

    bus: str
    requests_per_second: float
    busy: float
    """Share of the time that the bus is occupied, 1 = always."""

    @property
    def acceptable(self) -> bool:
        """Tell whether enough time is left."""
        return self.busy <= HIGHEST_LOAD

    def __str__(self) -> str:
        return (
            f"bus {self.bus} is busy {100 * self.busy:.0f} % of the time "
            f"({self.requests_per_second:.2f} requests/s); the limit is {100 * HIGHEST_LOAD:.0f} %"
        )


def transaction_time(bus: BusSettings, device: Device, request_bytes: int, answer_bytes: int) -> float:
    """Return the seconds that one request and its answer occupy the bus, gaps included.

    The byte counts are those of the RTU frames. On a serial line a character has a start bit, eight data
    bits, the parity bit and the stop bits, and each frame is followed by a silence of 3.5 characters
    (Modbus over Serial Line V1.02, section 2.5.1). A TCP bus is charged the turnaround only.
    """
    wire = 0.0
    if bus.transport.is_rtu:
        bits = 1 + 8 + (0 if bus.parity is Parity.NONE else 1) + bus.stop_bits
        character = bits / bus.baudrate
        wire = (request_bytes + answer_bytes + 7) * character
    return wire + TURNAROUND + max(bus.gap, device.gap)


def read_time(bus: BusSettings, device: Device, block: Block) -> float:
    """Return the seconds that reading one block occupies the bus."""
    data = (block.count + 7) // 8 if block.function.holds_bits else 2 * block.count
    return transaction_time(bus, device, 8, 5 + data)


def estimate(register_map: RegisterMap, *, cycle: float | None = None) -> tuple[BusLoad, ...]:
    """Return the load of every bus of the map, reads by their poll periods and the heartbeat's writes.

    `cycle` is the time in seconds between two control cycles; nothing is read more often.
    """
    busy: dict[str, float] = defaultdict(float)
    rate: dict[str, float] = defaultdict(float)
    by_period: dict[float, list[Point]] = defaultdict(list)
    for point in register_map.points.values():
        by_period[point.poll or EVERY_CYCLE if cycle is None else max(point.poll, cycle)].append(point)
    for period, points in by_period.items():
        for block in plan_reads(points, register_map.devices):
            device = register_map.devices[block.device]
            busy[device.bus] += read_time(register_map.buses[device.bus], device, block) / period
            rate[device.bus] += 1 / period
        for point in points:
            written = point.refresh or (period if point.name == "heartbeat" else None)
            if point.writable and written:
                device = register_map.devices[point.device]
                bus = register_map.buses[device.bus]
                busy[device.bus] += transaction_time(bus, device, 9 + 2 * point.type.width, 8) / written
                rate[device.bus] += 1 / written
    for device in register_map.devices.values():
        if device.identity is not None:
            bus, answer = register_map.buses[device.bus], 5 + 2 * len(device.identity.content)
            busy[device.bus] += transaction_time(bus, device, 8, answer) / (cycle or EVERY_CYCLE)
            rate[device.bus] += 1 / (cycle or EVERY_CYCLE)
    return tuple(BusLoad(name, rate[name], busy[name]) for name in register_map.buses)
