"""The manifest of a bundle as typed records."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Literal

from igrow.core.errors import IgrowError

FORMAT_VERSION = 3
"""Raised by one whenever an older reader would misunderstand a newer bundle; older ones are read all the same."""

Json = Any
"""A value as `json.loads` gives it."""


class BundleError(IgrowError):
    """A bundle that cannot be used, and why."""


@dataclass(frozen=True)
class Tensor:
    """One input or output of a graph: what its last axis holds, in which order and unit."""

    name: str
    axes: tuple[str, ...] = ()
    """Names of the axes, for example ("batch", "hour", "quantity")."""
    quantities: tuple[str, ...] = ()
    """The quantity at each index of the last axis; one entry when the whole tensor is one quantity."""
    units: tuple[str, ...] = ()
    """The unit of each entry of `quantities`."""


@dataclass(frozen=True)
class GraphSignature:
    """The inputs and outputs of one graph, in the graph's order."""

    inputs: tuple[Tensor, ...]
    outputs: tuple[Tensor, ...]


@dataclass(frozen=True)
class Span:
    """A stretch of time, UTC, its end not included."""

    start: datetime
    end: datetime


@dataclass(frozen=True)
class Onset:
    """When an effect began, with the bounds of its interval."""

    time: datetime
    low: datetime
    high: datetime


@dataclass(frozen=True)
class Estimate:
    """A fitted value with its 90 % interval."""

    value: float
    low: float
    high: float
    unit: str

    @classmethod
    def about(cls, value: float, reach: float, unit: str) -> Estimate:
        """Return a value whose interval reaches as far to either side."""
        return cls(value, value - reach, value + reach, unit)


@dataclass(frozen=True)
class EffectRecord:
    """A named effect that the simulator carries."""

    name: str
    kind: Literal["process", "sensor"]
    parameters: Mapping[str, Estimate]
    balances: tuple[str, ...] = ()
    onset: Onset | None = None
    confounded: tuple[str, ...] = ()
    """Other effects that fitted the log as well; a separating test may tell which it is."""


@dataclass(frozen=True)
class FittedParameter:
    """A calibrated parameter: posterior mean and standard deviation."""

    mean: float
    standard_deviation: float
    unit: str


@dataclass(frozen=True)
class HeldOutError:
    """Mean absolute error of one quantity on days that no fit has seen, before and after the correction."""

    quantity: str
    horizon: str
    """"1_step", "1_h", "24_h" or "7_d"."""
    before: float
    after: float
    unit: str
    persistence: float | None = None
    """The same of: as at the start (steps and hours), as one horizon earlier (runs); None where it was not told."""


@dataclass(frozen=True)
class Manifest:
    """Everything a gateway must know about a bundle before it lets it near a greenhouse."""

    site: str
    created: datetime
    igrow_version: str
    variant: Literal["network", "hybrid"]
    opset: int
    graphs: Mapping[str, GraphSignature]
    training_span: Span | None = None
    effects: tuple[EffectRecord, ...] = ()
    parameters: Mapping[str, FittedParameter] = field(default_factory=dict)
    covariance: tuple[tuple[float, ...], ...] | None = None
    """Of `parameters`, rows and columns in their order; None where only the deviations are known."""
    calibrated_on: str = ""
    """Name of the site on whose log they were fitted; empty where it was none."""
    alignment: float | None = None
    """Rows of the site's log by which its actuators are read ahead; None where that was not looked at."""
    errors: tuple[HeldOutError, ...] = ()
    training_range: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Smallest and largest value of each quantity that the simulator was fitted on."""
    simulator: Mapping[str, Json] = field(default_factory=dict)
    """What the simulator's runtime needs to know beside its graph; its own business."""
    golden_tolerance: float = 1e-3
    """Largest deviation in the self-test, as a fraction of the largest expected magnitude of an output."""
    format_version: int = FORMAT_VERSION
    files: Mapping[str, str] = field(default_factory=dict)
    """File name to SHA-256 of its content, in hexadecimal; filled by `write_bundle`."""
