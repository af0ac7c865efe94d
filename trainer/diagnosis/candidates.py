"""The candidates of a diagnosis: every effect of the catalogue at every shape worth trying."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from igrow.core.effects import EFFECTS, Effect
from igrow.core.effects.definition import Parameter
from igrow.core.quantities import WEATHER
from igrow.trainer.diagnosis.linearisation import (
    Floats,
    Linearisation,
    flux_columns,
    is_measured,
    sensor_column,
    unit_fluxes,
)

SHAPE_GRID: Mapping[tuple[str, str], tuple[float, ...]] = {
    ("wind_infiltration", "exponent"): (0.7, 1.0, 1.5, 2.0),
    ("cover_condensation", "cover_share"): (0.2, 0.35, 0.5),
    ("soil_heat_storage", "time_constant"): (2.0, 4.0, 8.0),
    ("pipe_lag", "time_constant"): (10.0, 25.0, 60.0, 120.0),
    ("heating_valve_leak", "threshold"): (3.0,),
    ("vent_wind_asymmetry", "direction"): tuple(45.0 * k for k in range(8)),
    ("vent_backlash", "play"): (1.5, 3.0, 6.0, 10.0),
    ("structure_shade", "azimuth"): (80.0, 105.0, 130.0, 155.0, 180.0, 205.0, 230.0, 255.0, 280.0),
    ("structure_shade", "width"): (12.0, 25.0),
    ("angle_transmission", "exponent"): (1.0, 2.0, 4.0),
    ("deficit_stomata_closure", "threshold"): (0.5, 0.8, 1.2, 1.6),
    ("irrigation_evaporation", "time_constant"): (20.0, 60.0, 150.0),
    ("leaf_area_transpiration", "reference"): (3.0,),
    ("photosynthesis_heat_limit", "threshold"): (23.0, 25.0, 27.0, 29.0),
    ("soil_respiration", "time_constant"): (24.0,),
    ("air_temperature_lag", "time_constant"): (8.0, 15.0, 30.0),
}
"""Shape values tried first; refitting moves them. A shape without a row is tried at three values of its range."""

Shape = Mapping[str, float]


@dataclass(frozen=True)
class Candidate:
    """One effect at one shape."""

    effect: str
    shape: tuple[tuple[str, float], ...]

    @property
    def definition(self) -> Effect:
        """The effect's definition."""
        return EFFECTS[self.effect]

    @property
    def values(self) -> dict[str, float]:
        """Shape values by name."""
        return dict(self.shape)

    @property
    def ages(self) -> bool:
        """The effect grows with the time since it began."""
        return "elapsed_days" in self.definition.drivers


@dataclass(frozen=True)
class CandidateColumns:
    """Sensitivities of the equation errors to the amplitudes of all testable candidates."""

    candidates: tuple[Candidate, ...]
    columns: Floats
    """(c, 3, r, steps)."""
    ageing: Floats
    """The same with ``elapsed_days`` at one (0 for those that do not age): shifts their beginning."""
    untestable: tuple[str, ...]
    """Effects whose drivers the log lacks, or never moves."""


def grid(effect: Effect) -> list[Shape]:
    """Return the shapes at which an effect is tried."""
    axes = [SHAPE_GRID.get((effect.name, shape.name)) or _default_axis(shape) for shape in effect.shapes]
    names = [shape.name for shape in effect.shapes]
    return [dict(zip(names, values, strict=True)) for values in itertools.product(*axes)]


def candidate_columns(line: Linearisation, without: Collection[str] = ()) -> CandidateColumns:
    """Return the sensitivities to all effects but those in `without` and those already active."""
    one = _with_elapsed_one(line)
    effects = [effect for effect in EFFECTS.values() if effect.name not in without and effect.name not in line.effects]
    testable = [effect for effect in effects if not _is_blind(line, effect) and is_measured(line.record, effect)]
    found = [Candidate(effect.name, tuple(shape.items())) for effect in testable for shape in grid(effect)]
    columns = _columns(line, found)
    ageing = np.zeros_like(columns)
    old = [index for index, candidate in enumerate(found) if candidate.ages]
    ageing[old] = _columns(one, [found[index] for index in old])
    moved = [
        index
        for index, column in enumerate(columns)
        if np.isfinite(column).all() and np.any(np.abs(column[line.runs.weight]) > 1e-9)
    ]
    names = {found[index].effect for index in moved}
    return CandidateColumns(
        tuple(found[index] for index in moved),
        columns[moved],
        ageing[moved],
        tuple(effect.name for effect in effects if effect.name not in names),
    )


def _is_blind(line: Linearisation, effect: Effect) -> bool:
    """Tell whether the log lacks a driver for which nothing can stand in.

    An actuator that is not logged counts as equipment that is not there: its effects show nothing. The leaf area is
    estimated where it is not measured, which does for all effects but the one that is about it.
    """
    lacking = set(effect.drivers) & set(line.record.unknown)
    return bool(lacking & set(WEATHER)) or (effect.drivers[0] == "leaf_area_index" and bool(lacking))


def _columns(line: Linearisation, candidates: Sequence[Candidate]) -> Floats:
    columns = np.zeros((len(candidates), 3, len(line.runs.starts), line.runs.steps))
    process = [index for index, one in enumerate(candidates) if one.definition.kind == "process"]
    fluxes = [
        (
            unit_fluxes(line, candidates[index].definition, candidates[index].values),
            0.05 * abs(candidates[index].definition.amplitude.typical),
        )
        for index in process
    ]
    columns[process] = flux_columns(line, fluxes)
    for index, one in enumerate(candidates):
        if one.definition.kind == "sensor":
            columns[index] = sensor_column(line, one.definition, one.values)
    return columns


def _with_elapsed_one(line: Linearisation) -> Linearisation:
    ones = np.ones(len(line.record))
    record = replace(line.record, inputs={**line.record.inputs, "elapsed_days": ones})
    return replace(line, record=record, drivers={**line.drivers, "elapsed_days": ones})


def _default_axis(shape: Parameter) -> tuple[float, ...]:
    return (
        float(0.5 * (shape.low + shape.typical)),
        shape.typical,
        float(0.5 * (shape.high + shape.typical)),
    )
