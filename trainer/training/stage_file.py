"""Network stages as one .npz file: plain arrays and JSON, never a pickle."""

from __future__ import annotations

import dataclasses
import io
import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from igrow.core.errors import IgrowError
from igrow.core.simulator.network import Stage

_LAYERS = ("matrices", "biases")


def stages_to_bytes(stages: Mapping[str, Stage], notes: Mapping[str, Any] | None = None) -> bytes:
    """Return the content of a file that holds these stages by name, and notes that JSON can hold."""
    arrays: dict[str, Any] = {}
    plain: dict[str, dict[str, Any]] = {}
    for key, stage in stages.items():
        plain[key] = {"layers": len(stage.matrices)}
        for field in dataclasses.fields(stage):
            value = getattr(stage, field.name)
            if field.name in _LAYERS:
                arrays |= {f"{key}.{field.name}.{index}": layer for index, layer in enumerate(value)}
            elif isinstance(value, np.ndarray):
                arrays[f"{key}.{field.name}"] = value
            else:
                plain[key][field.name] = value
    if notes is not None:
        arrays["notes"] = np.array(json.dumps(notes))
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, stages=np.array(json.dumps(plain)), **arrays)
    return buffer.getvalue()


def stages_from_bytes(content: bytes, *, where: str) -> tuple[dict[str, Stage], dict[str, Any]]:
    """Read the stages of a file, and its notes, empty where it was written without.

    Raises:
        IgrowError: it is not such a file; `where` names it.
    """
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as file:
            arrays = {key: file[key] for key in file.files}
        plain = json.loads(str(arrays["stages"]))
        stages = {key: _stage(key, values, arrays) for key, values in plain.items()}
        return stages, json.loads(str(arrays.get("notes", "{}")))
    except Exception as error:
        # A damaged archive raises from zipfile, zlib or numpy; for the user it is one fault.
        raise IgrowError(f"{where}: holds no network stages: {error}") from None


def _stage(key: str, plain: Mapping[str, Any], arrays: Mapping[str, Any]) -> Stage:
    values: dict[str, Any] = {}
    for field in dataclasses.fields(Stage):
        if field.name in _LAYERS:
            values[field.name] = tuple(arrays[f"{key}.{field.name}.{index}"] for index in range(plain["layers"]))
        elif field.name in plain:
            value = plain[field.name]
            values[field.name] = tuple(value) if isinstance(value, list) else value
        else:
            values[field.name] = arrays[f"{key}.{field.name}"]
    return Stage(**values)
