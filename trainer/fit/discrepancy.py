"""What a calibrated model misses of its own greenhouse when all is well, and how surely that is known.

A calibration settles on the parameters that serve it best, and what it cannot explain stays: the discrepancy of this
greenhouse (Kennedy and O'Hagan 2001, J. R. Stat. Soc. B 63, 425-464). It is held as a normal distribution of
amplitudes of everything that may be missing, together with the parameters, since one can stand for the other; beside it
the colour of the greenhouse's disturbances, and what every candidate gained in windows of the calibration log, in which
nothing had changed. `igrow.trainer.diagnosis.search.history` learns it; a later diagnosis asks what has changed since.
"""

from __future__ import annotations

import io
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from igrow.core.errors import IgrowError
from igrow.trainer.fit.gaussian import Gaussian

_ARRAYS = ("mean", "deviation", "correlation")
"""Of the amplitudes; of the correlation the lower triangle in single precision, a tenth of the covariance's size."""


@dataclass(frozen=True)
class Discrepancy:
    """What is known of a greenhouse beside its calibrated parameters."""

    parameters: Mapping[str, float]
    """The calibrated values, about which everything is linear."""
    amplitudes: Gaussian
    """Of changes of the parameters (keys ``parameter:name``), of effects and of patterns, together."""
    filters: Mapping[int, tuple[float, ...]]
    """Raw coefficients of the noise filter, by balance (0 heat, 1 vapour, 2 CO2)."""
    step: float
    """Seconds between the errors that it was learned from."""
    own_gains: Mapping[str, float]
    """Largest gain in a window of the calibration log, learned on the rest, by effect or by a pattern's key."""
    middle: np.datetime64
    """Of the calibration log, UTC."""
    opening: float = math.nan
    """Of both rows of vents together, %, its mean over the calibration log; NaN: not known."""
    leaf_area: float = math.nan
    """Leaf area index, its mean over the calibration log, measured or by the usual course; NaN: not known."""
    unseen: tuple[str, ...] = ()
    """Keys of effects that the calibration log hardly showed: less was known of them before it."""

    def to_bytes(self) -> bytes:
        """Return the content of a file that holds it: plain arrays and JSON, never a pickle."""
        plain = {
            "parameters": dict(self.parameters),
            "keys": self.amplitudes.names,
            "filters": {str(balance): raw for balance, raw in self.filters.items()},
            "step": self.step,
            "own_gains": dict(self.own_gains),
            "middle": str(self.middle.astype("datetime64[s]")),
            "opening": self.opening,
            "leaf_area": self.leaf_area,
            "unseen": self.unseen,
        }
        buffer, below = io.BytesIO(), np.tril_indices(len(self.amplitudes.names), -1)
        np.savez_compressed(
            buffer,
            allow_pickle=False,
            plain=np.array(json.dumps(plain)),
            mean=self.amplitudes.mean,
            deviation=self.amplitudes.standard_deviation,
            correlation=self.amplitudes.correlation[below].astype(np.float32),
        )
        return buffer.getvalue()

    @classmethod
    def from_bytes(cls, content: bytes, *, where: str) -> Discrepancy:
        """Read a discrepancy.

        Raises:
            IgrowError: it is not such a file; `where` names it.
        """
        try:
            with np.load(io.BytesIO(content), allow_pickle=False) as file:
                plain, arrays = json.loads(str(file["plain"])), [file[name] for name in _ARRAYS]
            mean, deviation, correlation = arrays
            keys = tuple(plain["keys"])
            count = len(keys)
            if [one.shape for one in arrays] != [(count,), (count,), (count * (count - 1) // 2,)]:
                raise ValueError(f"{count} keys, but arrays of {', '.join(str(one.shape) for one in arrays)}")
            covariance = np.zeros((count, count))
            covariance[np.tril_indices(count, -1)] = correlation
            covariance = (covariance + covariance.T + np.eye(count)) * np.outer(deviation, deviation)
            return cls(
                {str(name): float(value) for name, value in plain["parameters"].items()},
                Gaussian(keys, mean, covariance),
                {int(balance): tuple(raw) for balance, raw in plain["filters"].items()},
                float(plain["step"]),
                {str(key): float(gain) for key, gain in plain["own_gains"].items()},
                np.datetime64(plain["middle"], "s"),
                float(plain.get("opening", math.nan)),
                float(plain.get("leaf_area", math.nan)),
                tuple(map(str, plain.get("unseen", ()))),
            )
        except Exception as error:
            # A damaged archive raises from zipfile, zlib or numpy; for the user it is one fault.
            raise IgrowError(f"{where}: holds no discrepancy: {error}") from None
