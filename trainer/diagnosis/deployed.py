"""The model that a diagnosis starts from: what a bundle carries, or what a site's description says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from igrow.core.bundle import BUILT_IN, Manifest
from igrow.core.effects import EFFECTS
from igrow.core.errors import IgrowError
from igrow.core.simulator.hybrid.nominal import as_described, nominal
from igrow.core.simulator.hybrid.record import Record
from igrow.core.site import Site
from igrow.trainer.calibration import Posterior
from igrow.trainer.data.splits import split_days
from igrow.trainer.diagnosis import prior as priors
from igrow.trainer.diagnosis import problem, structure
from igrow.trainer.diagnosis.activation import ActiveTerm
from igrow.trainer.diagnosis.prior import Prior
from igrow.trainer.model import CALIBRATED_ON_KEY, MISFIT_KEY


@dataclass(frozen=True)
class Deployed:
    """Parameters with their doubt, effects found before, and the misfit of the calibration."""

    parameters: Mapping[str, float]
    standard_deviation: Mapping[str, float]
    """Empty: the model has seen no log."""
    effects: tuple[ActiveTerm, ...] = ()
    known_misfit: Mapping[str, float] = field(default_factory=dict)
    """Empty: it was not calibrated on this very greenhouse, or not with a look at what it misses there."""
    shift: float | None = None
    """Rows by which the site's actuators are read ahead; None asks each log."""

    @property
    def prior(self) -> Prior:
        """What is known of the parameters before a new log."""
        if self.standard_deviation:
            knowledge = priors.from_posterior(self.parameters, self.standard_deviation)
            return structure.centre(knowledge, self.known_misfit)
        return priors.from_nominal(self.parameters)

    @property
    def free_run_prior(self) -> Prior:
        """The same around the calibrated parameters themselves, for fits to free runs."""
        if self.standard_deviation:
            return priors.from_posterior(self.parameters, self.standard_deviation)
        return priors.from_nominal(self.parameters)


def from_site(site: Site) -> Deployed:
    """Return the model that follows from a site's description alone."""
    return Deployed(nominal(site), {})


def from_posterior(posterior: Posterior, known_misfit: Mapping[str, float] | None = None) -> Deployed:
    """Return the model of a calibration."""
    deviations = dict(zip(posterior.names, map(float, posterior.standard_deviation), strict=True))
    return Deployed(posterior.values, deviations, (), known_misfit or {})


def from_manifest(manifest: Manifest, site: Site) -> Deployed:
    """Return the model that a bundle carries, as knowledge of a site.

    What was calibrated on another greenhouse is known less well of this one, and what it missed there says nothing.

    Raises:
        IgrowError: the bundle is not of the hybrid variant, or has no parameters.
    """
    if manifest.variant != "hybrid" or not manifest.parameters:
        raise IgrowError(
            f"the bundle of {manifest.site} is a {manifest.variant} without physical parameters: "
            "diagnosis needs a bundle of the hybrid simulator"
        )
    effects = []
    for record in manifest.effects:
        if record.kind == "remainder" or record.name not in EFFECTS:
            continue
        definition = EFFECTS[record.name]
        values = {name: estimate.value for name, estimate in record.parameters.items()}
        shape = {one.name: values.get(one.name, one.typical) for one in definition.shapes}
        onset = None if record.onset is None else np.datetime64(record.onset.time.replace(tzinfo=None), "s")
        effects.append(ActiveTerm(record.name, values.get(definition.amplitude.name, 0.0), shape, onset))
    misfit = manifest.simulator.get(MISFIT_KEY, {})
    mean = {name: one.mean for name, one in manifest.parameters.items()}
    deviation = {name: one.standard_deviation for name, one in manifest.parameters.items()}
    known = {str(key): float(value) for key, value in misfit.items()} if isinstance(misfit, dict) else {}
    if manifest.simulator.get(CALIBRATED_ON_KEY, manifest.site) == site.name:
        return Deployed(mean, deviation, tuple(effects), known)
    if manifest.site == BUILT_IN:
        mean = as_described(mean, site)
    return Deployed(mean, priors.elsewhere(mean, deviation), tuple(effects))


def learn_misfit(
    record: Record, parameters: Mapping[str, float], deviation: Mapping[str, float], longitude: float
) -> dict[str, float]:
    """Return the misfit of a calibrated model on its own log, for `Deployed.known_misfit` and the manifest.

    Args:
        record: of the calibration log (`Log.record`).
        parameters: calibrated, by name.
        deviation: their standard deviations.
        longitude: degrees east.
    """
    split = split_days(record, longitude)
    knowledge = priors.from_posterior(parameters, deviation)
    return structure.learn(problem.prepare(record, split, knowledge, {}, longitude, {}))
