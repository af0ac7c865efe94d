"""All that the planning graph calls, traced."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from igrow.core.quantities import USUAL_SETPOINTS, WEATHER
from igrow.core.simulator.crop import GROWTH_DRIVERS, HARVEST_DRIVERS, CropStages
from igrow.trainer.exporting.blocks import Block
from igrow.trainer.exporting.climate import ClimateBlocks
from igrow.trainer.exporting.plan.control import control_block, equipment_block, settings
from igrow.trainer.exporting.plan.crop import crop_block, net_growth_block
from igrow.trainer.exporting.plan.training_range import range_block


@dataclass(frozen=True)
class PlanBlocks:
    """All blocks of the planning graph."""

    climate: ClimateBlocks
    weather: tuple[str, ...]
    """Columns of the graph's input `weather`."""
    setpoints: tuple[str, ...]
    """Columns of the graph's input `setpoints`."""
    parameters: tuple[str, ...]
    """Rows of the graph's input `parameters`."""
    equipment: Block
    control: Block
    growth: Block
    net_growth: Block
    harvest: Block
    range: Block

    @property
    def blocks(self) -> list[Block]:
        """Every block, for the model's list of functions."""
        return [*self.climate.blocks, *(one for one in vars(self).values() if isinstance(one, Block))]


def plan_blocks(
    stage: ClimateBlocks,
    crop: CropStages,
    known: Mapping[str, tuple[float, float]],
    setpoints: tuple[str, ...] = USUAL_SETPOINTS,
) -> PlanBlocks:
    """Trace what planning needs beside the climate stage.

    Args:
        stage: the climate stage with its active effects.
        crop: growth and yield.
        known: smallest and largest value of quantities in the training data.
        setpoints: that the climate computer answers to, in the registry's order.
    """
    weather = tuple(name for name in WEATHER if name in stage.inputs)
    return PlanBlocks(
        climate=stage,
        weather=weather,
        setpoints=setpoints,
        parameters=(*stage.parameters, *settings(setpoints)),
        equipment=equipment_block(weather, setpoints),
        control=control_block(stage, setpoints),
        growth=crop_block("growth", crop.growth, GROWTH_DRIVERS),
        net_growth=net_growth_block(crop),
        harvest=crop_block("harvest", crop.harvest, HARVEST_DRIVERS),
        range=range_block(known),
    )
