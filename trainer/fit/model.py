"""The hybrid simulator of one greenhouse as the trainer holds it: fitted, corrected, ready for export."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from igrow.core.arrays import Floats
from igrow.core.bundle import EffectRecord, HeldOutError, Span
from igrow.core.planner.season import SeasonPlan
from igrow.core.quantities import QUANTITIES
from igrow.core.simulator import actuation, holding
from igrow.core.simulator.crop import CropStages
from igrow.core.simulator.growth import prior_of
from igrow.core.simulator.hybrid.parameters import PARAMETERS
from igrow.core.site import Site
from igrow.trainer.fit.climate import site_prior
from igrow.trainer.fit.discrepancy import Discrepancy
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.omission import Omission

MARGIN = 0.1
"""Share of its width by which a range reaches beyond the data: so far a physical model may be believed."""


@dataclass(frozen=True, repr=False)
class FittedModel:
    """Everything that a bundle of the hybrid variant is made from.

    `igrow.trainer.calibrate` makes one from a log, a diagnosis corrects it, `igrow.trainer.export` writes its bundle.
    """

    site: Site
    posterior: Gaussian
    """Of the physical parameters, with their correlations."""
    calibrated_on: str
    """Name of the site on whose log they were fitted; empty where it was none."""
    alignment: float | None = None
    """Rows of its log by which the actuators are read ahead; None: each log is asked."""
    history: Discrepancy | None = None
    """What the calibration could not explain on its own log, which is no finding later; None where it is not known."""
    effects: tuple[EffectRecord, ...] = ()
    omission: Omission | None = None
    """Terms that its calibration log says it lacks: among the effects only once the model is `completed`."""
    actuation: Mapping[str, float] = field(default_factory=actuation.default_rules)
    """Rules of the actuation stage by name."""
    holding: Mapping[str, float] = field(
        default_factory=lambda: {name: one.value for name, one in holding.PARAMETERS.items()}
    )
    """How the PLC holds heat and CO2, by name."""
    crop: CropStages | None = None
    """Growth and yield; None: those of the built-in bundle."""
    season: SeasonPlan | None = None
    """What the season leaves to the days; None where it was not planned."""
    training_span: Span | None = None
    training_range: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """By quantity, beyond which plans are believed less: what its log held, and what the virtual seasons did."""
    errors: tuple[HeldOutError, ...] = ()
    """On days that no fit saw."""
    notes: tuple[str, ...] = ()
    """What could not be told from the log, in sentences."""

    @classmethod
    def described(cls, site: Site) -> FittedModel:
        """Return what follows from a site's description alone, before any log."""
        return cls(site, site_prior(site), "")

    def __repr__(self) -> str:
        known = f"calibrated on {self.calibrated_on}" if self.calibrated_on else "not calibrated"
        effects = f", effects: {', '.join(effect.name for effect in self.effects)}" if self.effects else ""
        return f"FittedModel({self.site.name}: {len(self.posterior.names)} parameters, {known}{effects})"

    @property
    def active_effects(self) -> dict[str, dict[str, float]]:
        """Parameter values of the effects by name, as `igrow.core.simulator.hybrid` takes them."""
        return {
            effect.name: {name: estimate.value for name, estimate in effect.parameters.items()}
            for effect in self.effects
        }

    def corrected(
        self,
        posterior: Gaussian,
        effects: Sequence[EffectRecord],
        *,
        span: Span,
        errors: Sequence[HeldOutError],
        crop: CropStages | None = None,
    ) -> FittedModel:
        """Return the model with what a later log of its greenhouse taught.

        Args:
            posterior: of the parameters, their correlations with it.
            effects: all that are active now.
            span: of the log.
            errors: of the corrected model, on days that no fit saw.
            crop: its growth as the log counts it; None where it stays as it is.
        """
        return replace(
            self,
            posterior=posterior,
            calibrated_on=self.site.name,
            effects=tuple(effects),
            omission=None,
            training_span=span,
            errors=tuple(errors),
            crop=crop or self.crop,
            # The history of another greenhouse is none of this one's.
            history=self.history if self.calibrated_on == self.site.name else None,
        )

    def completed(self) -> FittedModel:
        """Return the model with the terms that it lacks, its parameters refitted beside them; itself where none is."""
        if self.omission is None:
            return self
        after = {(one.quantity, one.horizon): one.after for one in self.omission.errors}
        return replace(
            self,
            posterior=self.omission.posterior,
            effects=(*self.effects, *self.omission.effects),
            errors=tuple(replace(one, after=after.get((one.quantity, one.horizon), one.after)) for one in self.errors),
        )

    def equipped(self) -> FittedModel:
        """Return the model with the capacities of its site's equipment."""
        greenhouse = self.site.greenhouse
        rules, held = dict(self.actuation), dict(self.holding)
        rules["lamp_capacity"] = greenhouse.lamps.power if greenhouse.lamps else 0.0
        rules["co2_capacity"] = held["co2_capacity"] = greenhouse.co2_dosing_capacity
        held["heating_capacity"] = greenhouse.heating_capacity
        screens = (("energy_screen", greenhouse.energy_screen), ("blackout_screen", greenhouse.blackout_screen))
        for name, screen in screens:
            if screen is None:
                rules |= {f"{name}_unlit": 0.0, f"{name}_lit": 0.0, f"{name}_open": 0.0}
        return replace(self, actuation=rules, holding=held)

    def summary(self) -> str:
        """Return the parameters with their 90 % intervals, the effects and the errors, as a table for people."""
        lines = [repr(self)[len("FittedModel(") : -1]]
        if self.training_span is not None:
            lines.append(f"fitted on {self.training_span.start:%Y-%m-%d} to {self.training_span.end:%Y-%m-%d} (UTC)")
        if self.alignment is not None:
            lines.append(f"actuators read {self.alignment:g} rows ahead")
        lines += ["", f"{'parameter':28}{'value':>12}{'90 % interval':>26}  unit"]
        for name, value, deviation in zip(
            self.posterior.names, self.posterior.mean, self.posterior.standard_deviation, strict=True
        ):
            low, high = value - 1.645 * deviation, value + 1.645 * deviation
            lines.append(f"{name:28}{value:12.4g}{f'{low:.4g} to {high:.4g}':>26}  {PARAMETERS[name].unit}")
        for effect in self.effects:
            for name, one in effect.parameters.items():
                interval = f"{one.low:.4g} to {one.high:.4g}"
                lines.append(f"{effect.name + ' ' + name:28}{one.value:12.4g}{interval:>26}  {one.unit}")
        if self.crop is not None:
            rates = (("conversion", "kg kg-1"), ("maintenance", "kg m-2 h-1"))
            for (name, unit), deviation in zip(rates, np.sqrt(np.diag(prior_of(self.crop))).tolist(), strict=True):
                value, reach = getattr(self.crop, name), 1.645 * deviation
                interval = f"{max(value - reach, 0.0):.4g} to {value + reach:.4g}"
                lines.append(f"{f'growth {name}':28}{value:12.4g}{interval:>26}  {unit}")
        if self.errors:
            columns = ("horizon", "persistence", "before", "after")
            lines += ["", f"{'mean absolute error, unseen':28}" + "".join(f"{name:>12}" for name in columns)]
            for error in self.errors:
                naive = "-" if error.persistence is None else f"{error.persistence:.3g}"
                cells = (error.horizon, naive, f"{error.before:.3g}", f"{error.after:.3g}")
                unit = QUANTITIES[error.quantity].difference_unit
                lines.append(f"{error.quantity:28}" + "".join(f"{cell:>12}" for cell in cells) + f"  {unit}")
        return "\n".join([*lines, *(f"note: {note}" for note in self.notes)])


def united(*ranges: Mapping[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
    """Return the range of each quantity that holds all that are given of it."""
    found: dict[str, tuple[float, float]] = {}
    for one in ranges:
        for name, (low, high) in one.items():
            before = found.get(name, (low, high))
            found[name] = min(low, before[0]), max(high, before[1])
    return found


def training_envelope(columns: Mapping[str, Floats]) -> dict[str, tuple[float, float]]:
    """Return the smallest and the largest value of each column, (n,), that has any, with a margin on either side."""
    found = {}
    for name, values in columns.items():
        finite = values[np.isfinite(values)]
        if len(finite):
            low, high = float(finite.min()), float(finite.max())
            found[name] = (low - MARGIN * (high - low), high + MARGIN * (high - low))
    return found
