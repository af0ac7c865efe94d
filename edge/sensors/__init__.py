"""From raw readings to a process image with quality: range, rate, frozen, missing, implausible pairs."""

from igrow.edge.sensors.builder import ImageBuilder
from igrow.edge.sensors.consequences import CONSEQUENCES, Consequence, usable_for_control, usable_for_planning
from igrow.edge.sensors.contact import RawReading
from igrow.edge.sensors.pairs import TwinSensors
from igrow.edge.sensors.rules import SensorRule, default_rule

__all__ = [
    "CONSEQUENCES",
    "Consequence",
    "ImageBuilder",
    "RawReading",
    "SensorRule",
    "TwinSensors",
    "default_rule",
    "usable_for_control",
    "usable_for_planning",
]
