"""What the daemon's YAML file holds, each key with its unit, range, default and meaning."""

# ruff: noqa: RUF009 - `setting` makes a dataclass field

from __future__ import annotations

import datetime
import ipaddress
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Literal

from igrow.core.quantities import QUANTITIES
from igrow.core.yaml_schema import SettingError, setting
from igrow.edge.alarm_levels import Level
from igrow.edge.climate_alarms import ClimateAlarm
from igrow.edge.guard_settings import GuardSettings, SensorSettings
from igrow.edge.host_names import check_host
from igrow.edge.sources.recipe import Recipe

_SECOND = datetime.timedelta(seconds=1)
_MINUTE = datetime.timedelta(minutes=1)
_HOUR = datetime.timedelta(hours=1)
_DAY = datetime.timedelta(days=1)
BUILT_IN_BUNDLE = "built_in"
"""What `bundle` says for the one that is installed with igrow."""
STATUS_PORT = 8420
"""The one port that the systemd unit lets the daemon listen on (SocketBindAllow)."""
PAGE_PORT = 8421
"""The one port that the systemd unit lets the page listen on (SocketBindAllow)."""


class ClockSource(Enum):
    """Whose clock the daemon follows."""

    SYSTEM = "system"
    """The machine's own: a real greenhouse."""
    PLC = "plc"
    """The register plc_clock: a simulated plant that runs at its own pace."""
    LOCKSTEP = "lockstep"
    """The same, of a simulated plant that moves on with each heartbeat and so waits for plans and updates."""


@dataclass(frozen=True)
class CycleSettings:
    """The pace of control."""

    interval: datetime.timedelta = setting(
        low=_SECOND, high=10 * _MINUTE, default=10 * _SECOND, help="time between two cycles"
    )
    clock: ClockSource = setting(
        default=ClockSource.SYSTEM, help="system; for simulated plants plc or lockstep, which follow plc_clock"
    )
    confirm_within: datetime.timedelta = setting(
        low=_SECOND, high=_HOUR, default=_MINUTE, help="time for a write to show in a later reading"
    )
    respect_hand: datetime.timedelta = setting(
        low=datetime.timedelta(0), high=7 * _DAY, default=2 * _HOUR, help="how long a change at the PLC is respected"
    )


@dataclass(frozen=True)
class PlanningSettings:
    """How plans are made on this gateway; their pace and horizon are the site's."""

    enabled: bool = setting(default=True, help="false leaves control to the recipe")
    history: datetime.timedelta = setting(
        low=_DAY, high=30 * _DAY, default=4 * _DAY, help="how much of the log a plan starts from"
    )
    step: datetime.timedelta = setting(low=10 * _MINUTE, high=2 * _HOUR, default=_HOUR, help="step of a plan")
    timeout: datetime.timedelta = setting(
        low=_SECOND, high=6 * _HOUR, default=10 * _MINUTE, help="longest time that one plan may take"
    )
    forecast: str | None = setting(
        default=None, help="file with a forecast: Open-Meteo's .json, or telemetry; null: persistence"
    )
    seed: int = setting(low=0, default=1, help="seed of the planner's random numbers")


@dataclass(frozen=True)
class SeparatingTestSettings:
    """Small movements of the plant that tell causes apart; the grower approves each one."""

    permitted: bool = setting(default=False, help="true lets the grower approve them, one at a time")
    within: datetime.timedelta = setting(
        low=_HOUR, high=14 * _DAY, default=3 * _DAY, help="how long an approval waits for its weather"
    )


@dataclass(frozen=True)
class StatusSettings:
    """What programs ask: state, health and metrics."""

    port: int = setting(low=0, high=65535, default=STATUS_PORT, help="TCP port on localhost; 0 takes a free one")


@dataclass(frozen=True)
class UpdateSettings:
    """How new bundles are taken."""

    enabled: bool = setting(default=True, help="false keeps the bundle in force")
    shadow: datetime.timedelta = setting(
        low=_HOUR, high=30 * _DAY, default=2 * _DAY, help="how long a new bundle runs in the shadow"
    )
    watch: datetime.timedelta = setting(
        low=_HOUR, high=30 * _DAY, default=3 * _DAY, help="how long it may still be taken back by itself"
    )
    trusted_root: str | None = setting(default=None, help="root.json of the trainer's signing keys")


@dataclass(frozen=True)
class TransferSettings:
    """How the log goes to the trainer."""

    segment: datetime.timedelta = setting(
        low=_HOUR, high=_DAY, default=_DAY, help="how much of the log is sealed together"
    )
    every: datetime.timedelta = setting(
        low=_MINUTE, high=_DAY, default=15 * _MINUTE, help="time between two visits of the exchange"
    )
    budget: int = setting(low=8, high=100_000, default=256, help="MB that may wait for the trainer's receipt")
    known_hosts: str | None = setting(default=None, help="file with the SFTP server's key; sftp needs one")
    identity: str | None = setting(default=None, help="file with our private key for SFTP, or null")


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


@dataclass(frozen=True)
class NotificationSettings:
    """Who is told of alarms, and how often."""

    services: tuple[str, ...] = setting(default=(), help="Apprise addresses, such as ntfys://ntfy.example/greenhouse")
    level: Level = setting(default=Level.WARNING, help="least level that is told: notice, warning or critical")
    ends: bool = setting(default=True, help="tell when an alarm is over, too")
    repeat: datetime.timedelta = setting(
        low=5 * _MINUTE, high=7 * _DAY, default=datetime.timedelta(hours=4), help="told again until acknowledged"
    )
    most_per_hour: int = setting(low=1, high=60, default=6, help="messages an hour; the rest come together later")
    silent_daemon: datetime.timedelta = setting(
        low=_MINUTE, high=_DAY, default=5 * _MINUTE, help="silence of the daemon after which that is told"
    )


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


@dataclass(frozen=True)
class DaemonFile:
    """The whole file."""

    site: str = setting(help="the site's file")
    register_map: str = setting(help="the register map's file")
    state: str = setting(default="/var/lib/igrow-edge", help="folder for the log, leases and bundles")
    exchange: str | None = setting(
        default=None, help="where the trainer is met: a folder, sftp://... or s3://..., or null"
    )
    transfer: TransferSettings = setting(default_factory=TransferSettings, help="how the log goes there")
    bundle: str | None = setting(default=BUILT_IN_BUNDLE, help="folder of the bundle to begin with, built_in, or null")
    cycle: CycleSettings = setting(default_factory=CycleSettings, help="pace of control")
    guard: GuardSettings = setting(default_factory=GuardSettings, help="limits and interlocks")
    sensors: Mapping[str, SensorSettings] = setting(
        keys=QUANTITIES, default_factory=dict, help="sensors that differ from the table"
    )
    climate_alarms: tuple[ClimateAlarm, ...] | None = setting(
        default=None, help="thresholds that people are told of; null takes the crop's"
    )
    recipe: Recipe = setting(default_factory=Recipe, help="what rules when no plan does")
    planning: PlanningSettings = setting(default_factory=PlanningSettings, help="planning")
    separating_tests: SeparatingTestSettings = setting(
        default_factory=SeparatingTestSettings, help="tests of the plant that tell causes apart"
    )
    updates: UpdateSettings = setting(default_factory=UpdateSettings, help="new bundles")
    status: StatusSettings = setting(default_factory=StatusSettings, help="state for programs")
    page: PageSettings = setting(default_factory=PageSettings, help="the grower's page")
    notifications: NotificationSettings = setting(default_factory=NotificationSettings, help="who is told of alarms")
    mqtt: MqttSettings = setting(default_factory=MqttSettings, help="state for a broker")
