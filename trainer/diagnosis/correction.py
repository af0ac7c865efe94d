"""The corrected simulator as a model ready for export: parameters, effects with intervals, errors before and after."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from igrow.core.bundle import Bundle, EffectRecord, Estimate, HeldOutError, Onset, Span
from igrow.core.local_time import utc_datetime
from igrow.core.quantities import QUANTITIES
from igrow.core.site import Site
from igrow.trainer.calibration.posterior import Posterior
from igrow.trainer.diagnosis.diagnose import Evidence
from igrow.trainer.diagnosis.result import Diagnosis, Finding
from igrow.trainer.export.bundle import read_hybrid_model
from igrow.trainer.model import HybridModel


def corrected_model(bundle: Bundle, site: Site, diagnosis: Diagnosis, evidence: Evidence) -> HybridModel:
    """Return the model of a bundle with what a diagnosis found."""
    model = read_hybrid_model(bundle, site)
    corrected = evidence.corrected
    names = model.posterior.names
    known = model.posterior.values
    mean = np.array([corrected.parameters.get(name, known[name]) for name in names])
    before = dict(zip(names, map(float, model.posterior.standard_deviation), strict=True))
    deviation = np.array([corrected.standard_deviation.get(name, before[name]) for name in names])
    found = tuple(effect_record(one) for one in diagnosis.findings if one.kind != "remainder")
    replaced = {one.name for one in found}
    kept = tuple(one for one in model.effects if one.name not in replaced)
    errors = tuple(
        HeldOutError(quantity, horizon, stages["deployed"], stages["corrected"], QUANTITIES[quantity].unit)
        for quantity, horizons in diagnosis.errors.items()
        for horizon, stages in horizons.items()
    )
    span = Span(utc_datetime(diagnosis.start), utc_datetime(diagnosis.end))
    fitted = model.corrected(Posterior(names, mean, np.diag(deviation**2)), (*kept, *found))
    own = replace(fitted, calibrated_on=site.name, known_misfit=corrected.known_misfit)
    return own.trained(span, model.training_range, errors)


def effect_record(finding: Finding) -> EffectRecord:
    """Return a finding as the manifest's record of an effect."""
    onset = finding.onset
    return EffectRecord(
        finding.effect,
        finding.kind,
        {
            name: Estimate(float(one.value), float(one.low), float(one.high), one.unit)
            for name, one in finding.parameters.items()
        },
        finding.balances,
        None if onset is None else Onset(utc_datetime(onset.time), utc_datetime(onset.low), utc_datetime(onset.high)),
    )
