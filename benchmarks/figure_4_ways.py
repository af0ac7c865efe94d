"""What leads the season of `benchmarks.figure_4`, and the jobs that it is made of."""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import torch

from benchmarks.onnx_policy import OnnxPolicy
from benchmarks.season_greenhouses import DAY, HOUR, START, Greenhouses, Led, Morning, Recipe, Way, lead
from benchmarks.seasons import described, season_of, ways_of
from benchmarks.simulated_greenhouses import SimulatedGreenhouses
from igrow.core.arrays import Floats
from igrow.core.bundle import default_bundle_folder, read_bundle
from igrow.core.gaps import held
from igrow.core.greenhouse import tomato
from igrow.core.planner.evolution import Genes
from igrow.core.planner.season.search import GENERATIONS, rule_and_strategy
from igrow.core.quantities import SETPOINTS, USUAL_SETPOINTS
from igrow.core.simulator.plan import BundleSimulator
from igrow.core.site import Site
from igrow.core.telemetry import to_grid
from igrow.trainer.data.public import agc2019
from igrow.trainer.research.paper.compartments import read_2019
from igrow.trainer.research.policies.policy import chosen, observe, to_setpoints
from igrow.trainer.research.policies.train import export, train

DAYS = 119
"""From the season's first day to the last whole one of which the growers' setpoints are published."""
HEATING, LAMPS, IRRIGATION = (SETPOINTS.index(name) for name in ("heating_setpoint", "lamp_on", "irrigation_on"))
SIMULATED, GROWN = "in our simulator", "in the plant"


@dataclass(frozen=True)
class Published(Recipe):
    """Setpoints that somebody had, day by day."""

    setpoints: Floats
    """(DAYS, 24, S); NaN where the recipe's count."""

    def ask(self, morning: Morning) -> Floats:
        """Return the day's for each greenhouse."""
        said = self.setpoints[morning.day]
        return np.repeat(np.where(np.isfinite(said), said, morning.recipe)[None], len(morning.weather), axis=0)


@dataclass(frozen=True)
class Policed(Recipe):
    """A policy, which sees the weather that is expected, the air and the crop."""

    site: Site
    policy: OnnxPolicy

    def ask(self, morning: Morning) -> Floats:
        """Return what it says of each greenhouse's day."""
        seen = observe(self.site, morning.present, morning.weather, morning.begin)
        return chosen(self.site, to_setpoints(self.site, self.policy.act(seen)), morning.recipe)


def growers(folder: Path) -> Floats:
    """Return the realised setpoints of the Reference, (DAYS, 24, S); NaN are irrigation and what it had none of."""
    log = agc2019.read(folder, "Reference").telemetry
    hourly = to_grid(log.select(START, START + DAYS * DAY), 3600)
    if len(hourly) != 24 * DAYS:
        raise SystemExit(f"{folder}: {len(hourly)} hours of the growers' setpoints, not {24 * DAYS}")
    setpoints = np.full((DAYS, 24, len(SETPOINTS)), np.nan)
    for name in USUAL_SETPOINTS:
        setpoints[:, :, SETPOINTS.index(name)] = held(hourly[name]).reshape(DAYS, 24)
    setpoints[:, :, LAMPS] = np.round(setpoints[:, :, LAMPS])
    setpoints[:, :, IRRIGATION] = np.nan
    return setpoints


def champion(folder: Path) -> Floats:
    """Return the growers' setpoints with the heating shifted by the difference of the slabs, (DAYS, 24, S)."""
    crops = {one.name: one for one in read_2019(folder)}
    warmer = crops["Automatoes"].drivers["temperature"] - crops["Reference"].drivers["temperature"]
    # The season's first local day begins within an hour of its UTC day's end.
    first = int(((START + HOUR).astype("datetime64[D]") - crops["Reference"].day[0]).astype(int))
    setpoints = growers(folder)
    setpoints[:, :, HEATING] += warmer[first : first + DAYS, None]
    return setpoints


@dataclass(frozen=True)
class Tuning:
    """What the genetic algorithm found."""

    genes: dict[str, Genes]
    seconds: float
    """Of the processor."""


@dataclass(frozen=True)
class Learning:
    """What soft actor-critic learnt."""

    policy: bytes
    """policy.onnx."""
    days: int
    course: list[float]
    """EUR m-2 a day more than the recipe while it explored, by sixths of the training."""
    seconds: float
    """Of the processor."""


def simulator_of(site: Site) -> BundleSimulator:
    """Return the built-in bundle's simulator."""
    return BundleSimulator(read_bundle(default_bundle_folder()), site.greenhouse, members=1)


def prepare(minutes: float) -> Tuning | Learning:
    """Return a policy that learnt for so many minutes; for none what the genetic algorithm finds."""
    site, kinds = described("today", DAYS), ways_of(DAYS)
    if not minutes:
        season, began = season_of(site, DAYS), time.process_time()
        crop = tomato.mature_crop(season.plant, 1.0)
        found = rule_and_strategy(season, kinds["rule"], kinds["season"], crop, GENERATIONS)
        return Tuning({name: genes for name, (genes, _) in found.items()}, time.process_time() - began)
    torch.set_num_threads(1)
    learnt = train(site, simulator_of(site), 60.0 * minutes)
    course = [float(part.mean()) for part in np.array_split(np.array(learnt.gains), 6) if part.size]
    return Learning(export(learnt.actor).SerializeToString(), learnt.days, course, learnt.seconds)


@dataclass(frozen=True)
class World:
    """Where all lead their greenhouses."""

    where: str
    tuning: Tuning
    learning: Learning
    greenhouses: int
    data: Path


def led(world: World) -> dict[str, dict[str, Floats]]:
    """Return what the greenhouses of each way used and picked by day."""
    site, kinds = described("today", DAYS), ways_of(DAYS)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "policy.onnx"
        path.write_bytes(world.learning.policy)
        policy = OnnxPolicy(path)
    ways: dict[str, Way] = {
        "recipe": Recipe(),
        "growers": Published(growers(world.data)),
        "champion": Published(champion(world.data)),
        **{name: Led(kinds[name], genes[None]) for name, genes in world.tuning.genes.items()},
        "SAC": Policed(site, policy),
    }
    stood = partial(SimulatedGreenhouses, site, simulator_of(site)) if world.where == SIMULATED else Greenhouses
    return lead(site, DAYS, ways, {name: list(range(world.greenhouses)) for name in ways}, stood)[0]
