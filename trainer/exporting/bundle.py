"""The ends of the road at the bundle: a fitted model written as one, and read back from it."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from igrow import __version__
from igrow.core.bundle import (
    BUILT_IN,
    Bundle,
    BundleError,
    FittedParameter,
    Golden,
    Manifest,
    read_bundle,
    run_graph,
    write_bundle,
)
from igrow.core.effects import EFFECTS
from igrow.core.planner.evolution import EvolutionSettings
from igrow.core.planner.season import SEASON_FILE, SeasonPlan
from igrow.core.simulator import actuation, holding
from igrow.core.simulator.hybrid.nominal import as_described
from igrow.core.simulator.hybrid.parameters import PARAMETERS, fitted_to_these_balances
from igrow.core.site import Site
from igrow.trainer.exporting.blocks import OPSET, open_model
from igrow.trainer.exporting.climate import climate_blocks, effect_parameter
from igrow.trainer.exporting.golden import golden_inputs
from igrow.trainer.exporting.hindcast import hindcast_model
from igrow.trainer.exporting.optimizer import export_optimizer, optimizer_signature
from igrow.trainer.exporting.plan import plan_blocks, plan_model, settings
from igrow.trainer.exporting.signatures import signatures
from igrow.trainer.fit.climate import bounds, site_prior
from igrow.trainer.fit.discrepancy import Discrepancy
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.growth import CROP_FILE, built_in_crop, crop_of
from igrow.trainer.fit.model import FittedModel
from igrow.trainer.given import MADE, must_be
from igrow.trainer.training.stage_file import stages_to_bytes

DISCREPANCY_FILE = "discrepancy.npz"
MEMBERS = 3
"""Draws from the posterior that a bundle carries beside the mean, for cautious plans."""


def export(model: FittedModel, folder: Path | str, *, created: datetime | None = None, seed: int = 0) -> Bundle:
    """Write a model as a bundle, its graphs run on golden inputs.

        bundle = export(model, "out/bundle")

    Args:
        model: the fitted simulator.
        folder: must not exist yet.
        created: time of making, UTC; None: now.
        seed: of the posterior's draws and the golden inputs.

    Raises:
        BundleError: the bundle cannot be written.
    """
    must_be(FittedModel, model, MADE)
    created = created or datetime.now(UTC)
    crop = model.crop or built_in_crop()
    random = np.random.default_rng(seed)
    blocks = climate_blocks([effect.name for effect in model.effects])
    planning = plan_blocks(blocks, crop, model.training_range, actuation.setpoints_of(model.actuation))
    settings = EvolutionSettings()
    graphs = {
        "simulator": plan_model(planning),
        "hindcast": hindcast_model(blocks),
        "optimizer": export_optimizer(settings),
    }
    reference = model.training_span.start if model.training_span else created
    values = _parameter_values(model, reference)
    inputs = golden_inputs(planning, values, settings, random)
    golden = {name: Golden(given, run_graph(open_model(graphs[name]), given)) for name, given in inputs.items()}
    drawn = model.posterior.sample(random, MEMBERS, *bounds(model.posterior.names))
    manifest = Manifest(
        site=model.site.name,
        created=created.astimezone(UTC),
        igrow_version=__version__,
        variant="hybrid",
        opset=OPSET,
        graphs=signatures(planning) | {"optimizer": optimizer_signature(graphs["optimizer"])},
        training_span=model.training_span,
        effects=model.effects,
        parameters={
            name: FittedParameter(mean, model.posterior.deviations[name], PARAMETERS[name].unit)
            for name, mean in model.posterior.values.items()
        },
        covariance=tuple(tuple(float(value) for value in row) for row in model.posterior.covariance),
        calibrated_on=model.calibrated_on,
        alignment=model.alignment,
        errors=model.errors,
        training_range=model.training_range,
        simulator={
            "latitude": model.site.latitude,
            "longitude": model.site.longitude,
            **_constants(model.site),
            "leaf_area_index": 3.0,
            "conversion": crop.conversion,
            "maintenance": crop.maintenance,
            "growth_covariance": None if crop.covariance is None else crop.covariance.tolist(),
            "reference_time": reference.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
            "parameters": values,
            "members": [
                {f"parameter:{name}": float(draws[row, 0]) for name, draws in drawn.items()} for row in range(MEMBERS)
            ],
        },
    )
    files = {f"{name}.onnx": graph.SerializeToString() for name, graph in graphs.items()}
    files[CROP_FILE] = stages_to_bytes({"growth": crop.growth, "harvest": crop.harvest})
    if model.season is not None:
        files[SEASON_FILE] = model.season.to_json().encode()
    if model.history is not None:
        files[DISCREPANCY_FILE] = model.history.to_bytes()
    return write_bundle(Path(folder), manifest, files, golden)


def read_model(bundle: Bundle | Path | str, site: Site) -> FittedModel:
    """Return the model that a bundle was made from, as the model of a site.

    What was fitted to other balances, by an earlier version, is a calibration of no greenhouse: it is to be made anew.

    Raises:
        BundleError: the bundle is of another variant, or lacks what a model needs.
    """
    bundle = bundle if isinstance(bundle, Bundle) else read_bundle(Path(bundle))
    manifest = bundle.manifest
    if manifest.variant != "hybrid":
        raise BundleError(f"{bundle.folder}: is a {manifest.variant} bundle; a hybrid one is needed")
    given = manifest.simulator.get("parameters", {})
    of_these = fitted_to_these_balances(manifest.parameters)
    return FittedModel(
        site=site,
        posterior=_posterior(bundle, site),
        calibrated_on=manifest.calibrated_on if of_these else "",
        alignment=manifest.alignment,
        history=_history_of(bundle) if of_these else None,
        effects=manifest.effects,
        actuation={name: float(given.get(f"actuation:{name}", rule.value)) for name, rule in actuation.RULES.items()},
        holding={name: float(given.get(f"holding:{name}", one.value)) for name, one in holding.PARAMETERS.items()},
        crop=crop_of(bundle),
        season=SeasonPlan.of(bundle) if manifest.site == site.name else None,
        training_span=manifest.training_span,
        training_range=manifest.training_range,
        errors=manifest.errors,
    )


def _posterior(bundle: Bundle, site: Site) -> Gaussian:
    """Return what a bundle knows of the parameters, and of those that it lacks what the site's description says."""
    manifest, prior = bundle.manifest, site_prior(site)
    known = [name for name in prior.names if name in manifest.parameters]
    if not known:
        raise BundleError(f"{bundle.folder}: manifest.json: parameters: none of the simulator's stands there")
    means = {name: manifest.parameters[name].mean for name in known}
    values = prior.values | (as_described(means, site) if manifest.site == BUILT_IN else means)
    covariance = prior.covariance.copy()
    rows = [prior.names.index(name) for name in known]
    order = [list(manifest.parameters).index(name) for name in known]
    covariance[np.ix_(rows, rows)] = (
        np.diag([manifest.parameters[name].standard_deviation ** 2 for name in known])
        if manifest.covariance is None
        else np.array(manifest.covariance)[np.ix_(order, order)]
    )
    return Gaussian(prior.names, np.array([values[name] for name in prior.names]), covariance)


def _history_of(bundle: Bundle) -> Discrepancy | None:
    """Return what a bundle knows of its greenhouse's discrepancy; None where it knows nothing."""
    if DISCREPANCY_FILE not in bundle.manifest.files:
        return None
    return Discrepancy.from_bytes(bundle.content(DISCREPANCY_FILE), where=str(bundle.folder / DISCREPANCY_FILE))


def _constants(site: Site) -> dict[str, float]:
    """Return what the climate stage knows of a greenhouse beside its parameters."""
    lamps = site.greenhouse.lamps
    return {"mean_height": site.greenhouse.mean_height, "lamp_efficacy": lamps.efficacy if lamps else 0.0}


def _parameter_values(model: FittedModel, reference: datetime) -> dict[str, float]:
    """Return the value of each row of the graphs' input `parameters`."""
    values = _constants(model.site)
    values |= {f"parameter:{name}": value for name, value in model.posterior.values.items()}
    rules = model.actuation
    answered = settings(actuation.setpoints_of(rules))
    values |= {f"actuation:{name}": float(value) for name, value in rules.items() if f"actuation:{name}" in answered}
    values |= {f"holding:{name}": float(value) for name, value in model.holding.items()}
    for effect in model.effects:
        for parameter in EFFECTS[effect.name].parameters:
            estimate = effect.parameters.get(parameter.name)
            value = estimate.value if estimate else parameter.typical
            values[effect_parameter(effect.name, parameter.name)] = value
        began = effect.onset.time if effect.onset else reference
        values[effect_parameter(effect.name, "onset")] = (began - reference).total_seconds() / 86_400.0
    return values
