"""A trained network simulator as one .npz file: arrays and a JSON header, never code."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from igrow_core.errors import IgrowError
from igrow_core.simulator.leaf_picking import LeafPicking
from igrow_core.simulator.network import LightFormula, NetworkSimulator, Stage

FILE_NAME = "network.npz"
BUNDLE_FOLDER = "bundle"
"""Where a folder of results keeps its bundle."""
FORMAT = 2
STAGES = ("climate", "growth", "harvest")
PLAIN = ("name", "states", "drivers", "time_constants", "clock", "step", "cumulative")
ARRAYS = (
    "feature_offset", "feature_scale", "state_offset", "state_scale", "increment_scale", "low", "high",
)  # fmt: skip
PICKING = ("hour", "threshold", "base", "certain", "faded")
PICKING_ARRAYS = ("ready", "share")


class CheckpointError(IgrowError):
    """A file that holds no network simulator this version can read."""


def simulator_to_bytes(simulator: NetworkSimulator) -> bytes:
    """Return the content of a file that holds `simulator`."""
    header: dict[str, Any] = {"format": FORMAT, "light": asdict(simulator.light), "picking": None}
    arrays: dict[str, Any] = {}
    if simulator.picking is not None:
        header["picking"] = {key: getattr(simulator.picking, key) for key in PICKING}
        arrays |= {f"picking.{key}": getattr(simulator.picking, key) for key in PICKING_ARRAYS}
    for name in STAGES:
        stage: Stage = getattr(simulator, name)
        header[name] = {key: getattr(stage, key) for key in PLAIN} | {"layers": len(stage.matrices)}
        arrays |= {f"{name}.{key}": getattr(stage, key) for key in ARRAYS}
        for index, (matrix, bias) in enumerate(zip(stage.matrices, stage.biases, strict=True)):
            arrays |= {f"{name}.matrix{index}": matrix, f"{name}.bias{index}": bias}
    stream = io.BytesIO()
    np.savez(stream, allow_pickle=False, header=np.array(json.dumps(header)), **arrays)
    return stream.getvalue()


def save_simulator(path: Path, simulator: NetworkSimulator) -> None:
    """Write `simulator` to `path`, or to network.npz where `path` is a folder."""
    (path / FILE_NAME if path.is_dir() else path).write_bytes(simulator_to_bytes(simulator))


def load_simulator(path: Path) -> NetworkSimulator:
    """Read a network simulator from a file, from a bundle, or from a folder of results with a bundle in it.

    Raises CheckpointError where the file is absent, damaged or of another format.
    """
    file = path
    if path.is_dir():
        folder = path / BUNDLE_FOLDER if (path / BUNDLE_FOLDER).is_dir() else path
        file = folder / FILE_NAME
    try:
        with np.load(file, allow_pickle=False) as data:
            content = {key: data[key] for key in data.files}
        header = json.loads(str(content["header"]))
        if header["format"] != FORMAT:
            raise CheckpointError(f"{file}: format {header['format']}, this version reads format {FORMAT}")
        stages = {name: _stage(name, header[name], content) for name in STAGES}
        light = LightFormula(**header["light"])
        picking = header["picking"]
        if picking is not None:
            picking = LeafPicking(**picking, **{key: content[f"picking.{key}"] for key in PICKING_ARRAYS})
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
        raise CheckpointError(f"{file}: holds no network simulator ({error})") from error
    return NetworkSimulator(**stages, light=light, picking=picking)


def _stage(name: str, header: dict[str, Any], content: dict[str, Any]) -> Stage:
    layers = range(header["layers"])
    return Stage(
        name=header["name"],
        states=tuple(header["states"]),
        drivers=tuple(header["drivers"]),
        time_constants=tuple(header["time_constants"]),
        clock=header["clock"],
        step=header["step"],
        cumulative=tuple(header["cumulative"]),
        **{key: content[f"{name}.{key}"] for key in ARRAYS},
        matrices=tuple(content[f"{name}.matrix{index}"] for index in layers),
        biases=tuple(content[f"{name}.bias{index}"] for index in layers),
    )
