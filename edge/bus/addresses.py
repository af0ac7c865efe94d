"""Where a host is: its name is looked up aside, and what was answered last goes on while no name server answers.

A name server may be slower than any PLC (a resolver asks the next one after 5 s), fail, or hang. None of it says
anything about the PLC, so it must not cost the line.
"""

from __future__ import annotations

import socket
from concurrent.futures import Future

from igrow.edge.hand_off import HandOff, settled
from igrow.edge.host_names import is_address


class Addresses:
    """The addresses of one host, as many as its name has."""

    def __init__(self, host: str) -> None:
        self._host = host
        self._aside = HandOff(f"name {host}")
        self._look: Future[None] | None = None
        self._known = [host] if is_address(host) else []
        self._worked = ""

    async def now(self, seconds: float) -> list[str]:
        """Return where the host is, the address that worked last before the others.

        By an answer that comes within so many seconds, else by the one before. Raises OSError while there was none.
        """
        if is_address(self._host):
            return self._known
        if self._look is None or self._look.done():
            self._look = self._aside.post(self._look_up)
        look = self._look
        await settled(look, seconds)
        if not self._known:
            if not look.done():
                raise OSError(0, f"no name server has said yet where {self._host} is")
            look.result()
        return sorted(self._known, key=lambda address: address != self._worked)

    def worked(self, address: str) -> None:
        """Hear which address could be connected to."""
        self._worked = address

    def close(self) -> None:
        """Let go of the thread; one that waits for a name server is left behind."""
        self._aside.close(0.0)

    def _look_up(self) -> None:
        """Ask whoever knows names (in the thread)."""
        found = socket.getaddrinfo(self._host, None, type=socket.SOCK_STREAM)
        self._known = list(dict.fromkeys(_with_zone(*place) for *_, place in found))


def _with_zone(address: str | int, port: object, flow: object = 0, zone: object = 0) -> str:
    """Return an address as it is written; a link-local one means nothing without the number of its network."""
    return f"{address}%{zone}" if zone else str(address)
