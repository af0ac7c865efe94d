"""What a diagnosis says: the verdict, its findings, errors before and after; and its JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from igrow.core.quantities import QUANTITIES
from igrow.trainer.data.screening import Screened

Verdict = Literal["nothing", "named", "ambiguous", "unexplained", "data_fault"]
EXIT_CODES: Mapping[str, int] = {"nothing": 0, "named": 10, "ambiguous": 11, "unexplained": 12, "data_fault": 13}
"""Exit code of each verdict; 2 is a mistake of use."""
HORIZONS = ("1_step", "24_h", "7_d")
STAGES = ("deployed", "recalibrated", "corrected")


@dataclass(frozen=True)
class Interval:
    """A value with its 90 % interval."""

    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class OnsetInterval:
    """When something began, UTC, with a 90 % interval."""

    time: np.datetime64
    low: np.datetime64
    high: np.datetime64


@dataclass(frozen=True)
class Finding:
    """One cause."""

    effect: str
    """Name in the catalogue, or ``remainder``."""
    kind: Literal["process", "sensor", "remainder"]
    balances: tuple[str, ...]
    parameters: Mapping[str, Interval]
    onset: OnsetInterval | None
    p_value: float
    rivals: tuple[str, ...]
    drivers: tuple[str, ...]
    separating_test: str
    sentence: str = ""
    """For the grower."""
    effect_to_noise: float = 0.0
    """RMS that it moves in a 24 h free run over the RMS that no model removes."""
    regimes: Mapping[str, Interval] = field(default_factory=dict)
    """The coefficient refitted by regime."""


@dataclass(frozen=True)
class Diagnosis:
    """The whole answer."""

    site: str
    verdict: Verdict
    start: np.datetime64
    end: np.datetime64
    fit_days: int
    held_out_days: int
    findings: tuple[Finding, ...]
    errors: Mapping[str, Mapping[str, Mapping[str, float]]]
    """Quantity -> horizon -> stage -> mean absolute error on held-out days."""
    screened: tuple[Screened, ...]
    untestable: tuple[str, ...] = ()
    """Effects that this log cannot tell."""
    unknown: tuple[str, ...] = ()
    """Inputs that the log lacks."""
    notes: tuple[str, ...] = ()

    @property
    def exit_code(self) -> int:
        """Of the command."""
        return EXIT_CODES[self.verdict]

    def to_json(self) -> dict[str, Any]:
        """Return the document of `diagnosis.json`."""
        return {
            "verdict": self.verdict,
            "span": {
                "start": _time(self.start),
                "end": _time(self.end),
                "fit_days": self.fit_days,
                "held_out_days": self.held_out_days,
            },
            "findings": [_finding(one) for one in self.findings],
            "errors": {
                quantity: {
                    horizon: {
                        **{stage: _number(value) for stage, value in stages.items()},
                        "unit": QUANTITIES[quantity].unit,
                    }
                    for horizon, stages in horizons.items()
                }
                for quantity, horizons in self.errors.items()
            },
            "screened": [
                {"quantity": one.quantity, "start": _time(one.start), "end": _time(one.end), "reason": one.reason}
                for one in self.screened
            ],
        }


def _finding(finding: Finding) -> dict[str, Any]:
    onset = finding.onset
    return {
        "effect": finding.effect,
        "kind": finding.kind,
        "balances": list(finding.balances),
        "parameters": {
            name: {"value": _number(one.value), "low": _number(one.low), "high": _number(one.high), "unit": one.unit}
            for name, one in finding.parameters.items()
        },
        "onset": None
        if onset is None
        else {"time": _time(onset.time), "low": _time(onset.low), "high": _time(onset.high)},
        "p_value": _number(finding.p_value),
        "rivals": list(finding.rivals),
        "drivers": list(finding.drivers),
        "separating_test": finding.separating_test,
    }


def _number(value: float) -> float:
    """Return a number with six significant digits."""
    return float(f"{value:.6g}")


def _time(time: np.datetime64) -> str:
    return f"{np.datetime_as_string(time.astype('datetime64[s]'))}Z"


def causes(findings: Sequence[Finding]) -> tuple[str, ...]:
    """Return the names of what was found."""
    return tuple(one.effect for one in findings)
