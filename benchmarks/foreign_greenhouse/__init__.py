"""A greenhouse that shares no balance with the project's own: another structure, another computer, another crop.

What a diagnosis was built and tuned beside may flatter it. Nothing that igrow carries is learned from this one. It
differs where models of greenhouses do: wind on vents after De Jong (1990), transpiration after Stanghellini (1987), a
canopy's photosynthesis as a saturating exponential of light (Acock et al. 1978), a cover whose transmission hangs on
the height of the sun, pipes that give heat by the power 1.25 of their excess, growth respiration that follows the
day's light, a sensor box that lags; a computer with dead bands, a moisture deficit for its vents, a minimum pipe in the
morning, CO2 that is dosed or not.

    control -> light -> crop -> climate, every half minute; sensors, disturbances and a row of the log every five

Hidden effects, sensors' noise, disturbances and weather are those of `igrow.core.greenhouse`.
"""

from benchmarks.foreign_greenhouse.plant import ForeignGreenhouse, State, begun
from benchmarks.foreign_greenhouse.run import simulate

__all__ = ["ForeignGreenhouse", "State", "begun", "simulate"]
