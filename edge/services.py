"""The services that live as long as the daemon does: the store, plans, updates, the exchange, the status page."""

from __future__ import annotations

import logging
from dataclasses import dataclass

from igrow import __version__
from igrow.core.simulator.hindcast import HindcastPredictor
from igrow.edge.configuration import Configuration
from igrow.edge.daemon_file import ClockSource
from igrow.edge.exchange import ExchangeService
from igrow.edge.exchange.service import TransferRules
from igrow.edge.hand_off import PATIENCE, SHARE, HandOff
from igrow.edge.planning import GraphProcess, PlanningProcess
from igrow.edge.ports import Exchange, PlanningService, StatusService, Store, UpdateService
from igrow.edge.status import StatusServer
from igrow.edge.status.client import STATUS_FILE
from igrow.edge.store import StoreAside, StoreError, StoreLimits
from igrow.edge.updates import BundleUpdates, UpdateRules

SIMULATED_PATIENCE = 60.0
"""Seconds that a simulated plant waits for its disk, as it runs so fast that a share of its time would be none."""
STATE_FILE_SECONDS = 1.0
"""How long the stop waits for the small files of the state folder."""

log = logging.getLogger("igrow.edge")


@dataclass
class Services:
    """What lives as long as the daemon."""

    store: Store
    state_files: HandOff
    """Reads and writes the small files of the state folder."""
    graphs: GraphProcess
    planning: PlanningService | None
    updates: UpdateService
    exchange: Exchange | None
    status: StatusService

    def close(self) -> None:
        """Stop all but the status page; the store last, since the others still write to it.

        None of them waits for what hangs longer than its own few seconds.
        """
        self.graphs.close()
        if self.planning is not None:
            self.planning.close()
        self.updates.close()
        if self.exchange is not None:
            self.exchange.close()
        self.state_files.close(STATE_FILE_SECONDS)
        try:
            self.store.close()
        except StoreError as error:
            log.warning("%s", error)


def open_services(configuration: Configuration) -> Services:
    """Open the store and what works on it. Never raises for a bad disk or a bad bundle: each reports its health."""
    state, file, site = configuration.state_folder, configuration.file, configuration.site
    simulated = file.cycle.clock is not ClockSource.SYSTEM
    limits = StoreLimits(survive_power_cut=not simulated, batch_seconds=3600.0 if simulated else 60.0)
    patience, share = (SIMULATED_PATIENCE, 1.0) if simulated else (PATIENCE, SHARE)
    store = StoreAside(configuration.store_folder, limits, patience=patience, share=share)
    exchange = _exchange(configuration, store)
    graphs = GraphProcess()
    source = None
    if exchange is not None and file.updates.enabled and configuration.trusted_root is not None:
        from igrow.edge.updates.signed_source import SignedSource  # noqa: PLC0415 - slow to import

        source = SignedSource(exchange.bundles, state / "updates" / "trust", configuration.trusted_root)
    updates = BundleUpdates(
        state / "updates",
        site=site.name,
        igrow_version=__version__,
        store=store,
        graphs=graphs,
        predictor=HindcastPredictor(),
        source=source,
        reports=exchange,
        rules=UpdateRules(
            shadow_hours=file.updates.shadow.total_seconds() / 3600.0,
            watch_hours=file.updates.watch.total_seconds() / 3600.0,
        ),
        first_bundle=configuration.bundle_folder,
    )
    planning = None
    if file.planning.enabled:
        planning = PlanningProcess(site, graphs, seconds=file.planning.timeout.total_seconds())
    late_after = max(60.0, 3.0 * file.cycle.interval.total_seconds())
    status = StatusServer(file.status.port, state / STATUS_FILE, late_after=late_after)
    state_files = HandOff("state files", patience=patience, share=share)
    return Services(store, state_files, graphs, planning, updates, exchange, status)


def _exchange(configuration: Configuration, store: StoreAside) -> ExchangeService | None:
    if configuration.exchange is None:
        return None
    settings, hosts, identity = configuration.file.transfer, configuration.known_hosts, configuration.identity
    rules = TransferRules(
        every=settings.every.total_seconds(),
        period=int(settings.segment.total_seconds()),
        budget=settings.budget * 10**6,
        known_hosts=None if hosts is None else str(hosts),
        identity=None if identity is None else str(identity),
    )
    return ExchangeService(
        str(configuration.exchange),
        configuration.state_folder / "exchange",
        configuration.site.name,
        store,
        igrow_version=__version__,
        rules=rules,
    )
