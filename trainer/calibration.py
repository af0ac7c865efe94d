"""The one calibration: from a log to the fitted model of its greenhouse.

    log --> alignment --> record on the working grid --> parameters --> what the model lacks --> growth --> discrepancy
                                                    \\-> rules of the PLC, and how it holds heat and CO2

Growth is fitted where the log counts any.

The parameters are fitted to all of the log; how well they predict is told by a second fit that leaves every fourth week
out, on these weeks.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from igrow.core.bundle import HeldOutError, Span, default_bundle_folder, read_bundle
from igrow.core.errors import IgrowError
from igrow.core.local_time import utc_datetime
from igrow.core.simulator.crop import CropStages
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.data import Log
from igrow.trainer.data.splits import held_out_weeks
from igrow.trainer.diagnosis import DEFAULT, examine, history_of
from igrow.trainer.diagnosis.answer.wording import thin_air
from igrow.trainer.diagnosis.knowledge import activate, active_term
from igrow.trainer.fit.actuation import by_its_own_rules, fit_actuation, setpoint_columns, unanswered
from igrow.trainer.fit.climate import fit_climate
from igrow.trainer.fit.evaluation import held_out_errors
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.growth import Canopy, built_in_crop, growth_notes, growth_of_log
from igrow.trainer.fit.holding import fit_holding
from igrow.trainer.fit.model import FittedModel, training_envelope, united
from igrow.trainer.fit.omission import Omission
from igrow.trainer.fit.population import Population
from igrow.trainer.given import READ, must_be
from igrow.trainer.progress import Progress, silent


def calibrate(
    log: Log,
    *,
    prior_model: FittedModel | None = None,
    population: Population | None = None,
    complete: bool = False,
    progress: Progress = silent,
) -> FittedModel:
    """Return the simulator of a greenhouse fitted to its log.

        model = calibrate(log)

    Args:
        log: four weeks or more, with its site; less than a week says too little.
        prior_model: what is known of it before; None: its description alone. Causes that were found before are not
            carried over: they are looked for again.
        population: what other greenhouses of its owner have shown; a prior in the place of the description's.
        complete: put the term into the model that its log says it lacks (`FittedModel.omission`).
        progress: is told what is being done, in lines.

    Raises:
        IgrowError: the log cannot be fitted to, and why.
    """
    must_be(Log, log, READ)
    log.require("a calibration")
    site = log.known_site
    before = prior_model or FittedModel.described(site)
    if population is not None:
        before = replace(before, posterior=population.prior(site))
    alignment = log.best_shift(before.posterior.values)
    record = log.record(alignment)
    posterior = fit_climate([(record, None)], before.posterior, progress=progress)
    setpoints, inferred = setpoint_columns(log.telemetry, record, site)
    rules = fit_actuation([(record, setpoints, by_its_own_rules(log.telemetry, record))], posterior.values)
    progress("rules of the climate computer fitted")
    model = replace(
        before,
        site=site,
        posterior=posterior,
        calibrated_on=site.name,
        alignment=alignment,
        effects=(),
        history=None,
        omission=None,
        actuation=rules,
        holding=fit_holding(record, setpoints, posterior.values, before.holding),
        season=before.season if before.site.name == site.name else None,
        training_span=Span(utc_datetime(record.time[0]), utc_datetime(record.time[-1])),
        # The balances are physics, and what few weeks leave open of them is in the posterior's spread. The bounds of
        # these weeks alone would hold each plan to the recipe under which they passed.
        training_range=united(
            training_envelope({**record.measured, **record.inputs, **setpoints}),
            before.training_range,
            read_bundle(default_bundle_folder()).manifest.training_range,
        ),
        errors=_held_out_errors(record, before.posterior, progress),
        notes=(*_notes(record, inferred), *unanswered(site, rules), *thin_air(site)),
    )
    model = replace(model, omission=_omission(record, model, progress))
    model = _with_growth(
        model.completed() if complete else model, log, record, before.crop or built_in_crop(), progress
    )
    return _with_discrepancy(model, record, log.days, population, progress)


def _held_out_errors(record: Record, prior: Gaussian, progress: Progress) -> tuple[HeldOutError, ...]:
    """Return the errors of the prior and of a fit that leaves every fourth week out, on these weeks.

    Empty where the log has no fourth week, or nothing complete in it.
    """
    held_out = held_out_weeks(record.time)
    if not held_out.any():
        progress("the log is too short to hold a week back: no errors on unseen days; four weeks are needed")
        return ()
    try:
        fitted = fit_climate([(record, ~held_out)], prior)
    except IgrowError:
        return ()
    return held_out_errors(record, held_out, (prior.values, {}), (fitted.values, {}))


def _omission(record: Record, model: FittedModel, progress: Progress) -> Omission | None:
    """Return the term that a model lacks by its own log; None, and why, where that cannot be told."""
    if not held_out_weeks(record.time).any():
        progress("the log is too short to tell what the model lacks: four weeks are needed")
        return None
    progress("asking the log what the model lacks")
    try:
        return examine(record, model.site, model.posterior, DEFAULT, progress=progress)
    except (IgrowError, np.linalg.LinAlgError) as error:
        progress(f"what the model lacks could not be asked of its own log: {error}")
        return None


def _with_growth(model: FittedModel, log: Log, record: Record, before: CropStages, progress: Progress) -> FittedModel:
    """Return the model with the growth that its log counts, beside what its canopy takes up."""
    terms = [active_term(one) for one in model.effects]
    crop, growth = growth_of_log(log, record, Canopy(model.posterior.values, activate(record, terms)), before)
    notes = growth_notes(model.site, before, growth)
    for note in notes:
        progress(note)
    return replace(model, crop=crop, notes=(*model.notes, *notes))


def _with_discrepancy(
    model: FittedModel, record: Record, days: float, population: Population | None, progress: Progress
) -> FittedModel:
    """Return the model with what it misses on its own log, and without it where that cannot be told."""
    if not DEFAULT.learns_history(days):
        return model
    progress("learning what the model misses on its own log")
    try:
        return replace(model, history=history_of(record, model, DEFAULT, population))
    except (IgrowError, np.linalg.LinAlgError) as error:
        note = (
            f"what the model misses on its own log could not be learned, so a diagnosis sees large causes only: {error}"
        )
        return replace(model, notes=(*model.notes, note))


def _notes(record: Record, inferred: tuple[str, ...]) -> list[str]:
    notes = []
    if record.missing:
        notes.append(f"the log lacks {', '.join(record.missing)}: what hangs on them keeps its usual value")
    if inferred:
        notes.append(f"the log lacks {', '.join(inferred)}: inferred from what was held")
    return notes
