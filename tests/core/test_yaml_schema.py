"""The strict YAML loader: what it reads, and what it says about what it does not."""

# ruff: noqa: RUF009 - `setting` makes a dataclass field

from __future__ import annotations

import datetime
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from igrow.core.yaml_schema import SchemaError, SettingError, load, parse, setting


class Order(Enum):
    BIG = "ABCD"
    LITTLE = "DCBA"


@dataclass(frozen=True)
class Tcp:
    kind: Literal["tcp"] = setting(help="")
    port: int = setting(low=1, high=65535, help="TCP port", default=502)


@dataclass(frozen=True)
class Serial:
    kind: Literal["rtu"] = setting(help="")
    device: str = setting(help="device file")


@dataclass(frozen=True)
class Inner:
    low: float = setting(help="", default=0.0)
    high: float = setting(help="", default=1.0)

    def __post_init__(self) -> None:
        if self.low > self.high:
            raise SettingError(f"low {self.low:g} is above high {self.high:g}", "low")


@dataclass(frozen=True)
class Everything:
    number: float = setting(unit="m2", low=1, high=1e6, help="floor area", default=1.0)
    whole: int = setting(help="", default=0)
    flag: bool = setting(help="", default=False)
    text: str = setting(help="", default="")
    order: Order = setting(help="", default=Order.BIG)
    mode: Literal["fast", "slow"] = setting(help="", default="fast")
    clock: datetime.time = setting(help="", default=datetime.time(0))
    day: datetime.date | None = setting(help="", default=None)
    moment: datetime.datetime | None = setting(help="", default=None)
    every: datetime.timedelta = setting(
        help="",
        low=datetime.timedelta(seconds=1),
        high=datetime.timedelta(days=1),
        default=datetime.timedelta(hours=1),
    )
    values: tuple[float, ...] = setting(low=0, help="", default=())
    inner: Inner = setting(help="", default_factory=Inner)
    named: Mapping[str, Inner] = setting(help="", keys=("air_temperature", "air_co2"), default_factory=dict)
    bus: Tcp | Serial | None = setting(help="", default=None)


def read(text: str) -> Everything:
    return parse(text, Everything, "f.yaml")


def refusal(text: str, schema: type[Any] = Everything) -> str:
    with pytest.raises(SchemaError) as caught:
        parse(text, schema, "f.yaml")
    return str(caught.value)


@pytest.mark.parametrize(
    ("text", "key", "value"),
    [
        ("number: 1e3", "number", 1000.0),
        ("number: 12", "number", 12.0),
        ("whole: 0x170", "whole", 0x170),
        ("whole: 1e3", "whole", 1000),
        ("whole: -0", "whole", 0),
        ("text: on", "text", "on"),
        ("text: NO", "text", "NO"),
        ("text: 12:30", "text", "12:30"),
        ("text: 0123", "text", "0123"),
        ("text: ''", "text", ""),
        ("clock: 12:30", "clock", datetime.time(12, 30)),
        ("clock: 7:05:09", "clock", datetime.time(7, 5, 9)),
        ("flag: true", "flag", True),
        ("order: DCBA", "order", Order.LITTLE),
        ("mode: slow", "mode", "slow"),
        ("day: 2020-02-29", "day", datetime.date(2020, 2, 29)),
        ("day: null", "day", None),
        ("day:", "day", None),
        ("moment: 2020-01-31T12:30:00Z", "moment", datetime.datetime(2020, 1, 31, 12, 30, tzinfo=datetime.UTC)),
        ("every: 5 min", "every", datetime.timedelta(minutes=5)),
        ("every: 0.5h", "every", datetime.timedelta(minutes=30)),
        ("values: [1, 2.5]", "values", (1.0, 2.5)),
        ("inner: {high: 3}", "inner", Inner(0.0, 3.0)),
        ("named:\n  air_co2: {low: 0.5}", "named", {"air_co2": Inner(0.5, 1.0)}),
        ("bus: {kind: tcp}", "bus", Tcp("tcp", 502)),
        ("bus: {kind: rtu, device: /dev/ttyS0}", "bus", Serial("rtu", "/dev/ttyS0")),
    ],
)
def test_a_scalar_is_read_by_the_type_of_its_field(text: str, key: str, value: object) -> None:
    assert getattr(read(text), key) == value


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("numbr: 3", "f.yaml:1:1: numbr is not known: did you mean number?"),
        ("number: 3\nnumber: 4", "f.yaml:2:1: number stands twice: remove it here or in line 1"),
        ("number: 0", "f.yaml:1:9: number is 0: a number in m2 from 1 to 1e+06 is needed"),
        ("number: 0123", "f.yaml:1:9: number is '0123': a number does not begin with 0; write it without"),
        ("number: .inf", "f.yaml:1:9: number is '.inf': a number in m2 from 1 to 1e+06 is needed"),
        ("number: 1e999", "f.yaml:1:9: number is '1e999': the number is too large"),
        ("number: 1_000", "f.yaml:1:9: number is '1_000': a number in m2 from 1 to 1e+06 is needed"),
        ("number: '5'", "f.yaml:1:9: number is the text '5': write it without quotes"),
        ("number:", "f.yaml:1:8: number is empty: a number in m2 from 1 to 1e+06 is needed"),
        ("number: [1]", "f.yaml:1:9: number is a list: a number in m2 from 1 to 1e+06 is needed"),
        ("whole: 1.5", "f.yaml:1:8: whole is '1.5': a whole number is needed"),
        ("flag: on", "f.yaml:1:7: flag is 'on': true or false is needed"),
        ("order: ABCDE", "f.yaml:1:8: order is 'ABCDE': did you mean ABCD?"),
        ("mode: quick", "f.yaml:1:7: mode is 'quick': known here: fast, slow"),
        ("clock: 24:00", "f.yaml:1:8: clock is '24:00': a time of day from 00:00 to 23:59 is needed"),
        ("day: 2021-02-29", "f.yaml:1:6: day is '2021-02-29': there is no such day"),
        ("every: 300", "f.yaml:1:8: every is '300': a duration such as 30 s, 5 min, 1 h or 2 days from 1 s to 1 day"),
        ("every: 2 days", "f.yaml:1:8: every is 2 days: a duration"),
        ("values:\n  - 1\n  - -1", "f.yaml:3:5: values[1] is -1: a number of at least 0 is needed"),
        ("values: 3", "f.yaml:1:9: values must be a list"),
        ("inner: {low: 3}", "f.yaml:1:14: low 3 is above high 1"),
        ("named: {air_temp: {}}", "f.yaml:1:9: named.air_temp is not known: did you mean air_temperature?"),
        ("bus: {port: 3}", "f.yaml:1:6: bus.kind is missing: add `kind:` with one of tcp, rtu"),
        ("bus: {kind: tpc}", "f.yaml:1:13: bus.kind is 'tpc': did you mean tcp?"),
        ("bus: {kind: rtu}", "f.yaml:1:6: bus.device is missing: add `device:` with a text (device file)"),
        ("text: !!python/name:os.system ''", "f.yaml:1:7: the tag"),
        ("text: !secret x", "f.yaml:1:7: the tag !secret is not allowed: write the plain value"),
        ("a: &a {low: 1}\ninner:\n  <<: *a", "f.yaml:1:1: a is not known"),
        ("inner:\n  <<: {low: 1}", "f.yaml:2:3: inner.<< is not known"),
        ("number: {", "f.yaml:1:10: not valid YAML"),
        ("number: 1\n---\nnumber: 2", "f.yaml:2:1: not valid YAML"),
        ("\tnumber: 1", "f.yaml:1:1: not valid YAML"),
        ("- 1", "f.yaml:1:1: the file must be a mapping"),
        ("[a]: 1", "f.yaml:1:1: a key must be a plain name"),
    ],
)
def test_an_error_says_where_what_and_what_would_be_right(text: str, message: str) -> None:
    found = refusal(text)
    assert found.startswith(message)
    assert "\n" not in found


@dataclass(frozen=True)
class Outer:
    inner: Inner = setting(help="", default_factory=lambda: Inner(2.0, 5.0))
    named: Mapping[str, Inner] = setting(help="", default_factory=lambda: {"a": Inner(3.0, 4.0)})
    maybe: Inner | None = setting(help="", default_factory=lambda: Inner(6.0, 7.0))


def test_a_mapping_changes_only_the_keys_it_names() -> None:
    assert parse("inner: {high: 9}", Outer).inner == Inner(2.0, 9.0)
    assert parse("named: {a: {high: 9}, b: {}}", Outer).named == {"a": Inner(3.0, 9.0), "b": Inner(0.0, 1.0)}
    assert parse("maybe: {high: 9}", Outer).maybe == Inner(6.0, 9.0)
    assert parse("maybe: null", Outer).maybe is None


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(SchemaError, match="cannot be read: No such file"):
        load(tmp_path / "none.yaml", Everything)
    (tmp_path / "latin.yaml").write_bytes(b"text: \xe9")
    with pytest.raises(SchemaError, match="not UTF-8"):
        load(tmp_path / "latin.yaml", Everything)


def test_an_empty_file_is_told_what_it_needs() -> None:
    assert refusal("", Serial) == "f.yaml:1:1: the file is empty: it needs kind, device"


def test_an_alias_that_contains_itself_is_refused() -> None:
    assert "is a list" in refusal("values: &a [*a]")


@given(st.text(max_size=40))
def test_any_text_is_read_or_refused_in_one_line(text: str) -> None:
    try:
        read(text)
    except SchemaError as error:
        assert "\n" not in str(error)


@given(st.floats(1, 1e6))
def test_every_number_as_python_prints_it_is_read_back(value: float) -> None:
    assert read(f"number: {value!r}").number == value
