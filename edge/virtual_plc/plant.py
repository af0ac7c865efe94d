"""What a virtual PLC needs of the plant that it controls."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np


class Plant(Protocol):
    """A simulated greenhouse with its own lower control (pipes, vents, screens, lamps, dosing)."""

    @property
    def time(self) -> np.datetime64:
        """Plant time, UTC."""
        ...

    def step(self, seconds: float, setpoints: Mapping[str, float]) -> None:
        """Advance by `seconds` under setpoints (quantity name -> value in its unit), held constant."""
        ...

    def measurements(self) -> Mapping[str, float]:
        """Return what the PLC's sensors and actuators report now: quantity name -> value in its unit."""
        ...
