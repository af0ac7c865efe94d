"""How a socket is opened, TLS over it, and why a line could not be opened, for people."""

from __future__ import annotations

import asyncio
import errno
import os
import ssl

from igrow.edge.bus.addresses import Addresses
from igrow.edge.hand_off import HandOff
from igrow.edge.registers.model import BusSettings, Transport


async def open_socket(settings: BusSettings, protocol: asyncio.Protocol, addresses: Addresses, aside: HandOff) -> None:
    """Connect `protocol` by TCP or TLS; the disk that holds certificates is not waited for by the event loop.

    Raises OSError, ValueError or LateError.
    """
    tls = await aside.run(lambda: _tls_context(settings)) if settings.transport is Transport.TLS else None
    name = (settings.server_name or settings.host) if tls else None
    loop = asyncio.get_running_loop()
    end = loop.time() + settings.timeout
    candidates = await addresses.now(settings.timeout / 2)
    for left in range(len(candidates), 0, -1):
        # One after the other, each with its share of the time: a PLC may bear one connection only, so two that are
        # tried at once could shut each other out.
        host = candidates[-left]
        try:
            async with asyncio.timeout((end - loop.time()) / left):
                await loop.create_connection(lambda: protocol, host, settings.port, ssl=tls, server_hostname=name)
        except OSError:
            if left == 1:
                raise
        else:
            addresses.worked(host)
            return


def why_not_open(settings: BusSettings, error: Exception) -> str:
    """Return why a line could not be opened, for people."""
    where = settings.serial_port or f"{settings.host}:{settings.port}"
    if isinstance(error, TimeoutError):
        return f"no connection to {where} within {settings.timeout:g} s"
    if settings.serial_port and isinstance(error, OSError) and error.errno in (errno.EAGAIN, errno.EBUSY):
        # The lock that pyserial takes is said to be a resource that is unavailable for now.
        return f"no connection to {where}: another program has it open"
    if isinstance(error, OSError) and error.strerror:
        return f"no connection to {where}: {words(error)}"
    return str(error)


def words(error: Exception) -> str:
    """Return an error's reason without what asyncio and pyserial add for programmers."""
    if not isinstance(error, OSError) or not error.strerror:
        return str(error)
    # A name that is not found has a number of its own.
    return os.strerror(error.errno or 0) if error.errno in errno.errorcode else error.strerror


def _tls_context(settings: BusSettings) -> ssl.SSLContext:
    context = ssl.create_default_context(cafile=settings.certificate_authority)
    if settings.certificate is not None:
        context.load_cert_chain(settings.certificate, settings.private_key)
    return context
