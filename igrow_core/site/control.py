"""How the greenhouse is controlled: what each setpoint may be, and how plans of them are made."""

# ruff: noqa: RUF009 - `setting` makes a dataclass field

from __future__ import annotations

import datetime
from dataclasses import dataclass, fields

from igrow.core.errors import IgrowError
from igrow.core.quantities import QUANTITIES, SETPOINTS
from igrow.core.yaml_scalars import nearest
from igrow.core.yaml_schema import SettingError, setting


@dataclass(frozen=True)
class SetpointLimits:
    """What the guard allows for one setpoint, in the setpoint's unit."""

    low: float = setting(help="smallest value ever written")
    high: float = setting(help="largest value ever written")
    safe: float = setting(help="value written when control stops")
    slew: float | None = setting(low=0, default=None, help="most change per hour, or null")
    dead_band: float = setting(low=0, default=0.0, help="smaller changes are not written")
    minimum_interval: datetime.timedelta = setting(
        low=datetime.timedelta(0),
        high=datetime.timedelta(days=1),
        default=datetime.timedelta(minutes=5),
        help="least time between two writes",
    )

    def __post_init__(self) -> None:
        if self.low > self.high:
            raise SettingError(f"low {self.low:g} is above high {self.high:g}", "low")
        if not self.low <= self.safe <= self.high:
            raise SettingError(f"safe {self.safe:g} is outside low {self.low:g} to high {self.high:g}", "safe")


def _limits(low: float, high: float, safe: float, slew: float | None, dead_band: float, minutes: int) -> SetpointLimits:
    return SetpointLimits(low, high, safe, slew, dead_band, datetime.timedelta(minutes=minutes))


@dataclass(frozen=True)
class Limits:
    """The limits of the setpoints."""

    heating_setpoint: SetpointLimits = setting(
        help="degC", default_factory=lambda: _limits(12.0, 28.0, 18.0, 4.0, 0.1, 5)
    )
    co2_setpoint: SetpointLimits = setting(
        help="ppm", default_factory=lambda: _limits(400.0, 1000.0, 400.0, 600.0, 10.0, 5)
    )
    lamp_on: SetpointLimits = setting(help="fraction", default_factory=lambda: _limits(0.0, 1.0, 0.0, None, 0.05, 30))
    irrigation_on: SetpointLimits = setting(
        help="fraction", default_factory=lambda: _limits(0.0, 1.0, 0.1, None, 0.02, 5)
    )
    # Grey mould (Botrytis) needs leaves that stay wet, or air above some 93 %: from 90 % the vents have to work. Below
    # 70 % they would blow out most of what a crop transpires, and the heat with it.
    humidity_setpoint: SetpointLimits = setting(
        help="%, of a PLC that takes one", default_factory=lambda: _limits(70.0, 90.0, 85.0, 10.0, 0.5, 5)
    )

    # Above every heating setpoint that is allowed, or heat goes out through the vents.
    ventilation_setpoint: SetpointLimits = setting(
        help="degC, of a PLC that takes one", default_factory=lambda: _limits(14.0, 32.0, 24.0, 4.0, 0.1, 5)
    )
    minimum_pipe_setpoint: SetpointLimits = setting(
        help="degC, of a PLC that takes one", default_factory=lambda: _limits(0.0, 60.0, 0.0, 30.0, 1.0, 5)
    )
    energy_screen_setpoint: SetpointLimits = setting(
        help="%, of a PLC that takes one", default_factory=lambda: _limits(0.0, 100.0, 100.0, None, 1.0, 15)
    )

    def __post_init__(self) -> None:
        for field in fields(self):
            limits, quantity = self[field.name], QUANTITIES[field.name]
            for key, value in (("low", limits.low), ("high", limits.high)):
                if not quantity.holds(value):
                    span = f"{quantity.low:g} to {quantity.high:g} {quantity.unit}"
                    raise SettingError(f"{field.name}.{key} is {value:g}: {span} makes sense", field.name, key)

    def __getitem__(self, name: str) -> SetpointLimits:
        """Return the limits of a setpoint by its name."""
        if name not in SETPOINTS:
            raise IgrowError(f"{name} is no setpoint: {nearest(name, SETPOINTS)}")
        limits: SetpointLimits = getattr(self, name)
        return limits


@dataclass(frozen=True)
class Planning:
    """How plans are made and models corrected."""

    replan_every: datetime.timedelta = setting(
        low=datetime.timedelta(minutes=30),
        high=datetime.timedelta(days=14),
        default=datetime.timedelta(hours=6),
        help="pace of the upper level, K1",
    )
    recalibrate_every: datetime.timedelta = setting(
        low=datetime.timedelta(days=1),
        high=datetime.timedelta(days=365),
        default=datetime.timedelta(days=7),
        help="pace of the lower level, K2",
    )
    horizon: datetime.timedelta = setting(
        low=datetime.timedelta(days=1),
        high=datetime.timedelta(days=14),
        default=datetime.timedelta(days=2),
        help="how far a plan looks ahead, in whole days",
    )
    optimise: tuple[str, ...] = setting(
        default=("heating_setpoint", "co2_setpoint", "lamp_on"),
        help="setpoints that plans choose; the others follow the recipe",
    )
    caution: float = setting(
        low=0, high=5, default=1.0, help="standard deviations of the simulator's doubt taken off a plan's profit"
    )
    discount: float = setting(
        unit="1", low=0, high=1, default=0.2, help="taken off the value of fruit that is not yet ripe"
    )

    def __post_init__(self) -> None:
        for position, name in enumerate(self.optimise):
            if name not in SETPOINTS:
                raise SettingError(f"optimise has {name}: {nearest(name, SETPOINTS)}", "optimise", position)
