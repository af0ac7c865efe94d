"""Shows what a Modbus device answers, raw and decoded in every way, to help to find a register map."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from igrow.edge.bus.errors import BusError, RefusedError
from igrow.edge.bus.identity import not_itself
from igrow.edge.bus.modbus_bus import ModbusBus
from igrow.edge.bus.protocol import Bus, Priority, ReadRequest
from igrow.edge.registers.codec import decode_raw
from igrow.edge.registers.model import BusSettings, ByteOrder, DataType, Device, Function

_BY_WIDTH = {
    1: (DataType.INT16, DataType.UINT16),
    2: (DataType.INT32, DataType.UINT32, DataType.FLOAT32),
    4: (DataType.INT64, DataType.UINT64, DataType.FLOAT64),
}
_TURNED = (ByteOrder.ABCD, ByteOrder.BADC)


@dataclass(frozen=True)
class Answers:
    """What a line gave."""

    lines: list[str]
    """For people."""
    any: bool
    """Whether a unit answered at all, be it with a refusal."""


async def probe(
    settings: BusSettings,
    device_ids: Sequence[int] = (1,),
    function: Function = Function.HOLDING,
    first: int = 0,
    count: int = 16,
    devices: Iterable[Device] = (),
) -> Answers:
    """Return which units answer, what their registers hold, and what that may mean.

    Each unit is asked for `count` addresses from `first` on, in one request, then one by one where it refuses; those of
    `devices` also for their identity.
    Reads only. Never raises BusError: what goes wrong stands in the lines.
    """
    bus = ModbusBus(settings, rest_step=0.0)
    bus.start()
    try:
        units = [await probe_unit(bus, device_id, function, first, count) for device_id in device_ids]
        identities = [await _identity(bus, device) for device in devices if device.identity is not None]
        return Answers([*(line for unit in units for line in unit.lines), *identities], any(unit.any for unit in units))
    finally:
        await bus.close()


async def _identity(bus: Bus, device: Device) -> str:
    error = await not_itself(bus, device)
    return f"unit {device.name} shows its identity: {device.identity}" if error is None else str(error)


async def probe_unit(bus: Bus, device_id: int, function: Function, first: int, count: int) -> Answers:
    """Return what one unit answers on a bus that was started."""
    what = f"unit {device_id}, {function.value} {first} to {first + count - 1}"
    try:
        content: dict[int, int] = dict(
            enumerate(await bus.read(ReadRequest(device_id, function, first, count), Priority.LOG), first)
        )
        lines = [f"{what}: answers"]
    except RefusedError as error:
        lines = [f"{error}; asking for each address alone"]
        content = {}
        for address in range(first, first + count):
            try:
                (content[address],) = await bus.read(ReadRequest(device_id, function, address, 1), Priority.LOG)
            except RefusedError:
                continue
            except BusError as failure:
                return Answers([*lines, *decoded(content, function), str(failure)], any=True)
        if not content:
            return Answers([*lines, "  the unit is there, but holds nothing at these addresses"], any=True)
    except BusError as error:
        return Answers([str(error)], any=False)
    return Answers([*lines, *decoded(content, function)], any=True)


def decoded(content: dict[int, int], function: Function) -> Iterator[str]:
    """Yield lines with each address' raw content and every value that could begin there.

    `content` maps addresses to registers or bits. Values of 32 and 64 bits are shown in the four byte orders,
    those of 16 bits in the two that differ.
    """
    for address, raw in sorted(content.items()):
        if function.holds_bits:
            yield f"  {address:>5}  {raw}"
            continue
        yield f"  {address:>5}  0x{raw:04x}  bits {raw:016b}"
        for width, types in _BY_WIDTH.items():
            registers = [content.get(address + offset) for offset in range(width)]
            words = [word for word in registers if word is not None]
            if len(words) < width:
                continue
            orders = _TURNED if width == 1 else tuple(ByteOrder)
            for data_type in types:
                values = [f"{order.value} {_number(decode_raw(words, data_type, order))}" for order in orders]
                yield f"         {data_type.value:<8} {'  '.join(values)}"


def _number(value: int | float) -> str:
    """Return an integer with all its digits, and a float with those that a float32 has."""
    return str(value) if isinstance(value, int) else f"{value:.7g}"


async def scan(settings: BusSettings, device_ids: Sequence[int] = range(1, 248)) -> Answers:
    """Return one line for every unit that answers at all, be it with a refusal. One timeout for each that does not."""
    bus = ModbusBus(settings, rest_step=0.0)
    bus.start()
    lines: list[str] = []
    problem = ""
    try:
        for device_id in device_ids:
            try:
                await bus.read(ReadRequest(device_id, Function.HOLDING, 0, 1), Priority.LOG)
                lines.append(f"unit {device_id}: answers")
            except RefusedError as error:
                lines.append(f"unit {device_id}: is there ({error})")
            except BusError as error:
                problem = f", at last: {error}"
                await asyncio.sleep(0)
        return Answers(lines or [f"no unit answers{problem}"], any=bool(lines))
    finally:
        await bus.close()
