"""The daemon's configuration: one YAML file that names the site, the register map and where things are kept.

`load_configuration` reads all three files and checks them against each other, so that a daemon that starts (or
reloads) with them finds nothing wrong later. Paths are relative to the file that names them.
"""

from __future__ import annotations

import datetime
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

from igrow.core.agronomy import Place
from igrow.core.bundle import default_bundle_folder
from igrow.core.errors import IgrowError
from igrow.core.exchange.address import Address, parse_address
from igrow.core.local_time import zone
from igrow.core.quantities import QUANTITIES, SETPOINTS
from igrow.core.site import Site, load_site
from igrow.core.yaml_scalars import duration
from igrow.core.yaml_schema import SchemaError, load, place
from igrow.edge.daemon_file import BUILT_IN_BUNDLE, ClockSource, CycleSettings, DaemonFile
from igrow.edge.guard import DEFAULT_INTERLOCKS, GuardRules
from igrow.edge.guard.heartbeat import HEARTBEAT
from igrow.edge.guard.rules import GuardRuleError
from igrow.edge.point_rules import highest_beat, point_rule
from igrow.edge.registers.bus_load import estimate
from igrow.edge.registers.loading import load_register_map
from igrow.edge.registers.model import RegisterMap
from igrow.edge.sensors.rules import SensorRule, default_rule
from igrow.edge.sources.recipe import Period

WRITABLE_BAD_SAMPLES = 2
"""Readings in a row until a register that we write is believed to show what it cannot mean."""


class ConfigurationError(IgrowError):
    """Site, register map and daemon file do not fit together."""


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
    try:
        file = load(path, DaemonFile)
    except SchemaError:
        _refuse_what_it_names(path)
        raise
    for key, name in (("site", file.site), ("register_map", file.register_map)):
        if not (path.parent / name).is_file():
            raise ConfigurationError(
                f"{place(path, key)}: there is no file {path.parent / name}: name one that is there"
            )
    site = load_site(path.parent / file.site)
    register_map = load_register_map(path.parent / file.register_map)
    return put_together(path, file, site, register_map)


def _refuse_what_it_names(path: Path) -> None:
    """Raise ConfigurationError where a file is one of those that the daemon's file names."""
    files = (("site", "a site's file", load_site), ("register_map", "a register map", load_register_map))
    for key, kind, read in files:
        try:
            read(path)
        except IgrowError:
            continue
        raise ConfigurationError(f"{path}: is {kind}: give the daemon's file, which names it as `{key}`")


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
    # A recipe of before the PLC took them says nothing of these; plans and page compare with what it says.
    silent = [name for name in setpoints if QUANTITIES[name].optional and not file.recipe.periods(name)]
    always: dict[str, Any] = {name: (Period(datetime.time(), site.limits[name].safe),) for name in silent}
    file = replace(file, recipe=replace(file.recipe, **always))
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
            f"{place(path, 'exchange')}: the server's key must be pinned: write what `{address.keyscan}` "
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
