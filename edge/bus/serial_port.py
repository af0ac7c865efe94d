"""How a serial port is opened and let go, by pymodbus' transport, which pyserial alone does not give asyncio."""

from __future__ import annotations

import asyncio

from pymodbus.transport.serialtransport import SerialTransport

from igrow.edge.hand_off import HandOff
from igrow.edge.registers.model import Parity

_PARITY = {Parity.NONE: "N", Parity.EVEN: "E", Parity.ODD: "O"}


async def open_serial_port(
    protocol: asyncio.Protocol, port: str, baudrate: int, parity: Parity, stop_bits: int, aside: HandOff
) -> None:
    """Connect a protocol to a serial port, 8 data bits; a driver that hangs in it holds nobody.

    Raises OSError where the port is absent or taken, LateError while an earlier attempt hangs.
    """
    loop = asyncio.get_running_loop()
    transport = await aside.run(
        lambda: SerialTransport(loop, protocol, port, baudrate, 8, _PARITY[parity], stop_bits, 0),
        undo=lambda late: late.sync_serial.close(),
    )
    loop.call_soon(transport.setup)


def drop(transport: asyncio.Transport) -> None:
    """Close a line at once: what was not sent yet is thrown away, as closing a serial port would wait for it."""
    if isinstance(transport, SerialTransport) and transport.sync_serial:
        transport.sync_serial.reset_output_buffer()
    transport.close()
