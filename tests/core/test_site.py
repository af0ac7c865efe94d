"""A site file: what it may say, what it says when it is wrong, and the annotated one in config/."""

from __future__ import annotations

import datetime
import pickle
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from igrow.core.errors import IgrowError
from igrow.core.quantities import QUANTITIES, SETPOINTS, USUAL_SETPOINTS
from igrow.core.site import Screen, Site, load_site
from igrow.core.yaml_schema import SchemaError, parse
from tests.core.yaml_template import dump

GOLDEN = Path(__file__).parent / "golden"
CONFIG = Path(__file__).resolve().parents[2] / "config" / "site.yaml"
SHORT = "name: north\nlatitude: 52.0\nlongitude: 4.5\n"


@pytest.mark.parametrize("folder", sorted(path.name for path in GOLDEN.iterdir()))
def test_a_wrong_site_is_refused_as_written_down(folder: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copy(GOLDEN / folder / "site.yaml", tmp_path)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SchemaError) as caught:
        load_site("site.yaml")
    assert str(caught.value) == (GOLDEN / folder / "expected.txt").read_text().rstrip("\n")


def test_three_lines_describe_a_site() -> None:
    site = parse(SHORT, Site)
    assert site.greenhouse.floor_area == 62.5
    assert site.planning.replan_every == datetime.timedelta(hours=6)


def test_the_annotated_site_says_every_key_and_its_default() -> None:
    site = load_site(CONFIG)
    assert site == Site(site.name, site.latitude, site.longitude, site.time_zone, site.elevation)
    text = CONFIG.read_text()
    assert text.endswith(dump(site))


def test_a_changed_limit_keeps_the_others() -> None:
    limits = parse(f"{SHORT}limits: {{heating_setpoint: {{high: 24}}}}", Site).limits
    assert (limits["heating_setpoint"].low, limits["heating_setpoint"].high) == (12.0, 24.0)
    assert limits["co2_setpoint"].high == 1000.0
    with pytest.raises(IgrowError, match="did you mean heating_setpoint"):
        limits["heating_setpoints"]


def test_the_default_limits_lie_within_the_registry() -> None:
    for name in SETPOINTS:
        limits = parse(SHORT, Site).limits[name]
        assert QUANTITIES[name].low <= limits.low < limits.high <= QUANTITIES[name].high


def test_a_site_without_a_screen_or_lamps_says_null() -> None:
    site = parse(f"{SHORT}greenhouse: {{energy_screen: null, lamps: null, blackout_screen: {{saving: 0.2}}}}", Site)
    assert site.greenhouse.energy_screen is None
    assert site.greenhouse.lamps is None
    assert site.greenhouse.blackout_screen == Screen(saving=0.2, transmissivity=0.02)


@given(
    latitude=st.floats(-90, 90),
    species=st.text(max_size=30).filter(lambda text: text.isprintable()),
    replan=st.integers(30, 20_000).map(lambda minutes: datetime.timedelta(minutes=minutes)),
    peak=st.times().map(lambda time: time.replace(microsecond=0)),
)
def test_a_site_that_is_written_is_read_back(
    latitude: float, species: str, replan: datetime.timedelta, peak: datetime.time
) -> None:
    values = {"latitude": repr(latitude), "longitude": "0", "name": "a"}
    site = parse(
        "\n".join(f"{key}: {value}" for key, value in values.items())
        + f"\nplanning: {{replan_every: {replan.total_seconds():.0f} s}}"
        + f"\nprices: {{electricity: {{peak_start: {peak.isoformat()}}}}}",
        Site,
    )
    site = replace(site, crop=replace(site.crop, species=species))
    assert parse(dump(site), Site) == site


def test_a_site_can_be_sent_to_another_process() -> None:
    site = load_site(CONFIG)
    assert pickle.loads(pickle.dumps(site)) == site


LOW_VENTS = "limits: {ventilation_setpoint: {high: 20, safe: 20}}"


def test_a_humidity_setpoint_is_there_for_sites_that_name_it_alone() -> None:
    four = ("heating_setpoint", "co2_setpoint", "lamp_on", "irrigation_on")
    assert parse(SHORT, Site).setpoints == USUAL_SETPOINTS == four
    site = parse(f"{SHORT}setpoints: [heating_setpoint, humidity_setpoint]", Site)
    assert site.setpoints == ("heating_setpoint", "humidity_setpoint")
    with pytest.raises(IgrowError, match=r"ventilation_setpoint\.high is 20 degC: at least 29 keeps it"):
        parse(f"{SHORT}setpoints: [ventilation_setpoint]\n{LOW_VENTS}", Site)
    assert parse(f"{SHORT}{LOW_VENTS}", Site).limits.ventilation_setpoint.high == 20.0
    with pytest.raises(IgrowError, match=r"humidity_setpoint\.high is 101: 50 to 100 % makes sense"):
        parse(f"{SHORT}limits: {{humidity_setpoint: {{high: 101}}}}", Site)
