"""The parameters of the climate stage that somebody can look at in a greenhouse, and those that change together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from igrow.core.language import N_

_COVER = N_("compare the light above the cover and below it; look for dirt, shading paint and wet glass")
_GAPS = N_("look for open panes, doors, gaps and vents that do not close, and compare a calm night with a windy one")
_SCREEN = N_("close the screen by day and look for gaps, tears and light at its edges")
_PIPES = N_("feel the pipes along their length; check pump, valve and air in the pipes")
_LAMPS = N_("count the lamps that burn, and compare their power and their light with those of the weeks before")
_VENTS = N_("look whether the vents open as far as the climate computer says")
_DOSING = N_("check the dosing lines and what the CO2 meter counts")
_CROP = N_("look at the crop: leaf area, water, pests and disease")


@dataclass(frozen=True)
class Visible:
    """A parameter that a grower can look at."""

    title: str
    balances: tuple[str, ...]
    """That it moves."""
    check: str
    """What to look at."""


_AIR = ("heat", "vapour", "co2")
VISIBLE: Mapping[str, Visible] = {
    "transmissivity": Visible(N_("light through the cover"), ("light", "heat"), _COVER),
    "cover_heat_transfer": Visible(N_("heat that the cover loses"), ("heat",), _GAPS),
    "leakage_still": Visible(N_("air that leaks in calm weather"), _AIR, _GAPS),
    "leakage_wind": Visible(N_("air that leaks in with the wind"), _AIR, _GAPS),
    "energy_screen_saving": Visible(N_("heat that the energy screen saves"), ("heat",), _SCREEN),
    "blackout_screen_saving": Visible(N_("heat that the blackout screen saves"), ("heat",), _SCREEN),
    "rail_pipe_heat_transfer": Visible(N_("heat that the rail pipes give off"), ("heat",), _PIPES),
    "grow_pipe_heat_transfer": Visible(N_("heat that the grow pipes give off"), ("heat",), _PIPES),
    "lamp_heat_share": Visible(N_("heat of the lamps"), ("heat",), _LAMPS),
    "lamp_radiation_share": Visible(N_("light of the lamps"), ("light", "heat"), _LAMPS),
    "vent_wind": Visible(N_("air through the vents in the wind"), _AIR, _VENTS),
    "vent_stack": Visible(N_("air through the vents in calm weather"), _AIR, _VENTS),
    "dosing_share": Visible(N_("CO2 that arrives of what is dosed"), ("co2",), _DOSING),
    "assimilation_maximum": Visible(N_("CO2 that the crop takes up in strong light"), ("co2",), _CROP),
    "assimilation_light": Visible(N_("CO2 that the crop takes up in weak light"), ("co2",), _CROP),
    "respiration": Visible(N_("CO2 that crop and soil give off"), ("co2",), _CROP),
    "transpiration_radiation": Visible(N_("water that the crop transpires in the sun"), ("vapour", "heat"), _CROP),
    "transpiration_deficit": Visible(N_("water that the crop transpires in dry air"), ("vapour", "heat"), _CROP),
    "leakage": Visible(N_("air that leaks in, with and without wind"), _AIR, _GAPS),
    "ventilation": Visible(N_("air through the vents"), _AIR, _VENTS),
    "lamp_output": Visible(N_("light and heat of the lamps"), ("light", "heat"), _LAMPS),
    "transpiration": Visible(N_("water that the crop transpires"), ("vapour", "heat"), _CROP),
}
"""By parameter, or by what moves several together. The others (masses, shares of the model's own) have no name in a
greenhouse."""

TOGETHER: Mapping[str, tuple[str, ...]] = {
    "leakage": ("leakage_still", "leakage_wind"),
    "ventilation": ("vent_wind", "vent_stack"),
    "lamp_output": ("lamp_heat_share", "lamp_radiation_share"),
    "transpiration": ("transpiration_radiation", "transpiration_deficit"),
}
"""Parameters that one thing changes by the same share: vents that open half as far, every second lamp, leaves that
wilt. Of one of them alone a log would ask for more than there can be."""


def members(name: str) -> tuple[str, ...]:
    """Return the parameters behind a name of `VISIBLE`: itself, or those that change together."""
    return TOGETHER.get(name, (name,))
