"""Writes a hybrid model as a bundle, and reads the model back from one."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from igrow import __version__
from igrow.core.bundle import BUILT_IN, Bundle, BundleError, Golden, Manifest, Parameter, run_graph, write_bundle
from igrow.core.effects import EFFECTS
from igrow.core.planner.evolution import EvolutionSettings
from igrow.core.simulator import actuation, holding
from igrow.core.simulator.crop import CropStages
from igrow.core.simulator.hybrid.nominal import as_described, nominal
from igrow.core.simulator.hybrid.parameters import PARAMETERS
from igrow.core.site import Site
from igrow.trainer.calibration.posterior import Posterior, prior
from igrow.trainer.export.blocks import OPSET, open_model
from igrow.trainer.export.climate import climate_blocks, effect_parameter
from igrow.trainer.export.golden import golden_inputs
from igrow.trainer.export.hindcast import hindcast_model
from igrow.trainer.export.optimizer import export_optimizer, optimizer_signature
from igrow.trainer.export.plan import plan_blocks, plan_model
from igrow.trainer.export.signatures import signatures
from igrow.trainer.model import CALIBRATED_ON_KEY, MISFIT_KEY, HybridModel
from igrow.trainer.training.stage_file import stages_from_bytes, stages_to_bytes

CROP_FILE = "crop.npz"
MEMBERS = 3
"""Draws from the posterior that a bundle carries beside the mean, for cautious plans."""


def write_hybrid_bundle(folder: Path, model: HybridModel, *, created: datetime, seed: int = 0) -> Bundle:
    """Export a model, run its graphs on golden inputs, and write the bundle.

    Args:
        folder: must not exist yet.
        model: the fitted simulator.
        created: time of making, UTC.
        seed: of the posterior's draws and the golden inputs.

    Raises:
        BundleError: the bundle cannot be written.
    """
    random = np.random.default_rng(seed)
    blocks = climate_blocks([effect.name for effect in model.effects])
    planning = plan_blocks(blocks, model.crop, model.training_range)
    settings = EvolutionSettings()
    graphs = {
        "simulator": plan_model(planning),
        "hindcast": hindcast_model(blocks),
        "optimizer": export_optimizer(settings),
    }
    reference = model.training_span.start if model.training_span else created
    values = _parameter_values(model, reference)
    golden = {}
    for name, inputs in golden_inputs(planning, values, settings, random).items():
        session = open_model(graphs[name])
        golden[name] = Golden(inputs, run_graph(session, inputs))
    lamps = model.site.greenhouse.lamps
    drawn = model.posterior.sample(random, MEMBERS)
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
            name: Parameter(float(mean), float(deviation), PARAMETERS[name].unit)
            for name, mean, deviation in zip(
                model.posterior.names, model.posterior.mean, model.posterior.standard_deviation, strict=True
            )
        },
        covariance=tuple(tuple(float(value) for value in row) for row in model.posterior.covariance),
        errors=model.errors,
        training_range=model.training_range,
        simulator={
            "latitude": model.site.latitude,
            "longitude": model.site.longitude,
            "mean_height": model.site.greenhouse.mean_height,
            "lamp_efficacy": lamps.efficacy if lamps else 0.0,
            "leaf_area_index": 3.0,
            MISFIT_KEY: dict(model.known_misfit),
            CALIBRATED_ON_KEY: model.calibrated_on,
            "conversion": model.crop.conversion,
            "maintenance": model.crop.maintenance,
            "growth_covariance": None if model.crop.covariance is None else model.crop.covariance.tolist(),
            "reference_time": reference.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
            "parameters": values,
            "members": [
                {f"parameter:{name}": float(draws[row, 0]) for name, draws in drawn.items()} for row in range(MEMBERS)
            ],
        },
    )
    files = {f"{name}.onnx": graph.SerializeToString() for name, graph in graphs.items()}
    files[CROP_FILE] = stages_to_bytes({"growth": model.crop.growth, "harvest": model.crop.harvest})
    return write_bundle(folder, manifest, files, golden)


def read_hybrid_model(bundle: Bundle, site: Site) -> HybridModel:
    """Return the model that a bundle was made from.

    Raises:
        BundleError: the bundle is of another variant, of another site, or lacks what a model needs.
    """
    manifest = bundle.manifest
    if manifest.variant != "hybrid":
        raise BundleError(f"{bundle.folder}: is a {manifest.variant} bundle; a hybrid one is needed")
    known = [name for name in PARAMETERS if name in manifest.parameters]
    if not known:
        raise BundleError(f"{bundle.folder}: manifest.json: parameters: none of the simulator's stands there")
    means = {name: manifest.parameters[name].mean for name in known}
    values = nominal(site) | (as_described(means, site) if manifest.site == BUILT_IN else means)
    posterior = prior(values, {name: manifest.parameters[name].standard_deviation for name in known})
    if manifest.covariance is not None and tuple(manifest.parameters) == posterior.names:
        posterior = Posterior(posterior.names, posterior.mean, np.array(manifest.covariance))
    try:
        content = (bundle.folder / CROP_FILE).read_bytes()
    except OSError as error:
        raise BundleError(f"{bundle.folder}: {CROP_FILE} is not readable: {error.strerror}") from None
    stages, _ = stages_from_bytes(content, where=str(bundle.folder / CROP_FILE))
    given = manifest.simulator.get("parameters", {})
    covariance = manifest.simulator.get("growth_covariance")
    return HybridModel(
        site=site,
        posterior=posterior,
        calibrated_on=str(manifest.simulator.get(CALIBRATED_ON_KEY, manifest.site)),
        actuation={name: float(given.get(f"actuation:{name}", rule.value)) for name, rule in actuation.RULES.items()},
        holding={name: float(given.get(f"holding:{name}", one.value)) for name, one in holding.PARAMETERS.items()},
        crop=CropStages(
            stages["growth"],
            stages["harvest"],
            float(manifest.simulator.get("conversion", 0.0)),
            float(manifest.simulator.get("maintenance", 0.0)),
            None if covariance is None else np.array(covariance, dtype=np.float64),
        ),
        effects=tuple(effect for effect in manifest.effects if effect.kind != "remainder"),
        training_span=manifest.training_span,
        training_range=manifest.training_range,
        errors=manifest.errors,
        known_misfit={str(key): float(value) for key, value in manifest.simulator.get(MISFIT_KEY, {}).items()},
    )


def _parameter_values(model: HybridModel, reference: datetime) -> dict[str, float]:
    """Return the value of each row of the graphs' input `parameters`."""
    lamps = model.site.greenhouse.lamps
    values = {
        "mean_height": model.site.greenhouse.mean_height,
        "lamp_efficacy": lamps.efficacy if lamps else 0.0,
    }
    values |= {f"parameter:{name}": value for name, value in model.posterior.values.items()}
    values |= {f"actuation:{name}": float(value) for name, value in model.actuation.items()}
    values |= {f"holding:{name}": float(value) for name, value in model.holding.items()}
    for effect in model.effects:
        for parameter in EFFECTS[effect.name].parameters:
            estimate = effect.parameters.get(parameter.name)
            value = estimate.value if estimate else parameter.typical
            values[effect_parameter(effect.name, parameter.name)] = value
        began = effect.onset.time if effect.onset else reference
        values[effect_parameter(effect.name, "onset")] = (began - reference).total_seconds() / 86_400.0
    return values
