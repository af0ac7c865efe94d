"""What is known of a greenhouse before the log: the model in force, and how far a greenhouse may have moved since.

A model that was calibrated on this very greenhouse knows its parameters, give or take a drift, and its own discrepancy.
One that was calibrated on another greenhouse is a transferred model: its parameters may lie further off, and what it
missed at home says nothing here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from igrow.core.arrays import Array, Floats
from igrow.core.bundle import EffectRecord
from igrow.core.effects import EFFECTS
from igrow.core.simulator.hybrid.parameters import PARAMETERS
from igrow.core.simulator.hybrid.record import Record
from igrow.core.site import Site
from igrow.trainer.diagnosis.rules import DecisionRules
from igrow.trainer.fit.climate import bounds
from igrow.trainer.fit.discrepancy import Discrepancy
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.model import FittedModel

PARAMETER_PREFIX = "parameter:"
"""Key of a parameter's change in a discrepancy."""

CROP = frozenset({
    "transpiration_radiation", "transpiration_moist_air", "transpiration_night_share", "crop_long_wave_loss",
    "assimilation_maximum", "assimilation_light", "assimilation_co2", "respiration",
})  # fmt: skip
"""Parameters that change as the crop does."""
LIGHT = frozenset({
    "transmissivity", "solar_heat_share", "mass_solar_share", "lamp_heat_share", "lamp_radiation_share",
})  # fmt: skip
"""Parameters of where light ends, of which leaves take the more the more there are."""
VENTS = frozenset({"vent_wind", "vent_stack", "vent_curvature", "vent_windward_ratio"})
"""Parameters of the law of what goes through the vents, at the openings that taught it."""


@dataclass(frozen=True)
class ActiveTerm:
    """One effect at fitted values, from a time on."""

    effect: str
    amplitude: float
    shape: Mapping[str, float]
    """Nonlinear parameters by name."""
    onset: np.datetime64 | None = None
    """UTC; None is from before the log."""


@dataclass(frozen=True)
class Knowledge:
    """What a model says of a site."""

    posterior: Gaussian
    """Of the parameters, as the model has it."""
    prior: Gaussian
    """Of the parameters in this log, about the calibration itself: for fits to free runs."""
    shipped_prior: Gaussian
    """The same for the model that is shipped."""
    terms: tuple[ActiveTerm, ...]
    transferred: bool
    """It was calibrated on another greenhouse."""
    history: Discrepancy | None = None
    """What the model misses of this very greenhouse, learned at its calibration; None: nobody knows."""

    def by_physics(self, rules: DecisionRules) -> Gaussian:
        """Return where the parameters may lie if they have changed since as physics alone lets expect."""
        if self.history is None:
            # What physics lets change says little of a greenhouse that no calibration has shown.
            return self.prior
        return self.posterior.widened(home_drift(self.posterior.values, rules))


def knowledge_of(model: FittedModel, site: Site, rules: DecisionRules) -> Knowledge:
    """Return what a model says of a site."""
    at_home = model.calibrated_on == site.name
    posterior = model.posterior
    if not at_home:
        posterior = posterior.widened(drift(posterior.values, rules.transferred_drift, rules))
    # Fits to free runs may move further than a greenhouse changes: a parameter also stands in for what has no name.
    # The model that is shipped may follow it wherever that predicts better: what that hides has been told by then.
    prior, shipped_prior = (
        posterior.widened(np.maximum(drift(posterior.values, share, rules), home_drift(posterior.values, rules)))
        for share in (rules.parameter_drift, rules.shipped_drift)
    )
    terms = tuple(active_term(one) for one in model.effects if one.name in EFFECTS)
    history = model.history if at_home else None
    return Knowledge(model.posterior, prior, shipped_prior, terms, not at_home, history)


def active_term(record: EffectRecord) -> ActiveTerm:
    """Return an effect of a bundle as a term."""
    definition = EFFECTS[record.name]
    values = {name: estimate.value for name, estimate in record.parameters.items()}
    shape = {one.name: values.get(one.name, one.typical) for one in definition.shapes}
    onset = None if record.onset is None else np.datetime64(record.onset.time.replace(tzinfo=None), "s")
    return ActiveTerm(record.name, values.get(definition.amplitude.name, 0.0), shape, onset)


def drift(mean: Mapping[str, float], share: float, rules: DecisionRules) -> Floats:
    """Return the change to expect of every parameter at a relative `share`, (p,)."""
    return np.array(
        [share * max(abs(value), rules.least_drift_share * abs(PARAMETERS[name].value)) for name, value in mean.items()]
    )


def home_drift(mean: Mapping[str, float], rules: DecisionRules) -> Floats:
    """Return the change to expect of every parameter of a greenhouse since its calibration, (p,): the crop grows."""
    kinds = ((CROP, rules.crop_drift), (LIGHT, rules.light_drift), (VENTS, rules.vent_drift))
    of_its_kind = {name: share for names, share in kinds for name in names}
    share = np.array([of_its_kind.get(name, rules.wall_drift) for name in mean])
    changes: Floats = share * drift(mean, 1.0, rules)
    return changes


def clipped(names: Sequence[str], values: Floats) -> dict[str, float]:
    """Return values (p,) within their bounds, by name."""
    return dict(zip(names, np.clip(values, *bounds(names)).tolist(), strict=True))


def activate(record: Record, terms: Sequence[ActiveTerm]) -> dict[str, dict[str, Array]]:
    """Return the active effects of a record; an effect with a beginning has an amplitude that is (n,)."""
    active: dict[str, dict[str, Array]] = {}
    for term in terms:
        definition = EFFECTS[term.effect]
        amplitude: Array = term.amplitude
        ages = "elapsed_days" in definition.drivers
        if term.onset is not None and (ages or term.onset > record.time[0]):
            age = (record.time - term.onset).astype("timedelta64[s]").astype(np.float64) / 86_400.0
            share = (age >= 0.0).astype(np.float64)
            if ages:
                # The record counts from its first instant; the effect counts from its own beginning.
                share = np.maximum(age, 0.0) / np.maximum(np.asarray(record.inputs["elapsed_days"]), 1e-9)
            amplitude = term.amplitude * share
        active[term.effect] = {definition.amplitude.name: amplitude, **term.shape}
    return active
