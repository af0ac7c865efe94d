"""Names of array types, once for the whole project; shapes stand in the docstrings of what takes and gives them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Mask = NDArray[np.bool_]
Times = NDArray[np.datetime64]
Array = Any
"""A float or an array of the namespace `xp` that a formula is written against (numpy, ndonnx); no type covers both."""
