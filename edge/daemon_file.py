"""What the daemon's YAML file holds, each key with its unit, range, default and meaning."""

# ruff: noqa: RUF009 - `setting` makes a dataclass field

from __future__ import annotations

import datetime
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from igrow.core.quantities import QUANTITIES
from igrow.core.yaml_schema import setting
from igrow.edge.climate_alarms import ClimateAlarm
from igrow.edge.guard_settings import GuardSettings, SensorSettings
from igrow.edge.mqtt.settings import MqttSettings
from igrow.edge.notifications.settings import NotificationSettings
from igrow.edge.page.settings import PageSettings
from igrow.edge.sources.recipe import Recipe

_SECOND = datetime.timedelta(seconds=1)
_MINUTE = datetime.timedelta(minutes=1)
_HOUR = datetime.timedelta(hours=1)
_DAY = datetime.timedelta(days=1)
BUILT_IN_BUNDLE = "built_in"
"""What `bundle` says for the one that is installed with igrow."""
STATUS_PORT = 8420
"""The one port that the systemd unit lets the daemon listen on (SocketBindAllow)."""


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
