"""`igrow-edge check-config`: what is wrong with the configuration, or what it means."""

from __future__ import annotations

import argparse
import ipaddress
from collections.abc import Iterator

from igrow.core.bundle import Bundle, read_bundle
from igrow.edge.cli.common import add_configuration, configuration_of
from igrow.edge.configuration import Configuration
from igrow.edge.daemon_file import PAGE_PORT, STATUS_PORT, ClockSource, PageSettings
from igrow.edge.registers.bus_load import estimate
from igrow.edge.registers.look_alikes import look_alikes
from igrow.edge.registers.model import SYSTEM_POINTS

EXAMPLE = "igrow-edge check-config /etc/igrow/daemon.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    add_configuration(parser)


def run(options: argparse.Namespace) -> int:
    """Check; print what was understood. An error is one line and exit code 2."""
    for line in describe(configuration_of(options)):
        print(line)
    return 0


def _planning(configuration: Configuration) -> str:
    """Say whether plans can be made; raises BundleError where the first bundle is none."""
    if not configuration.file.planning.enabled:
        return "off: the recipe rules"
    folder = configuration.bundle_folder
    if folder is None:
        return "waits for a bundle from the trainer; until then the recipe rules (bundle: null)"
    bundle: Bundle = read_bundle(folder)
    return f"on; first bundle: {bundle.label}, made for {bundle.manifest.site} ({folder})"


def _page(page: PageSettings) -> Iterator[str]:
    """Yield where the grower's page is, and what that asks for."""
    alone = ipaddress.ip_address(page.address).is_loopback
    yield f"page        port {page.port} of {'this machine alone' if alone else page.address} (igrow-edge page)"
    if page.port != PAGE_PORT:
        yield (
            f"  note      page.port is {page.port}: the systemd unit allows {PAGE_PORT} only; "
            "see docs/installation.md for the drop-in"
        )
    if not alone:
        yield "  note      passwords pass this network as they are typed; docs/page.md says how to encrypt them"


def _identities(configuration: Configuration) -> Iterator[str]:
    """Yield by what each unit is told from the others, and which ones cannot be."""
    devices = configuration.register_map.devices
    for name, device in devices.items():
        if device.identity is not None:
            yield f"  identity  {name}: {device.identity}"
    for unit, other in look_alikes(configuration.register_map, configuration.setpoints):
        if unit < other and devices[unit].identity is None and devices[other].identity is None:
            yield (
                f"  note      {unit} and {other} have their setpoints in the same registers: an `identity` would tell "
                "the one from the other; see docs/commissioning.md"
            )


def describe(configuration: Configuration) -> Iterator[str]:
    """Yield what the configuration means, for people."""
    site, register_map, file = configuration.site, configuration.register_map, configuration.file
    interval = file.cycle.interval.total_seconds()
    yield f"{configuration.path}: correct"
    yield f"site        {site.name} ({site.latitude:g}, {site.longitude:g}), {site.time_zone}"
    tested = "" if register_map.hardware_tested else "; never tested on hardware"
    yield f"registers   {register_map.title}: {len(register_map.points)} points{tested}"
    for assumption in register_map.check_on_site:
        yield f"  on site   {assumption}"
    simulated = file.cycle.clock is not ClockSource.SYSTEM
    yield from _identities(configuration)
    for load in estimate(register_map) if simulated else estimate(register_map, cycle=interval):
        yield f"  {load}"
    yield f"cycle       each {interval:g} s, clock: {file.cycle.clock.value}"
    for name, rule in configuration.guard_rules.points.items():
        parts = [f"{rule.low:g} to {rule.high:g}", f"safe {rule.safe:g}"]
        if rule.slew is not None:
            parts.append(f"{3600 * rule.slew:g} per hour")
        if rule.refresh is not None:
            parts.append(f"refreshed each {rule.refresh:g} s")
        if rule.daily_budget is not None:
            parts.append(f"{rule.daily_budget} writes a day")
        yield f"  writes    {name}: {', '.join(parts)}"
    for interlock in configuration.guard_rules.interlocks:
        moved = [name for name in interlock.bounds if name in configuration.guard_rules.points]
        if interlock.quantity not in register_map.points:
            text = f"NOT AT WORK, as the register map has no {interlock.quantity}"
        elif not moved:
            text = f"NOT AT WORK, as nothing that it moves can be written ({', '.join(interlock.bounds)})"
        else:
            text = f"{interlock.quantity} moves {', '.join(moved)}"
        yield f"  interlock {interlock.name}: {text}"
    for name in SYSTEM_POINTS:
        if name in ("heartbeat", "plc_fallback") and name not in register_map.points:
            yield f"  note      no point {name}: see docs/commissioning.md for why the PLC should have it"
    if file.status.port != STATUS_PORT:
        yield (
            f"  note      status.port is {file.status.port}: the systemd unit allows {STATUS_PORT} only; "
            "see docs/installation.md for the drop-in"
        )
    yield from _page(file.page)
    exchange = configuration.exchange
    yield f"state       {configuration.state_folder}; exchange: {exchange if exchange else 'none'}"
    for key, path in (
        ("transfer.known_hosts", configuration.known_hosts),
        ("transfer.identity", configuration.identity),
        ("updates.trusted_root", configuration.trusted_root),
    ):
        if path is not None and not path.is_file():
            yield f"  note      {key}: {path} is not there"
    yield f"planning    {_planning(configuration)}"
    if site.crop.unlike_its_species:
        yield f"  note      {site.crop.unlike_its_species}"
    if file.updates.enabled and configuration.trusted_root is None:
        yield "updates     off: no updates.trusted_root, so nothing could be verified"
