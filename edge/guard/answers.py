"""What a PLC may answer to a value that we wrote: the value itself, the value rounded, or a step towards it.

A device has a resolution and limits of its own. What it makes of *our* write is its answer, and no hand.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from igrow.edge.guard.rules import PointRule

COARSEST = 1.0 / 20.0
"""The coarsest resolution, as a share of a point's range, that a device is believed to have (0.5 K of 16 K)."""

FLOAT32_STEP = float(np.finfo(np.float32).eps)
"""The relative difference of neighbouring float32 values. A finer register than that is one."""


def matches(rule: PointRule, shown: float, value: float) -> bool:
    """Tell whether what is shown is the value: the same to the register, or within the dead band."""
    return rule.same(shown, value) or abs(shown - value) <= rule.dead_band


def rounds(rule: PointRule, written: float, shown: float) -> bool:
    """Tell whether `shown` is `written` on a grid of round steps (1, 2, 2.5, 5 times a power of ten), up or down.

    A device goes by what its register holds: 25.4 in a float32 is a little less, which it cuts off to 25.3.
    """
    held = written if rule.resolution > FLOAT32_STEP * abs(written) else float(np.float32(written))
    return any(
        abs(round(shown / step) * step - held) < step * (1.0 - 1e-9) and _is_multiple(shown, step)
        for step in _steps(COARSEST * (rule.high - rule.low))
    )


def takes(rule: PointRule, written: float, shown: float) -> bool:
    """Tell whether `shown` is the value that was written, as this register or this device holds it."""
    return matches(rule, shown, written) or rounds(rule, written, shown)


def on_the_way(rule: PointRule, before: float, written: float, shown: float) -> bool:
    """Tell whether `shown` lies between what stood before and what was written: a ramp, or a limit of the device."""
    if matches(rule, shown, before):
        return False
    return min(before, written) < shown < max(before, written)


def _steps(coarsest: float) -> Iterator[float]:
    """Yield round steps from the coarsest down over three decades."""
    if coarsest <= 0.0:
        return
    decade = 10.0 ** math.floor(math.log10(coarsest))
    for power in range(3):
        for mantissa in (5.0, 2.5, 2.0, 1.0):
            step = mantissa * decade / 10.0**power
            if step <= coarsest * (1.0 + 1e-9):
                yield step


def _is_multiple(value: float, step: float) -> bool:
    # A float32 holds 21.2 as 21.200000763.
    return abs(value / step - round(value / step)) < 1e-3
