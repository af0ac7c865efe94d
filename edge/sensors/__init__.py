"""From raw readings to a process image with quality: range, rate, frozen, missing, implausible pairs."""

from edge.sensors.builder import ImageBuilder, RawReading
from edge.sensors.consequences import CONSEQUENCES, Consequence, usable_for_control, usable_for_planning
from edge.sensors.pairs import TwinSensors
from edge.sensors.rules import SensorRule, default_rule

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
