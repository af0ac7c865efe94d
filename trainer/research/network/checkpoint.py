"""A trained network simulator as one file: its stages, and light and picking of leaves as notes."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from igrow.core.errors import IgrowError
from igrow.core.simulator.leaf_picking import LeafPicking
from igrow.core.simulator.network import LightFormula, NetworkSimulator
from igrow.trainer.training.stage_file import stages_from_bytes, stages_to_bytes

FILE_NAME = "network.npz"
BUNDLE_FOLDER = "bundle"
"""Where a folder of results keeps its bundle."""
STAGES = ("climate", "growth", "harvest")
PICKING_ARRAYS = ("ready", "share")


def simulator_to_bytes(simulator: NetworkSimulator) -> bytes:
    """Return the content of a file that holds `simulator`."""
    picking = simulator.picking
    notes: dict[str, Any] = {"light": asdict(simulator.light), "picking": None}
    if picking is not None:
        notes["picking"] = asdict(picking) | {key: getattr(picking, key).tolist() for key in PICKING_ARRAYS}
    return stages_to_bytes({name: getattr(simulator, name) for name in STAGES}, notes)


def load_simulator(path: Path) -> NetworkSimulator:
    """Read a network simulator from a file, from a bundle, or from a folder of results with a bundle in it.

    Raises:
        IgrowError: the file is absent, damaged or of another kind.
    """
    file = path
    if path.is_dir():
        folder = path / BUNDLE_FOLDER if (path / BUNDLE_FOLDER).is_dir() else path
        file = folder / FILE_NAME
    try:
        content = file.read_bytes()
    except OSError as error:
        raise IgrowError(f"{file}: {error.strerror}") from None
    stages, notes = stages_from_bytes(content, where=str(file))
    try:
        light, picking = LightFormula(**notes["light"]), notes["picking"]
        if picking is not None:
            rows = {key: np.array(picking[key], dtype=np.float32) for key in PICKING_ARRAYS}
            picking = LeafPicking(**(picking | rows))
        return NetworkSimulator(**stages, light=light, picking=picking)
    except (KeyError, TypeError, ValueError) as error:
        raise IgrowError(f"{file}: holds no network simulator: {error}") from None
