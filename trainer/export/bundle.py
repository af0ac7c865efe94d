"""Writes a hybrid model as a bundle, and reads the model back from one."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from onnx import ModelProto

from igrow_core.bundle import (
    Bundle,
    BundleError,
    Golden,
    GraphSignature,
    Manifest,
    Parameter,
    Tensor,
    run_graph,
    write_bundle,
)
from igrow_core.effects import EFFECTS
from igrow_core.planner.evolution import EvolutionSettings, draw, fixed_inputs
from igrow_core.quantities import GROWTH, QUANTITIES, SETPOINTS, YIELD
from igrow_core.simulator import actuation, holding
from igrow_core.simulator.crop import CropStages
from igrow_core.simulator.hybrid.measurement import PREDICTED
from igrow_core.simulator.hybrid.nominal import nominal
from igrow_core.simulator.hybrid.parameters import PARAMETERS
from igrow_core.simulator.plan import CLIMATE_OUT, CLOCK, EQUIPMENT, RESOURCES
from igrow_core.site import Site
from trainer.calibration.posterior import Posterior, prior
from trainer.export import hindcast, plan
from trainer.export.blocks import OPSET, open_model
from trainer.export.climate import climate_blocks, effect_parameter
from trainer.export.optimizer import export_optimizer
from trainer.model import HybridModel
from trainer.training.stage_file import stages_from_bytes, stages_to_bytes

CROP_FILE = "crop.npz"
MISFIT_KEY = "known_misfit"
"""Where the manifest's `simulator` holds what the calibration could not explain."""
MEMBERS = 3
"""Draws from the posterior that a bundle carries beside the mean, for cautious plans."""
_UNITS = {"vent_lee": "%", "vent_wind": "%", "rail_pipe_excess": "K", "heat": "MJ m-2", "electricity": "kWh m-2"}
_UNITS |= {"co2": "kg m-2", "sun_elevation": "deg", "sun_azimuth": "deg", "hour": "h"}


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
    planning = plan.plan_blocks(blocks, model.crop, model.training_range)
    settings = EvolutionSettings()
    graphs = {
        "simulator": plan.plan_model(planning),
        "hindcast": hindcast.hindcast_model(blocks),
        "optimizer": export_optimizer(settings),
    }
    reference = model.training_span.start if model.training_span else created
    values = _parameter_values(model, reference)
    golden = {}
    for name, inputs in _golden_inputs(planning, values, settings, random).items():
        session = open_model(graphs[name])
        golden[name] = Golden(inputs, run_graph(session, inputs))
    lamps = model.site.greenhouse.lamps
    drawn = model.posterior.sample(random, MEMBERS)
    manifest = Manifest(
        site=model.site.name,
        created=created.astimezone(UTC),
        igrow_version=version("igrow"),
        variant="hybrid",
        opset=OPSET,
        graphs=_signatures(planning) | {"optimizer": plain_signature(graphs["optimizer"])},
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
            "conversion": model.crop.conversion,
            "maintenance": model.crop.maintenance,
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
    values = nominal(site) | {name: manifest.parameters[name].mean for name in known}
    posterior = prior(values, {name: manifest.parameters[name].standard_deviation for name in known})
    if manifest.covariance is not None and tuple(manifest.parameters) == posterior.names:
        posterior = Posterior(posterior.names, posterior.mean, np.array(manifest.covariance))
    try:
        content = (bundle.folder / CROP_FILE).read_bytes()
    except OSError as error:
        raise BundleError(f"{bundle.folder}: {CROP_FILE} is not readable: {error.strerror}") from None
    stages, _ = stages_from_bytes(content, where=str(bundle.folder / CROP_FILE))
    given = manifest.simulator.get("parameters", {})
    return HybridModel(
        site=site,
        posterior=posterior,
        actuation={name: float(given.get(f"actuation:{name}", rule.value)) for name, rule in actuation.RULES.items()},
        holding={name: float(given.get(f"holding:{name}", one.value)) for name, one in holding.PARAMETERS.items()},
        crop=CropStages(
            stages["growth"],
            stages["harvest"],
            float(manifest.simulator.get("conversion", 0.0)),
            float(manifest.simulator.get("maintenance", 0.0)),
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


def _signatures(blocks: plan.PlanBlocks) -> dict[str, GraphSignature]:
    def tensor(name: str, axes: tuple[str | int, ...], quantities: tuple[str, ...]) -> Tensor:
        return Tensor(name, tuple(str(axis) for axis in axes), quantities, tuple(_unit(one) for one in quantities))

    rows = {
        "climate": PREDICTED,
        "growth": GROWTH,
        "harvest": YIELD,
        "equipment": EQUIPMENT,
        "weather": blocks.weather,
        "clock": CLOCK,
        "day": ("day",),
        "setpoints": SETPOINTS,
        "parameters": blocks.parameters,
        "climate_out": CLIMATE_OUT,
        "resources": RESOURCES,
        "growth_out": GROWTH,
        "harvest_out": YIELD,
        "outside": ("outside",),
    }
    traced = {
        "climate": PREDICTED,
        "inputs": blocks.climate.inputs,
        "measured": PREDICTED,
        "follow": ("follow",),
        "day": ("day",),
        "seconds": ("seconds",),
        "parameters": blocks.climate.parameters,
        "predicted": PREDICTED,
    }
    return {
        "simulator": GraphSignature(
            tuple(tensor(name, axes, rows[name]) for name, axes in plan.input_shapes(blocks).items()),
            tuple(tensor(name, axes, rows[name]) for name, axes in plan.OUTPUTS.items()),
        ),
        "hindcast": GraphSignature(
            tuple(tensor(name, axes, traced[name]) for name, axes in hindcast.INPUTS.items()),
            tuple(tensor(name, axes, traced[name]) for name, axes in hindcast.OUTPUTS.items()),
        ),
    }


def plain_signature(model: ModelProto) -> GraphSignature:
    """Return the names of a graph's inputs and outputs, whose entries are no quantities."""
    return GraphSignature(
        tuple(Tensor(one.name) for one in model.graph.input), tuple(Tensor(one.name) for one in model.graph.output)
    )


def _unit(name: str) -> str:
    if name in QUANTITIES:
        return QUANTITIES[name].unit
    group, _, rest = name.partition(":")
    if group == "parameter":
        return PARAMETERS[rest].unit
    if group == "actuation":
        return actuation.RULES[rest].unit
    if group == "holding":
        return holding.PARAMETERS[rest].unit
    if group == "effect":
        effect, _, parameter = rest.partition(":")
        return next((one.unit for one in EFFECTS[effect].parameters if one.name == parameter), "d")
    return _UNITS.get(name, "1")


def _golden_inputs(
    blocks: plan.PlanBlocks, values: Mapping[str, float], settings: EvolutionSettings, random: np.random.Generator
) -> dict[str, dict[str, NDArray[Any]]]:
    """Return inputs of a plausible day for the self-test, by graph."""
    hours, batch = 24, 2
    hour = np.arange(hours)
    sun = np.maximum(np.sin((hour - 6) / 12 * np.pi), 0.0)
    course = {
        "outdoor_temperature": 8.0 + 4.0 * sun,
        "outdoor_humidity": 85.0 - 20.0 * sun,
        "outdoor_co2": np.full(hours, 415.0),
        "global_radiation": 450.0 * sun,
        "wind_speed": 4.0 + random.uniform(-2, 2, hours),
        "sky_temperature": np.full(hours, -4.0),
        "wind_direction": np.full(hours, 225.0),
        "rain": np.zeros(hours),
        "sun_elevation": 40.0 * sun - 5.0,
        "sun_azimuth": 15.0 * hour,
        "hour": hour.astype(np.float64),
        "vent_lee": 20.0 * sun,
        "rail_pipe_temperature": 45.0 * (1 - sun),
        "leaf_area_index": np.full(hours, 3.0),
    }

    def columns(names: tuple[str, ...]) -> NDArray[np.float64]:
        return np.stack([course.get(name, np.zeros(hours)) for name in names], axis=1)[:, :, None]

    def parameters(names: tuple[str, ...]) -> NDArray[np.float64]:
        return np.array([[values[name]] for name in names])

    climate = np.array([[18.0, 21.0], [75.0, 82.0], [450.0, 800.0]])
    setpoints = np.stack([18.0 + 3 * sun, 400.0 + 400 * sun, sun > 0, 0.3 * sun], axis=1)[:, :, None]
    genes = 12
    inputs: dict[str, dict[str, NDArray[Any]]] = {
        "simulator": {
            "climate": climate,
            "growth": np.array([[2.5, 3.0], [80.0, 120.0], [0.5, 1.0]]),
            "harvest": np.array([[0.0, 3.0]]),
            "equipment": np.zeros((len(EQUIPMENT), batch)),
            "weather": columns(blocks.weather),
            "clock": columns(CLOCK),
            "day": np.full((hours, 1), 30.0),
            "setpoints": np.tile(setpoints, (1, 1, batch)),
            "parameters": parameters(blocks.parameters),
        },
        "hindcast": {
            "climate": climate,
            "inputs": np.tile(columns(blocks.climate.inputs), (1, 1, batch)),
            "measured": np.tile(climate, (hours, 1, 1)),
            "follow": (hour < 4).astype(np.float64)[:, None],
            "day": np.full((hours, 1), 30.0),
            "seconds": np.array([300.0]),
            "parameters": parameters(blocks.climate.parameters),
        },
        "optimizer": optimizer_inputs(settings, genes, random),
    }
    return {
        graph: {name: np.ascontiguousarray(array, dtype=np.float32) for name, array in tensors.items()}
        for graph, tensors in inputs.items()
    }


def optimizer_inputs(
    settings: EvolutionSettings, genes: int, random: np.random.Generator
) -> dict[str, NDArray[np.float32]]:
    """Return random inputs of the optimizer's graph for the self-test."""

    def population(count: int) -> NDArray[np.float32]:
        return random.random((count, genes), dtype=np.float32)

    return {
        "parents": population(settings.parents),
        "parent_fitness": random.random(settings.parents, dtype=np.float32),
        "offspring": population(settings.offspring),
        "offspring_fitness": random.random(settings.offspring, dtype=np.float32),
        **draw(random, settings, genes),
        **fixed_inputs(settings, genes),
    }
