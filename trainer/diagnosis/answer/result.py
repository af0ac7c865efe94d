"""What a diagnosis says: verdict, findings, errors before and after, the corrected model; in words, plots, JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from igrow.core.bundle import Estimate
from igrow.core.effects import EFFECTS
from igrow.core.language import Language, speak
from igrow.core.quantities import QUANTITIES
from igrow.trainer.data.screening import Screened
from igrow.trainer.diagnosis.answer.uncalibrated import FIRST, NO_NAME, how_to_calibrate
from igrow.trainer.diagnosis.visible_parameters import VISIBLE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from igrow.trainer.data.log import Log
    from igrow.trainer.diagnosis.answer.evidence import Evidence
    from igrow.trainer.diagnosis.search.estimate import OnsetInterval
    from igrow.trainer.fit.model import FittedModel

Verdict = Literal["nothing", "named", "ambiguous", "unexplained", "data_fault"]
EXIT_CODES: Mapping[str, int] = {"nothing": 0, "named": 10, "ambiguous": 11, "unexplained": 12, "data_fault": 13}
"""Exit code of each verdict; 2 is a mistake of use."""
STAGES = ("deployed", "recalibrated", "corrected")
WORSE = 0.02
"""Share by which an error must grow to be told as worse."""
DISCREPANCY = "discrepancy"
"""Effect and kind of a finding that no effect of the catalogue explains: what the model lacks, by outside drivers."""
_TOLD = (
    "effect", "kind", "balances", "parameters", "onset", "p_value", "confounded", "drivers", "resembles",
    "separating_test",
)  # fmt: skip
"""Of a finding, in `diagnosis.json`."""


@dataclass(frozen=True)
class Finding:
    """One cause."""

    effect: str
    """Name in the catalogue, of the actuator that the log lacks, of the parameter that has changed, or
    ``discrepancy``."""
    kind: Literal["process", "sensor", "actuator", "parameter", "discrepancy"]
    balances: tuple[str, ...]
    parameters: Mapping[str, Estimate]
    onset: OnsetInterval | None
    p_value: float
    confounded: tuple[str, ...]
    """Effects that fit as well, itself first: confounded in this log."""
    drivers: tuple[str, ...]
    separating_test: str
    sentence: str = ""
    """For the grower."""
    effect_to_noise: float = 0.0
    """RMS that it moves in a 24 h free run over the RMS that no model removes."""
    regimes: Mapping[str, Estimate] = field(default_factory=dict)
    """The coefficient refitted by regime."""
    resembles: tuple[str, ...] = ()
    """Parameters of the model whose growth would be the same finding: more air leaks in the wind either way."""


@dataclass(frozen=True)
class Misfit:
    """A quantity that a model predicts no better than yesterday's readings do."""

    quantity: str
    error: float
    """Mean absolute error of the model a day ahead on unseen days."""
    persistence: float
    """The same of yesterday's readings."""


@dataclass(frozen=True, repr=False)
class Diagnosis:
    """The whole answer.

    >>> result = diagnose(log, model)
    >>> print(result.summary())
    >>> bundle = export(result.corrected, folder)
    """

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
    """Stretches of readings that were set aside."""
    model: FittedModel
    """The model in force."""
    corrected: FittedModel
    """The same, recalibrated and with the causes found in it: ready to export. Unchanged after a data fault."""
    untestable: tuple[str, ...] = ()
    """Effects that this log cannot tell."""
    missing: tuple[str, ...] = ()
    """Inputs that the log lacks."""
    notes: tuple[str, ...] = ()
    evidence: Evidence | None = None
    """What the verdict rests on; None for a data fault."""
    log: Log | None = None
    """What was diagnosed."""

    @property
    def exit_code(self) -> int:
        """Of the command."""
        return EXIT_CODES[self.verdict]

    @property
    def uncalibrated(self) -> bool:
        """The model was never calibrated on this greenhouse: what was found tells two greenhouses apart."""
        return self.verdict != "data_fault" and self.model.calibrated_on != self.site

    @property
    def unsure(self) -> bool:
        """The model is of another greenhouse and does not fit this one: no name that it gives is certain."""
        return self.verdict in ("named", "ambiguous") and self.uncalibrated and bool(self.misfits)

    def settled(self) -> Diagnosis:
        """Return the diagnosis with no more certainty than its own errors allow."""
        return replace(self, verdict="ambiguous") if self.unsure else self

    @property
    def worsened(self) -> tuple[str, ...]:
        """A sentence for every quantity that the corrected model predicts worse than recalibration alone does."""
        return tuple(
            f"{quantity.replace('_', ' ')} gets worse by it: {plain(day['recalibrated'])} to {plain(day['corrected'])} "
            f"{QUANTITIES[quantity].difference_unit}, 24 h ahead on unseen days"
            for quantity, horizons in self.errors.items()
            if (day := horizons.get("24_h", {})) and day["corrected"] > (1.0 + WORSE) * day["recalibrated"]
        )

    @property
    def misfits(self) -> tuple[Misfit, ...]:
        """The quantities that the model which stands predicts no better than yesterday's readings do."""
        if self.evidence is None:
            return ()
        stage = "deployed" if self.verdict == "nothing" else "corrected"
        return tuple(
            Misfit(quantity, error, yesterday)
            for quantity, yesterday in self.evidence.log.persistence_errors(self.errors).items()
            if (error := self.errors[quantity].get("24_h", {}).get(stage)) is not None and error >= yesterday
        )

    def __repr__(self) -> str:
        causes = ", ".join(one.effect for one in self.findings)
        return f"Diagnosis({self.site!r}, {self.verdict}{': ' if causes else ''}{causes})"

    def summary(self, typed: Sequence[str] = ()) -> str:
        """Return the verdict in a few lines for people; `typed` are the words of a command that read the log."""
        lines = [f"{self.site}: {self.verdict}"]
        if self.uncalibrated:
            text, command = how_to_calibrate(self.log.days if self.log is not None else 0.0, typed)
            lines = [FIRST, text.format(command=command), *lines]
            lines += [f"  {NO_NAME}"] if self.unsure else []
        for one in self.findings:
            lines.append(f"  {one.sentence}")
            if one.confounded[1:]:
                lines.append(f"  as well it could be {' or '.join(map(_title, one.confounded[1:]))}")
        if self.missing:
            lines.append(f"  the log lacks {', '.join(self.missing)}: usual values stand in")
        lines += [f"  {note}" for note in self.notes]
        lines += [f"  {sentence}" for sentence in self.worsened]
        for quantity, horizons in self.errors.items():
            day = horizons.get("24_h")
            if day:
                stages = ", ".join(f"{stage} {value:.3g}" for stage, value in day.items())
                unit = QUANTITIES[quantity].difference_unit
                lines.append(f"  {quantity}, 24 h ahead on unseen days: {stages} {unit}")
        for misfit in self.misfits:
            yesterday = f"{misfit.persistence:.3g} {QUANTITIES[misfit.quantity].difference_unit}"
            lines.append(f"  the model does not fit {misfit.quantity}: yesterday's readings are off by {yesterday}")
        return "\n".join(lines)

    def plot_errors(self, quantity: str = "air_temperature") -> Figure:
        """Return a figure of the worst unseen day: measured, and predicted by each stage.

        Raises:
            IgrowError: there is nothing to plot.
        """
        from igrow.trainer.diagnosis.answer import plots  # noqa: PLC0415  (matplotlib is slow to import)

        return plots.worst_day(plots.needed(self.evidence), quantity, self._english)

    def plot_evidence(self) -> Figure:
        """Return a figure of how the evidence adds up from day to day; raises as `plot_errors` does."""
        from igrow.trainer.diagnosis.answer import plots  # noqa: PLC0415

        return plots.evidence_by_day(plots.needed(self.evidence), self._english)

    def plot_days(self) -> Figure:
        """Return a figure of what is missing from day to day; raises as `plot_errors` does."""
        from igrow.trainer.diagnosis.answer import plots  # noqa: PLC0415

        return plots.residual_by_date(plots.needed(self.evidence), self._english)

    def plot_residual(self, driver: str) -> Figure:
        """Return a figure of what is missing against one of the model's drivers; raises as `plot_errors` does."""
        from igrow.trainer.diagnosis.answer import plots  # noqa: PLC0415

        return plots.residual_against_driver(plots.needed(self.evidence), driver, self._english)

    def plot_regimes(self, finding: Finding) -> Figure:
        """Return a figure of a finding's coefficient by regime; raises as `plot_errors` does."""
        from igrow.trainer.diagnosis.answer import plots  # noqa: PLC0415

        return plots.coefficient_by_regime(finding.regimes, self._english)

    @property
    def _english(self) -> Language:
        """By the clock of the greenhouse."""
        return speak("en", self.model.site.time_zone)

    def to_json(self) -> dict[str, Any]:
        """Return the document of `diagnosis.json`."""
        return {
            "verdict": self.verdict,
            "calibrated_here": not self.uncalibrated,
            "span": {
                "start": _json(self.start),
                "end": _json(self.end),
                "fit_days": self.fit_days,
                "held_out_days": self.held_out_days,
            },
            "findings": [{key: _json(getattr(one, key)) for key in _TOLD} for one in self.findings],
            "errors": {
                quantity: {
                    horizon: {**_json(by_stage), "unit": QUANTITIES[quantity].difference_unit}
                    for horizon, by_stage in horizons.items()
                }
                for quantity, horizons in self.errors.items()
            },
            "worsened": list(self.worsened),
            "missing": list(self.missing),
            "screened": _json(self.screened),
        }


def plain(value: float) -> str:
    """Return a number with two significant digits, as people write it."""
    rounded = float(f"{value:.2g}")
    return f"{rounded:.0f}" if abs(rounded) >= 10.0 else f"{rounded:.10f}".rstrip("0").rstrip(".")


def _title(cause: str) -> str:
    """Return what people call a cause that is confounded with another."""
    known = EFFECTS.get(cause) or VISIBLE.get(cause)
    return cause.replace("_", " ") if known is None else known.title


def _json(value: Any) -> Any:
    """Return a value as JSON has it: numbers with six significant digits, times in UTC."""
    if is_dataclass(value):
        return {one.name: _json(getattr(value, one.name)) for one in fields(value)}
    if isinstance(value, Mapping):
        return {key: _json(one) for key, one in value.items()}
    if isinstance(value, tuple):
        return [_json(one) for one in value]
    if isinstance(value, np.datetime64):
        return f"{np.datetime_as_string(value.astype('datetime64[s]'))}Z"
    return float(f"{value:.6g}") if isinstance(value, float) else value
