"""The daemon's file: its errors have a place, its parts fit together, limits fit their registers."""

import dataclasses
import datetime
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from igrow.core.errors import IgrowError
from igrow.core.quantities import QUANTITIES, SETPOINTS, USUAL_SETPOINTS
from igrow.core.site import SetpointLimits
from igrow.core.yaml_schema import SchemaError, parse, setting
from igrow.edge.configuration import ConfigurationError, load_configuration
from igrow.edge.daemon_file import DaemonFile
from igrow.edge.guard import GuardedWriter
from igrow.edge.guard.rules import GuardRuleError
from igrow.edge.point_rules import highest_beat, point_rule
from igrow.edge.registers.codec import decode, encode
from igrow.edge.registers.loading import parse_register_map
from igrow.edge.registers.model import DataType, Function, Point
from tests.control.daemon_bench import MAP, write_files

ROOT = Path(__file__).resolve().parents[2]


def changed(tmp_path: Path, old: str, new: str) -> Path:
    path = write_files(tmp_path, 5020)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    return path


def test_the_annotated_file_loads_and_shows_the_defaults():
    path = ROOT / "config" / "daemon.yaml"
    configuration = load_configuration(path)
    needed = "site: site.yaml\nregister_map: register-maps/virtual-plc.yaml\n"
    assert configuration.file == parse(needed, DaemonFile)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("status:", "statsu:", "daemon.yaml:5:1: statsu is not known: did you mean status?"),
        ("interval: 5 min", "interval: 5", "daemon.yaml:6:19: cycle.interval"),
        ("interval: 5 min", "interval: 1 h", "daemon.yaml:6:19: cycle.interval"),
        ("clock: lockstep", "clock: plcc", "daemon.yaml:6:33: cycle.clock"),
        ("value: 700}", "value: 70000}", "co2_setpoint is 70000: 300 to 2000 ppm makes sense"),
        ("site: site.yaml", "site: sight.yaml", "daemon.yaml:2:7: there is no file"),
    ],
)
def test_an_error_is_one_line_with_its_place(tmp_path, old, new, message):
    with pytest.raises((IgrowError, OSError)) as error:
        load_configuration(changed(tmp_path, old, new))
    assert message in str(error.value)


def test_a_setpoint_that_the_map_cannot_write_is_named(tmp_path):
    path = write_files(tmp_path, 5020)
    site = tmp_path / "site.yaml"
    site.write_text(site.read_text().replace("[heating_setpoint, co2_setpoint]", "[heating_setpoint, lamp_on]"))
    with pytest.raises(ConfigurationError, match=r"site\.yaml:5:12: .* lamp_on, which the register map has no"):
        load_configuration(path)


def test_lockstep_needs_a_clock_and_a_heartbeat(tmp_path):
    without = "\n".join(line for line in MAP.splitlines() if "heartbeat" not in line)
    with pytest.raises(ConfigurationError, match=r"daemon\.yaml:6:33: .* needs the point heartbeat"):
        load_configuration(write_files(tmp_path, 5020, map_text=without))


def test_limits_that_do_not_fit_the_register_are_refused_where_they_stand(tmp_path):
    narrow = MAP.replace("type: uint16, unit: ppm", "type: uint16, low: 1500, high: 2000, unit: ppm")
    with pytest.raises(ConfigurationError, match=r"site\.yaml:7:17: co2_setpoint: limits 400 to 1000 leave nothing"):
        load_configuration(write_files(tmp_path, 5020, map_text=narrow))


def test_limits_of_a_point_that_cannot_be_written_are_refused_where_they_stand(tmp_path):
    path = write_files(tmp_path, 5020)
    path.write_text(path.read_text() + "guard:\n  points:\n    vent_lee: {low: 0, high: 100, safe: 0}\n")
    with pytest.raises(ConfigurationError, match=r"daemon\.yaml:12:15: the register map cannot write vent_lee"):
        load_configuration(path)


def test_a_cycle_too_fast_for_a_serial_line_is_refused_with_the_numbers(tmp_path):
    line = "{{transport: rtu, serial_port: /dev/ttyUSB0, baudrate: 1200, timeout: 0.5 s}}"
    slow = MAP.replace("{{transport: tcp, host: 127.0.0.1, port: {port}, timeout: 0.5 s}}", line)
    with pytest.raises(ConfigurationError, match=r"daemon\.yaml:6:19: with a cycle each 1 s bus line is busy \d+ %"):
        load_configuration(write_files(tmp_path, 5020, map_text=slow, clock="system", interval="1 s"))
    load_configuration(write_files(tmp_path, 5020, map_text=slow, clock="system", interval="10 s"))


INTERLOCK = """
guard:
  interlocks:
    - {name: storm, quantity: wind_speed, above: 10, release: %s, bounds: {heating_setpoint: {high: %s}}}
"""


def test_interlocks_of_the_file_replace_the_built_in_ones(tmp_path):
    path = write_files(tmp_path, 5020)
    path.write_text(path.read_text() + INTERLOCK % ("8", "safe"))
    (interlock,) = load_configuration(path).guard_rules.interlocks
    assert interlock.bounds["heating_setpoint"].limits(18.0)[1] == 18.0


@pytest.mark.parametrize(
    ("release", "bound", "message"),
    [
        ("12", "safe", "release 12 must be at or under 10"),
        ("8", "wide", "high is wide: a number or safe is needed"),
        ("8", "nan", "high is nan: a number or safe is needed"),
        ("8", "inf", "high is inf: a number or safe is needed"),
        ("8", "-Infinity", "high is -Infinity: a number or safe is needed"),
        ("8", "1e999", "high is 1e999: a number or safe is needed"),
        ("8", "1_5", "high is 1_5: a number or safe is needed"),
        ("8", "20, low: 21", "low is 21: it must not be above high, 20"),
        (".nan", "safe", "release is '.nan'"),
        ("nan", "safe", "release is 'nan'"),
    ],
)
def test_an_interlock_that_makes_no_sense_is_refused_with_its_place(tmp_path, release, bound, message):
    path = write_files(tmp_path, 5020)
    path.write_text(path.read_text() + INTERLOCK % (release, bound))
    with pytest.raises(IgrowError) as error:
        load_configuration(path)
    assert message in str(error.value)
    assert "daemon.yaml:13:" in str(error.value)


@pytest.mark.parametrize(("key", "unit"), [("port", ""), ("number", ""), ("duration", " days")])
@pytest.mark.parametrize("number", ["nan", ".nan", "inf", "-.inf", "1e999", "infinity", "9" * 400, "1_000"])
def test_no_number_of_a_file_is_anything_but_finite(key, unit, number):
    @dataclasses.dataclass(frozen=True)
    class File:
        port: int = setting(default=1, help="a whole number")
        number: float = setting(default=1.0, help="a number")
        duration: datetime.timedelta = setting(default=datetime.timedelta(1), help="a duration")  # noqa: RUF009

    with pytest.raises(SchemaError, match=rf"text:1:\d+: {key} is"):
        parse(f"{key}: {number}{unit}\n", File)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ('type: int16, high: 0, unit: "1"', "cannot count 0, 1"),
        ('type: uint16, low: 10, unit: "1"', "cannot count 0, 1"),
        ('type: uint16, scale: 100, unit: "1"', "cannot count 0, 1"),
    ],
)
def test_a_heartbeat_that_cannot_show_a_change_is_refused(tmp_path, lines, message):
    text = MAP.replace('type: uint16, unit: "1"', lines)
    with pytest.raises(IgrowError, match=r"heartbeat|low is 0") as error:
        load_configuration(write_files(tmp_path, 5020, map_text=text))
    assert message in str(error.value) or "must be less than high" in str(error.value)


def test_the_hint_for_a_heartbeat_of_16_bits_with_a_sign_leads_to_one_that_works(tmp_path):
    text = MAP.replace('address: 3, type: uint16, unit: "1"', 'address: 3, type: int16, unit: "1"')
    with pytest.raises(IgrowError, match="give a `high` that does"):
        load_configuration(write_files(tmp_path, 5020, map_text=text))
    text = MAP.replace('address: 3, type: uint16, unit: "1"', 'address: 3, type: int16, high: 32767, unit: "1"')
    configuration = load_configuration(write_files(tmp_path, 5020, map_text=text))
    assert highest_beat(configuration.register_map.points["heartbeat"]) == 32767


async def test_a_heartbeat_wraps_where_its_register_ends():
    written = []

    class Plc:
        async def write(self, name, value):
            written.append(value)

    writer = GuardedWriter(Plc(), has_heartbeat=True, highest_beat=3)
    writer.beats.was_cleared(2.0)
    for _ in range(6):
        assert await writer.heartbeat() is None
    assert written == [3.0, 1.0, 2.0, 3.0, 1.0, 2.0]


def test_vents_are_the_plcs_own_and_setpoints_are_decided(tmp_path):
    vent = '  vent_lee: {{device: plc, function: holding, address: 9, type: uint16, unit: "%", writable: true}}\n'
    path = write_files(tmp_path, 5020, map_text=MAP + vent)
    path.write_text(path.read_text() + "guard:\n  points:\n    vent_lee: {low: 0, high: 100, safe: 0}\n")
    points = load_configuration(path).guard_rules.points
    assert {name: rule.decided for name, rule in points.items()} == {
        "heating_setpoint": True, "co2_setpoint": True, "vent_lee": False,
    }  # fmt: skip


def test_a_sensor_of_the_file_may_be_believed_bad_sooner_or_later(tmp_path):
    path = write_files(tmp_path, 5020, clock="system", interval="10 s")
    assert load_configuration(path).sensor_rules["air_co2"].bad_samples == 3
    path.write_text(path.read_text() + "sensors:\n  air_co2: {bad_samples: 5}\n")
    rules = load_configuration(path).sensor_rules
    assert (rules["air_co2"].bad_samples, rules["air_temperature"].bad_samples) == (5, 3)


def test_a_register_that_wears_out_gets_the_daily_budget(tmp_path):
    lines = MAP.replace("uint16, unit: ppm, writable: true", "uint16, unit: ppm, writable: true, non_volatile: true")
    configuration = load_configuration(write_files(tmp_path, 5020, map_text=lines))
    assert configuration.guard_rules.points["co2_setpoint"].daily_budget == 48


def test_limits_that_leave_nothing_of_the_register_are_refused():
    limits = SetpointLimits(low=400.0, high=1000.0, safe=400.0)
    text = MAP.format(port=1).replace("type: uint16, unit: ppm", "type: uint16, low: 1500, high: 2000, unit: ppm")
    with pytest.raises(GuardRuleError, match="leave nothing"):
        point_rule(limits, parse_register_map(text).points["co2_setpoint"], 48)


@given(
    low=st.floats(10.0, 20.0),
    width=st.floats(1.0, 15.0),
    kind=st.sampled_from(
        [(DataType.INT16, 0.1), (DataType.UINT16, 0.25), (DataType.INT32, 0.01), (DataType.FLOAT32, 1.0)]
    ),
    fraction=st.floats(0.0, 1.0),
)
def test_no_rounding_of_a_register_ever_leaves_the_limits(low, width, kind, fraction):
    data_type, scale = kind
    high = low + width
    point = Point(
        "heating_setpoint", "plc", Function.HOLDING, 0, data_type, scale=scale, low=5.0, high=40.0, writable=True
    )
    rule = point_rule(SetpointLimits(low=low, high=high, safe=0.5 * (low + high)), point, 48)
    value = rule.low + fraction * (rule.high - rule.low)
    for asked in (rule.low, value, rule.high):
        shown = decode(point, encode(point, asked))
        assert shown is not None
        assert low <= shown <= high
        assert rule.same(shown, asked)
    assert rule.low - low <= scale + np.spacing(np.float32(low))


@pytest.mark.parametrize(("name", "said"), [("site.yaml", "is a site's file"), ("map.yaml", "is a register map")])
def test_a_file_that_the_daemons_file_names_is_told_from_it(tmp_path: Path, name: str, said: str) -> None:
    write_files(tmp_path, 5020)
    with pytest.raises(ConfigurationError, match=f"{name}: {said}: give the daemon's file"):
        load_configuration(tmp_path / name)


DAMP = '  humidity_setpoint: {{device: plc, function: holding, address: 4, type: float32, unit: "%", writable: true}}\n'


def with_humidity(tmp_path: Path, recipe: str = "") -> Path:
    path = write_files(tmp_path, 5020, map_text=MAP + DAMP)
    path.write_text(path.read_text() + recipe)
    site = tmp_path / "site.yaml"
    site.write_text(site.read_text().replace("co2_setpoint]", "co2_setpoint, humidity_setpoint]"))
    return path


def test_a_humidity_setpoint_is_the_plcs_own_until_the_site_names_it(tmp_path):
    configuration = load_configuration(write_files(tmp_path, 5020, map_text=MAP + DAMP))
    assert configuration.setpoints == ("heating_setpoint", "co2_setpoint")
    assert "humidity_setpoint" not in configuration.guard_rules.points
    assert configuration.file.recipe.humidity_setpoint == ()


def test_a_site_that_names_a_humidity_setpoint_has_it_guarded_and_in_its_recipe(tmp_path):
    configuration = load_configuration(with_humidity(tmp_path))
    assert configuration.setpoints[-1] == "humidity_setpoint"
    rule = configuration.guard_rules.points["humidity_setpoint"]
    assert (rule.low, rule.high, rule.safe, rule.decided) == (70.0, 90.0, 85.0, True)
    assert rule.slew == pytest.approx(10.0 / 3600.0)
    (always,) = configuration.file.recipe.humidity_setpoint
    assert always.value == 85.0


def test_every_setpoint_that_not_each_computer_takes_has_a_recipe_once_a_site_names_it(tmp_path):
    others = [name for name in SETPOINTS if name not in USUAL_SETPOINTS]
    points = "".join(
        f"  {name}: {{{{device: plc, function: holding, address: {4 + 2 * place}, type: float32, "
        f'unit: "{QUANTITIES[name].unit}", writable: true}}}}\n'
        for place, name in enumerate(others)
    )
    path = write_files(tmp_path, 5020, map_text=MAP + points)
    site = tmp_path / "site.yaml"
    site.write_text(site.read_text().replace("co2_setpoint]", f"co2_setpoint, {', '.join(others)}]"))
    configuration = load_configuration(path)
    assert configuration.setpoints[2:] == tuple(others)
    for name in others:
        (always,) = configuration.file.recipe.periods(name)
        assert always.value == configuration.site.limits[name].safe
        assert configuration.guard_rules.points[name].safe == always.value


def test_a_recipes_own_humidity_setpoint_is_kept_and_checked(tmp_path):
    own = "  humidity_setpoint: [{at: 00:00, value: %s}]\n"
    (said,) = load_configuration(with_humidity(tmp_path, own % "80")).file.recipe.humidity_setpoint
    assert said.value == 80.0
    with pytest.raises(IgrowError, match="humidity_setpoint is 20: 50 to 100 % makes sense"):
        load_configuration(with_humidity(tmp_path, own % "20"))
