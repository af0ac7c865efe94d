"""The daemon's file: its errors have a place, its parts fit together, limits fit their registers."""

from pathlib import Path

import numpy as np
import pytest
from daemon_bench import MAP, write_files
from hypothesis import given
from hypothesis import strategies as st

from igrow.core.errors import IgrowError
from igrow.core.site import SetpointLimits
from igrow.core.yaml_schema import parse
from igrow.edge.configuration import ConfigurationError, DaemonFile, load_configuration
from igrow.edge.guard.rules import GuardRuleError
from igrow.edge.point_rules import point_rule
from igrow.edge.registers.codec import decode, encode
from igrow.edge.registers.loading import parse_register_map
from igrow.edge.registers.model import DataType, Function, Point

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
    ],
)
def test_an_interlock_that_makes_no_sense_is_refused_with_its_place(tmp_path, release, bound, message):
    path = write_files(tmp_path, 5020)
    path.write_text(path.read_text() + INTERLOCK % (release, bound))
    with pytest.raises(IgrowError) as error:
        load_configuration(path)
    assert message in str(error.value)
    assert "daemon.yaml:13:" in str(error.value)


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
