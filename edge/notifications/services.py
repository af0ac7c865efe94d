"""The services that Apprise knows, each on its own, so that one that is broken is told from the others."""

from __future__ import annotations

from collections.abc import Sequence

from igrow.core.errors import IgrowError
from igrow.edge.alarm_levels import Level
from igrow.edge.notifications.notifier import Service
from igrow.edge.notifications.outbox import Message


def open_services(addresses: Sequence[str]) -> list[Service]:
    """Return the services behind Apprise addresses; raises IgrowError for one that Apprise does not know."""
    try:
        from apprise import Apprise, NotifyType  # noqa: PLC0415 - an extra that control does not need
    except ImportError:
        raise IgrowError("notifications need Apprise: install igrow[notify]") from None
    kinds = {Level.NOTICE: NotifyType.INFO, Level.WARNING: NotifyType.WARNING, Level.CRITICAL: NotifyType.FAILURE}

    class AppriseService:
        def __init__(self, number: int, address: str) -> None:
            self._target = Apprise()
            scheme = address.partition("://")[0]
            if not self._target.add(address):
                # The address may hold a password: only its kind is repeated.
                raise IgrowError(
                    f"notifications.services, number {number}: Apprise knows no such {scheme}:// address; "
                    "ntfys://HOST/TOPIC or mailtos://USER:PASSWORD@HOST is right"
                )
            shown = self._target[0].url(privacy=True)  # type: ignore[no-untyped-call]
            self.name = str(shown).partition("?")[0]

        def send(self, message: Message) -> bool:
            return bool(self._target.notify(body=message.body, title=message.title, notify_type=kinds[message.level]))

    return [AppriseService(number, address) for number, address in enumerate(addresses, 1)]
