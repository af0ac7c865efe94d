# ruff: noqa: RUF009 - `setting` makes a dataclass field, as `dataclasses.field` does
"""How a unit's identity is written in the file of a register map: registers that no other unit shows so."""

from __future__ import annotations

from dataclasses import dataclass

from igrow.core.yaml_schema import SettingError, setting
from igrow.edge.registers.model import Function, Identity

LONGEST = 32
"""Registers: a serial number in letters fits."""


@dataclass(frozen=True)
class IdentitySettings:
    """Where the unit says who it is, and what it shows there."""

    function: Function = setting(help="table: holding or input")
    address: int = setting(help="first address as sent, counted from 0", low=0, high=65535)
    content: tuple[int, ...] = setting(help="what its registers show, each as a number", low=0, high=65535)

    def __post_init__(self) -> None:
        if self.function.holds_bits:
            what = f"{self.function.value} holds bits, which many units show alike: holding or input is right"
            raise SettingError(what, "function")
        if not 1 <= len(self.content) <= LONGEST or not any(self.content):
            what = f"1 to {LONGEST} numbers are right, and not zeros alone, which any unit may show"
            raise SettingError(what, "content")
        if self.identity.end > 65536:
            raise SettingError(f"{len(self.content)} registers reach past the last address, 65535", "address")

    @property
    def identity(self) -> Identity:
        """What it means."""
        return Identity(self.function, self.address, self.content)
