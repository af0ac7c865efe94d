"""What the daemon's file says of limits, interlocks and sensors."""

# ruff: noqa: RUF009 - `setting` makes a dataclass field

from __future__ import annotations

import datetime
from collections.abc import Mapping
from dataclasses import dataclass, replace

from igrow.core.quantities import ACTUATORS, QUANTITIES, SETPOINTS
from igrow.core.site import SetpointLimits
from igrow.core.yaml_scalars import read_number
from igrow.core.yaml_schema import SettingError, setting
from igrow.edge.guard import Bound, Interlock
from igrow.edge.guard.interlocks import SAFE, InterlockError
from igrow.edge.registers.model import SYSTEM_POINTS
from igrow.edge.sensors.rules import SensorRule

_SECOND = datetime.timedelta(seconds=1)
_MINUTE = datetime.timedelta(minutes=1)


@dataclass(frozen=True)
class BoundSettings:
    """What an engaged interlock leaves to a point."""

    low: str | None = setting(default=None, help="smallest value: a number, or safe")
    high: str | None = setting(default=None, help="largest value: a number, or safe")

    def __post_init__(self) -> None:
        for key, text in (("low", self.low), ("high", self.high)):
            try:
                _number_or_safe(text)
            except ValueError:
                raise SettingError(f"{key} is {text}: a number or safe is needed", key) from None
        try:
            self.bound()
        except InterlockError as error:
            raise SettingError(str(error), "low") from None

    def bound(self) -> Bound:
        """Return the guard's bound."""
        return Bound(_number_or_safe(self.low), _number_or_safe(self.high))


def _number_or_safe(text: str | None) -> float | str | None:
    return text if text is None or text == SAFE else read_number(text)


@dataclass(frozen=True)
class InterlockSettings:
    """One interlock; they are listed in order of precedence."""

    name: str = setting(help="short name, for the ledger")
    quantity: str = setting(help="what it watches: a quantity or a system point of the register map")
    release: float = setting(help="lets go when the value is back beyond this")
    bounds: Mapping[str, BoundSettings] = setting(
        keys=(*SETPOINTS, *ACTUATORS), help="what it leaves to each point while engaged"
    )
    above: float | None = setting(default=None, help="engages above this value")
    below: float | None = setting(default=None, help="or engages below this value")
    when_unknown: Mapping[str, BoundSettings] = setting(
        keys=(*SETPOINTS, *ACTUATORS), default_factory=dict, help="bounds while the quantity cannot be believed"
    )
    why: str = setting(default="", help="one line for people")

    def __post_init__(self) -> None:
        known = (*QUANTITIES, *SYSTEM_POINTS)
        if self.quantity not in known:
            raise SettingError(f"quantity is {self.quantity}: a quantity or a system point is needed", "quantity")
        try:
            self.interlock()
        except InterlockError as error:
            raise SettingError(str(error), "release") from None

    def interlock(self) -> Interlock:
        """Return the guard's interlock."""
        return Interlock(
            self.name,
            self.quantity,
            {name: bound.bound() for name, bound in self.bounds.items()},
            self.above,
            self.below,
            self.release,
            {name: bound.bound() for name, bound in self.when_unknown.items()},
            self.why,
        )


@dataclass(frozen=True)
class GuardSettings:
    """What the guard knows beside the site's limits of the setpoints."""

    points: Mapping[str, SetpointLimits] = setting(
        keys=ACTUATORS, default_factory=dict, help="limits of writable points that are no setpoints, such as vents"
    )
    interlocks: tuple[InterlockSettings, ...] | None = setting(
        default=None, help="interlocks in order of precedence; null takes the built-in ones"
    )
    non_volatile_daily_budget: int = setting(
        low=2, high=1000, default=48, help="writes a day to a register that wears out"
    )


@dataclass(frozen=True)
class SensorSettings:
    """How one sensor differs from the table of what sensors do; null keeps the table's value."""

    rate: float | None = setting(low=0, default=None, help="fastest true change per minute, in its unit")
    jump: float | None = setting(low=0, default=None, help="change allowed at once, in its unit")
    frozen_after: datetime.timedelta | None = setting(low=_MINUTE, default=None, help="longest true standstill")
    stale_after: datetime.timedelta | None = setting(low=_SECOND, default=None, help="age that makes it stale")
    missing_after: datetime.timedelta | None = setting(low=_SECOND, default=None, help="age that makes it missing")
    bad_samples: int | None = setting(
        low=1, high=60, default=None, help="bad readings in a row until it counts as bad, good ones until as good again"
    )

    def applied_to(self, rule: SensorRule) -> SensorRule:
        """Return the table's rule with what is given here in its place."""

        def seconds(given: datetime.timedelta | None, otherwise: float) -> float:
            return otherwise if given is None else given.total_seconds()

        return replace(
            rule,
            rate=rule.rate if self.rate is None else self.rate / 60.0,
            jump=rule.jump if self.jump is None else self.jump,
            frozen_after=seconds(self.frozen_after, rule.frozen_after),
            stale_after=seconds(self.stale_after, rule.stale_after),
            missing_after=seconds(self.missing_after, rule.missing_after),
            bad_samples=rule.bad_samples if self.bad_samples is None else self.bad_samples,
        )
