"""The services that Apprise knows, each on its own, so that one that is broken is told from the others."""

from __future__ import annotations

from collections.abc import Sequence

from igrow.core.errors import IgrowError
from igrow.edge.notifications.message import Message
from igrow.edge.notifications.notifier import Service
from igrow.edge.notifications.sending import send_aside


def open_services(addresses: Sequence[str]) -> list[Service]:
    """Return the services behind Apprise addresses; raises IgrowError for one that Apprise does not know."""
    try:
        from apprise import Apprise  # noqa: PLC0415 - an extra that control does not need
    except ImportError:
        raise IgrowError("notifications need Apprise: install igrow[notify]") from None

    class AppriseService:
        def __init__(self, number: int, address: str) -> None:
            target = Apprise()
            self._address = address
            scheme = address.partition("://")[0]
            if not target.add(address):
                # The address may hold a password: only its kind is repeated.
                raise IgrowError(
                    f"notifications.services, number {number}: Apprise knows no such {scheme}:// address; "
                    "ntfys://HOST/TOPIC or mailtos://USER:PASSWORD@HOST is right"
                )
            shown = target[0].url(privacy=True)  # type: ignore[no-untyped-call]
            self.name = str(shown).partition("?")[0]

        def send(self, message: Message) -> bool:
            return send_aside(self._address, message)

    return [AppriseService(number, address) for number, address in enumerate(addresses, 1)]
