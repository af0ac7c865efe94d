"""`simulator.onnx`: candidate strategies over whole days, climate -> growth -> yield, from setpoints to outcomes.

An hour is a few steps of the climate stage with the actuation stage in front, then one step of growth; a day ends
with one step of yield. Hours and days are scanned, so that one graph serves every horizon of whole days and every
number of candidates. Everything is float32 and the batch comes last; `ports` tells the shapes.
"""

from igrow.trainer.exporting.plan.blocks import PlanBlocks, plan_blocks
from igrow.trainer.exporting.plan.control import settings
from igrow.trainer.exporting.plan.graph import plan_model, ports
from igrow.trainer.exporting.plan.training_range import RANGED

__all__ = ["RANGED", "PlanBlocks", "plan_blocks", "plan_model", "ports", "settings"]
