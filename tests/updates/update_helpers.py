"""A plant log, a predictor that runs the tiny bundle, and an exchange with a signed repository."""

from __future__ import annotations

import importlib
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from igrow.core.bundle import Bundle, open_session, run_graph
from igrow.edge.exchange import ExchangeService
from igrow.edge.image import Quality, Value
from igrow.edge.ports import ActiveBundle
from igrow.edge.store import SqliteStore, StoreLimits
from igrow.edge.updates import BundleUpdates, UpdateRules
from igrow.edge.updates.rules import Graphs
from igrow.edge.updates.signed_source import SignedSource
from igrow.trainer.publishing import create_keys, initialise

START = 1_780_012_800.0
HOUR = 3600.0


class TinyPredictor:
    """Predicts air temperature as the tiny bundle does: outdoor temperature plus the bundle's offset."""

    def predict(self, bundle: Bundle, log, origins, steps: int) -> Mapping[str, np.ndarray]:
        rows = np.asarray(origins)[:, None] + 1 + np.arange(steps)
        weather = log["outdoor_temperature"][rows].astype(np.float32)
        padded = np.resize(weather, (-(-weather.size // 24), 24))
        outputs = run_graph(open_session(bundle.graph("simulator")), {"weather": padded})
        predicted = outputs["air_temperature"].ravel()[: weather.size].reshape(weather.shape)
        return {"air_temperature": predicted.astype(np.float64)}


class DirectCalls:
    """Calls what the process for graphs would, here and now; `calls` keeps what was asked for."""

    def __init__(self) -> None:
        self.calls: list[str] = []

    def call(self, function: str, *arguments: object, seconds: float) -> object:
        self.calls.append(function)
        module, name = function.split(":")
        return getattr(importlib.import_module(module), name)(*arguments)


@dataclass
class Gateway:
    """A store, an exchange and the bundle updates around them, on a plant whose offset can change."""

    folder: Path
    rules: UpdateRules
    offset: float = 5.0
    now: float = START
    graphs: Graphs = field(default_factory=DirectCalls)

    def __post_init__(self) -> None:
        self.exchange_root = self.folder / "exchange"
        self.keys = self.folder / "keys"
        self.repository = self.exchange_root / "demo" / "bundles"
        if not self.repository.exists():
            create_keys(self.keys)
            initialise(self.repository, self.keys)
        self.trusted_root = self.keys / "1.root.json"
        self.start()

    def start(self, first_bundle: Path | None = None) -> None:
        """Start the services, as after a restart of the daemon."""
        self.store = SqliteStore(self.folder / "store", StoreLimits(survive_power_cut=False))
        self.exchange = ExchangeService(
            str(self.exchange_root), self.folder / "transfer", "demo", self.store, igrow_version="0.1.0"
        )
        self.updates = BundleUpdates(
            self.folder / "updates",
            site="demo",
            igrow_version="0.1.0",
            store=self.store,
            graphs=self.graphs,
            predictor=TinyPredictor(),
            source=SignedSource(self.repository, self.folder / "updates" / "tuf", self.trusted_root),
            reports=self.exchange,
            rules=self.rules,
            first_bundle=first_bundle,
        )
        wait_for(self.updates)

    def stop(self) -> None:
        self.updates.close()
        self.store.close()

    @property
    def active(self) -> ActiveBundle:
        """The bundle in force; there is one."""
        bundle = self.updates.active()
        assert bundle is not None
        return bundle

    def described(self) -> dict[str, Any]:
        """What the status says of the updates."""
        return dict(self.updates.describe())

    def run(self, hours: float, *, measured: bool = True) -> None:
        """Let the plant run; the services are ticked every 10 minutes."""
        for _ in range(round(hours * 6)):
            outdoor = 10.0 + 5.0 * np.sin(self.now / 86400 * 2 * np.pi)
            air = outdoor + self.offset + 0.2 * np.sin(self.now / 5000)
            if measured:
                self.store.append(
                    self.now,
                    {
                        "outdoor_temperature": Value(float(outdoor), Quality.GOOD, 0.0),
                        "air_temperature": Value(float(air), Quality.GOOD, 0.0),
                    },
                )
            self.updates.tick(self.now)
            wait_for(self.updates)
            self.now += 600.0

    def kinds(self) -> list[str]:
        """Return the kinds of all events, oldest first."""
        return [str(record.body["kind"]) for record in self.store.records("event", 10**6)][::-1]


def wait_for(updates: BundleUpdates) -> None:
    """Wait for the threads; a lock-step plant does the same for the first."""
    while updates.busy or (updates._look is not None and not updates._look.done()):
        time.sleep(0.0005)
