"""The section `mqtt` of the daemon's file."""

# ruff: noqa: RUF009 - `setting` makes a dataclass field

from __future__ import annotations

import datetime
from dataclasses import dataclass

from igrow.core.yaml_schema import setting
from igrow.edge.host_names import check_host

_SECOND = datetime.timedelta(seconds=1)
_HOUR = datetime.timedelta(hours=1)


@dataclass(frozen=True)
class MqttSettings:
    """Where the state is published, and whether anything may come back."""

    host: str | None = setting(default=None, help="the broker, or null: nothing is published")
    port: int = setting(low=1, high=65535, default=1883, help="its port; 8883 is usual with TLS")
    tls: bool = setting(default=False, help="true encrypts, and checks the broker's certificate")
    username: str | None = setting(default=None, help="name at the broker, or null")
    password_file: str | None = setting(default=None, help="file that holds the password alone, or null")
    prefix: str = setting(default="igrow", help="first part of every topic")
    discovery: str | None = setting(default="homeassistant", help="Home Assistant's discovery prefix, or null")
    every: datetime.timedelta = setting(low=_SECOND, high=_HOUR, default=10 * _SECOND, help="pace of publishing")
    permit_override: bool = setting(default=False, help="true lets messages override setpoints within the limits")
    override_for: datetime.timedelta = setting(
        low=60 * _SECOND, high=24 * _HOUR, default=2 * _HOUR, help="how long such an override lasts"
    )

    def __post_init__(self) -> None:
        if self.host is not None:
            check_host(self.host)
