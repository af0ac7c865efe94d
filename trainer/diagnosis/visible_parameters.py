"""The parameters of the climate stage that somebody can look at in a greenhouse, and those that change together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files

import yaml

_TABLE = yaml.safe_load(
    files("igrow.trainer.diagnosis").joinpath("visible_parameters.yaml").read_text(encoding="utf-8")
)


@dataclass(frozen=True)
class Visible:
    """A parameter that a grower can look at."""

    title: str
    balances: tuple[str, ...]
    """That it moves."""
    check: str
    """What to look at."""


VISIBLE: Mapping[str, Visible] = {
    name: Visible(title, tuple(balances), _TABLE["checks"][check])
    for name, (title, balances, check) in _TABLE["visible"].items()
}
TOGETHER: Mapping[str, tuple[str, ...]] = {name: tuple(parts) for name, parts in _TABLE["together"].items()}


def members(name: str) -> tuple[str, ...]:
    """Return the parameters behind a name of `VISIBLE`: itself, or those that change together."""
    return TOGETHER.get(name, (name,))
