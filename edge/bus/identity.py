"""Whether a unit is the one that the map means: by registers that only this one shows."""

from __future__ import annotations

from dataclasses import replace

from igrow.edge.bus.errors import AddressRefusedError, BusError, OtherUnitError
from igrow.edge.bus.protocol import Bus, Priority, ReadRequest
from igrow.edge.registers.model import Device


async def not_itself(bus: Bus, device: Device) -> BusError | None:
    """Ask a unit who it is; None where it is itself, or where the map does not say how to tell."""
    identity = device.identity
    if identity is None:
        return None
    request = ReadRequest(device.device_id, identity.function, identity.address, len(identity.content))
    try:
        shown = await bus.read(request, Priority.CONTROL)
    except AddressRefusedError as error:
        return OtherUnitError(f"unit {device.name} does not show its `identity` in the map, {identity}: {error}")
    except BusError as error:
        return error
    if shown == identity.content:
        return None
    shows = replace(identity, content=shown)
    return OtherUnitError(f"unit {device.name} shows {shows}, but its `identity` in the map is {identity}")
