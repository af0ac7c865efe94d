"""How large errors of a day's free run usually are: what weighs the quantities against each other in every fit."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

ERROR_SCALES: Mapping[str, float] = MappingProxyType({"air_temperature": 0.5, "air_humidity": 3.0, "air_co2": 35.0})
"""Error that counts as one, by quantity: K, %, ppm.

Fixed, since a quantity that is predicted badly would else lose its weight and be predicted worse still.
"""
CORRELATION_TIME = 43_200.0
"""Seconds over which errors of a free run hang together, so that they count once.

What the model lacks lasts for hours, and the PLC answers it; with a shorter time a fit would take the vents' answer to
a missing heat flux for vents without effect (feedback bias).
"""
ROBUST = 2.0
"""Errors beyond so many scales count linearly (Huber (1964), Ann. Math. Statist. 35, 73-101)."""
