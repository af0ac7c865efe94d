"""The elementwise functions that the equations use, for python floats.

For one greenhouse numpy spends 1 microsecond where a float operation takes 0.05, so a single plant, or a single run of
a simulator, is computed on floats through this namespace and a batch through numpy itself.
"""

from __future__ import annotations

import math
from typing import Any, TypeVar

import numpy as np

from igrow.core.arrays import Array

Value = TypeVar("Value")


class FloatNamespace:
    """What `numpy` offers to the equations, on python floats."""

    exp = staticmethod(math.exp)
    log = staticmethod(math.log)
    sqrt = staticmethod(math.sqrt)
    tanh = staticmethod(math.tanh)
    sin = staticmethod(math.sin)
    cos = staticmethod(math.cos)
    abs = staticmethod(abs)
    floor = staticmethod(math.floor)

    @staticmethod
    def maximum(left: float, right: float) -> float:
        """Return the larger one."""
        return left if left > right else right

    @staticmethod
    def minimum(left: float, right: float) -> float:
        """Return the smaller one."""
        return left if left < right else right

    @staticmethod
    def where(condition: bool, left: Value, right: Value) -> Value:
        """Return `left` if the condition holds, else `right`."""
        return left if condition else right


def namespace(count: int | None) -> Any:
    """Return the namespace for one greenhouse on floats (None) or for a batch of `count` on arrays."""
    return FloatNamespace if count is None else np


def clip(xp: Any, value: Array, low: Array, high: Array) -> Array:
    """Return `value` held between `low` and `high`."""
    return xp.minimum(xp.maximum(value, low), high)


def sigmoid(xp: Any, value: Array) -> Array:
    """Return 1 / (1 + exp(-value)), in a form that cannot overflow."""
    return 0.5 + 0.5 * xp.tanh(0.5 * value)


def ramp(xp: Any, value: Array, start: float, end: float) -> Array:
    """Return 0 at `start`, 1 at `end`, linear between and constant outside (`end` may be the lower one)."""
    return clip(xp, (value - start) / (end - start), 0.0, 1.0)
