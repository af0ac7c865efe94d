"""The daemon's configuration: one YAML file that names the site, the register map and where things are kept.

`load_configuration` reads all three files and checks them against each other, so that a daemon that starts (or
reloads) with them finds nothing wrong later. Paths are relative to the file that names them.
"""

# ruff: noqa: RUF009 - `setting` makes a dataclass field

from __future__ import annotations

import datetime
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path
from zoneinfo import ZoneInfo

from igrow.core.agronomy import Place
from igrow.core.bundle import default_bundle_folder
from igrow.core.errors import IgrowError
from igrow.core.exchange.address import Address, parse_address
from igrow.core.local_time import zone
from igrow.core.quantities import QUANTITIES, SETPOINTS
from igrow.core.site import Site, load_site
from igrow.core.yaml_schema import duration, load, place, setting
from igrow.edge.climate_alarms import ClimateAlarm
from igrow.edge.guard import DEFAULT_INTERLOCKS, GuardRules
from igrow.edge.guard.rules import GuardRuleError
from igrow.edge.guard.writer import HEARTBEAT
from igrow.edge.guard_settings import GuardSettings, SensorSettings
from igrow.edge.mqtt.settings import MqttSettings
from igrow.edge.notifications.settings import NotificationSettings
from igrow.edge.page.settings import PageSettings
from igrow.edge.point_rules import highest_beat, point_rule
from igrow.edge.registers.bus_load import estimate
from igrow.edge.registers.loading import load_register_map
from igrow.edge.registers.model import RegisterMap
from igrow.edge.sensors.rules import SensorRule, default_rule
from igrow.edge.sources.recipe import Recipe

_SECOND = datetime.timedelta(seconds=1)
_MINUTE = datetime.timedelta(minutes=1)
_HOUR = datetime.timedelta(hours=1)
_DAY = datetime.timedelta(days=1)
BUILT_IN_BUNDLE = "built_in"
"""What `bundle` says for the one that is installed with igrow."""
WRITABLE_BAD_SAMPLES = 2
"""Readings in a row until a register that we write is believed to show what it cannot mean."""
STATUS_PORT = 8420
"""The one port that the systemd unit lets the daemon listen on (SocketBindAllow)."""


class ConfigurationError(IgrowError):
    """Site, register map and daemon file do not fit together."""


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
    updates: UpdateSettings = setting(default_factory=UpdateSettings, help="new bundles")
    status: StatusSettings = setting(default_factory=StatusSettings, help="state for programs")
    page: PageSettings = setting(default_factory=PageSettings, help="the grower's page")
    notifications: NotificationSettings = setting(default_factory=NotificationSettings, help="who is told of alarms")
    mqtt: MqttSettings = setting(default_factory=MqttSettings, help="state for a broker")


@dataclass(frozen=True)
class Configuration:
    """Everything that the daemon runs by, checked and put together."""

    path: Path
    file: DaemonFile
    site: Site
    register_map: RegisterMap
    guard_rules: GuardRules
    sensor_rules: Mapping[str, SensorRule]
    setpoints: tuple[str, ...]
    """Setpoints that the PLC takes, in the registry's order."""

    @property
    def zone(self) -> ZoneInfo:
        """The site's time zone."""
        return zone(self.site.time_zone)

    @property
    def state_folder(self) -> Path:
        """Where the daemon keeps its memory."""
        return self._folder(self.file.state)

    @property
    def store_folder(self) -> Path:
        """Where its log and ledger are."""
        return self.state_folder / "store"

    @property
    def exchange(self) -> Address | None:
        """Where the trainer is met, or None."""
        return None if self.file.exchange is None else parse_address(self.file.exchange, self.path.parent)

    @property
    def known_hosts(self) -> Path | None:
        """The file with the SFTP server's key, or None."""
        return None if self.file.transfer.known_hosts is None else self._folder(self.file.transfer.known_hosts)

    @property
    def identity(self) -> Path | None:
        """The file with our private key for SFTP, or None."""
        return None if self.file.transfer.identity is None else self._folder(self.file.transfer.identity)

    @property
    def bundle_folder(self) -> Path | None:
        """The bundle to begin with, or None."""
        if self.file.bundle == BUILT_IN_BUNDLE:
            return default_bundle_folder()
        return None if self.file.bundle is None else self._folder(self.file.bundle)

    @property
    def trusted_root(self) -> Path | None:
        """The trainer's root of trust, or None: then no bundle is fetched."""
        root = self.file.updates.trusted_root
        return None if root is None else self._folder(root)

    @property
    def forecast_file(self) -> Path | None:
        """The weather forecast, or None."""
        forecast = self.file.planning.forecast
        return None if forecast is None else self._folder(forecast)

    def _folder(self, text: str) -> Path:
        return self.path.parent / text


def load_configuration(path: str | os.PathLike[str]) -> Configuration:
    """Read the daemon's file and those that it names.

    Raises SchemaError for an error inside a file and ConfigurationError when the files do not fit together.
    """
    path = Path(path)
    file = load(path, DaemonFile)
    for key, name in (("site", file.site), ("register_map", file.register_map)):
        if not (path.parent / name).is_file():
            raise ConfigurationError(
                f"{place(path, key)}: there is no file {path.parent / name}: name one that is there"
            )
    site = load_site(path.parent / file.site)
    register_map = load_register_map(path.parent / file.register_map)
    return put_together(path, file, site, register_map)


def put_together(path: Path, file: DaemonFile, site: Site, register_map: RegisterMap) -> Configuration:
    """Check the parts against each other. Raises ConfigurationError."""
    points, site_file = register_map.points, path.parent / file.site
    setpoints = tuple(name for name in SETPOINTS if name in points and points[name].writable)
    missing = [name for name in site.setpoints if name not in setpoints]
    if missing:
        raise ConfigurationError(
            f"{place(site_file, 'setpoints')}: the site commands {', '.join(missing)}, which the register map has no "
            "writable point for: add the point there, or list in `setpoints` only what it can write"
        )
    _check_clock(path, file.cycle, register_map)
    _check_exchange(path, file)
    _check_heartbeat(path, register_map)
    setpoints = tuple(name for name in setpoints if name in site.setpoints)
    for name in file.guard.points:
        if name not in points or not points[name].writable:
            raise ConfigurationError(
                f"{place(path, 'guard', 'points', name)}: the register map cannot write {name}: "
                "give its point `writable: true`, or leave it out here"
            )
    rules = {}
    for name in (*setpoints, *file.guard.points):
        limits = file.guard.points.get(name) or site.limits[name]
        where = (path, "guard", "points", name) if name in file.guard.points else (site_file, "limits", name)
        try:
            rule = point_rule(limits, points[name], file.guard.non_volatile_daily_budget)
            rules[name] = replace(rule, decided=name in setpoints)
        except GuardRuleError as error:
            raise ConfigurationError(f"{place(*where)}: {error}") from None
    settings = file.guard.interlocks
    interlocks = DEFAULT_INTERLOCKS if settings is None else tuple(entry.interlock() for entry in settings)
    return Configuration(
        path=path,
        file=file,
        site=site,
        register_map=register_map,
        guard_rules=GuardRules(rules, interlocks, Place.of(site)),
        sensor_rules=sensor_rules(register_map, file),
        setpoints=setpoints,
    )


def _check_exchange(path: Path, file: DaemonFile) -> None:
    """Raise ConfigurationError for an address that is none, or a server whose key is not pinned."""
    if file.exchange is None:
        return
    try:
        address = parse_address(file.exchange, path.parent)
    except IgrowError as error:
        raise ConfigurationError(f"{place(path, 'exchange')}: {error}") from None
    if address.scheme == "sftp" and file.transfer.known_hosts is None:
        raise ConfigurationError(
            f"{place(path, 'exchange')}: the server's key must be pinned: write what `ssh-keyscan {address.host}` "
            "prints into a file, compare the fingerprint with its owner's, and name the file in `transfer: known_hosts`"
        )


def _check_heartbeat(path: Path, register_map: RegisterMap) -> None:
    """Raise ConfigurationError for a heartbeat register that cannot show a change."""
    heartbeat = register_map.points.get(HEARTBEAT)
    if heartbeat is None:
        return
    try:
        highest_beat(heartbeat)
    except GuardRuleError as error:
        raise ConfigurationError(f"{register_map.path or path}: points.{error}") from None


def _check_clock(path: Path, cycle: CycleSettings, register_map: RegisterMap) -> None:
    """Raise ConfigurationError for a pace that the registers or the buses cannot keep."""
    clock = cycle.clock
    needed = () if clock is ClockSource.SYSTEM else ("plc_clock",)
    for name in (*needed, "heartbeat") if clock is ClockSource.LOCKSTEP else needed:
        if name not in register_map.points:
            raise ConfigurationError(
                f"{place(path, 'cycle', 'clock')}: `clock: {clock.value}` needs the point {name} in the register map: "
                "add it there, or follow the `system` clock"
            )
    if clock is not ClockSource.SYSTEM:
        return
    for load_of_bus in estimate(register_map, cycle=cycle.interval.total_seconds()):
        if not load_of_bus.acceptable:
            raise ConfigurationError(
                f"{place(path, 'cycle', 'interval')}: with a cycle each {duration(cycle.interval)} {load_of_bus}: "
                "a longer interval, or `poll` periods for points that change slowly"
            )


def sensor_rules(register_map: RegisterMap, file: DaemonFile) -> dict[str, SensorRule]:
    """Return the rule of each point that can be read: the table's, changed by the file.

    What stands in a register that we write is no measurement; one that it cannot hold has to be seen twice.
    """
    interval = file.cycle.interval.total_seconds()
    rules = {}
    for name, point in register_map.points.items():
        rule = default_rule(name, poll_period=max(point.poll, interval), low=point.low, high=point.high)
        own = file.sensors.get(name)
        if point.writable:
            rule = replace(rule, bad_samples=WRITABLE_BAD_SAMPLES)
        rules[name] = rule if own is None else own.applied_to(rule)
    return rules
