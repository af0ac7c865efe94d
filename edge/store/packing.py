"""A row of telemetry as bytes: float32 values, then one byte of quality each unless all are good.

Sixty points take 240 bytes a poll, a fifth of a row per point. A layout (the tuple of names) is stored once
and each row refers to it, so that a site may gain or lose points at any time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from igrow.core.quantities import QUANTITIES
from igrow.edge.image import Quality, Value

QUALITIES = tuple(Quality)
"""A quality is stored as its place in this tuple; Quality.GOOD is the first."""
_CODE = {quality: code for code, quality in enumerate(QUALITIES)}


@dataclass(frozen=True, slots=True)
class Row:
    """One poll."""

    milliseconds: int
    """Since 1970 UTC."""
    names: tuple[str, ...]
    packed: bytes


def pack(time: float, values: Mapping[str, Value]) -> Row:
    """Return the row of one poll; names that are no quantity of the registry are left out."""
    items = [(name, value) for name, value in values.items() if name in QUANTITIES]
    numbers = np.array([np.nan if v.value is None else v.value for _, v in items], dtype="<f4")
    packed = numbers.tobytes()
    if any(value.quality is not Quality.GOOD for _, value in items):
        packed += bytes(_CODE[value.quality] for _, value in items)
    return Row(round(time * 1000), tuple(name for name, _ in items), packed)


def unpack_good(names: Sequence[str], packed: Sequence[bytes]) -> NDArray[np.float64]:
    """Return rows of one layout as (rows, names); a value whose quality is not good is NaN.

    Rows of another length than the layout allows come back as NaN: nobody may guess what they meant.
    """
    width = len(names)
    table = np.full((len(packed), width), np.nan)
    if width == 0 or not packed:
        return table
    lengths = np.array([len(row) for row in packed])
    plain = np.flatnonzero(lengths == 4 * width)
    if len(plain):
        joined = b"".join(packed[index] for index in plain.tolist())
        table[plain] = np.frombuffer(joined, dtype="<f4").reshape(-1, width)
    marked = np.flatnonzero(lengths == 5 * width)
    if len(marked):
        joined = b"".join(packed[index] for index in marked.tolist())
        raw = np.frombuffer(joined, dtype=np.uint8).reshape(-1, 5 * width)
        values = np.ascontiguousarray(raw[:, : 4 * width]).view("<f4").astype(np.float64)
        values[raw[:, 4 * width :] != 0] = np.nan
        table[marked] = values
    return table
