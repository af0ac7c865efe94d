"""The section `page` of the daemon's file."""

# ruff: noqa: RUF009 - `setting` makes a dataclass field

from __future__ import annotations

import datetime
import ipaddress
from dataclasses import dataclass
from typing import Literal

from igrow.core.yaml_schema import SettingError, setting

_HOUR = datetime.timedelta(hours=1)
PAGE_PORT = 8421
"""The one port that the systemd unit lets the page listen on (SocketBindAllow)."""


@dataclass(frozen=True)
class PageSettings:
    """Where the grower's page is, and for how long one is signed in there."""

    address: str = setting(
        default="127.0.0.1", help="address to listen on; 127.0.0.1 is this machine alone, 0.0.0.0 every network"
    )
    port: int = setting(low=0, high=65535, default=PAGE_PORT, help="TCP port; 0 takes a free one")
    names: tuple[str, ...] = setting(
        default=(), help="names that browsers call this machine by, beside localhost and its addresses"
    )
    language: Literal["", "en", "nl", "de", "es", "zh"] = setting(
        default="", help="of the page: en, nl, de, es or zh; empty: what each browser asks for"
    )
    session: datetime.timedelta = setting(
        low=_HOUR, high=30 * 24 * _HOUR, default=12 * _HOUR, help="how long a sign-in lasts"
    )

    def __post_init__(self) -> None:
        try:
            ipaddress.ip_address(self.address)
        except ValueError:
            raise SettingError(
                f"{self.address!r} is no address: 127.0.0.1, ::1 or 0.0.0.0 is right", "address"
            ) from None
