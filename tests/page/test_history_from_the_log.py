"""The log of a month becomes some hundred points, read in pieces and read once."""

from __future__ import annotations

import numpy as np
import pytest

from igrow.core.telemetry import Telemetry
from igrow.edge.page.history import PIECE, SPANS, History, reduce
from igrow.edge.store import StoreError, read_telemetry
from tests.page.page_bench import NOW, fill_log


def log(start: float, end: float, step: float = 60.0) -> Telemetry:
    time = np.arange(start, end, step)
    return Telemetry(time.astype(np.int64).astype("datetime64[s]"), {"air_temperature": np.sin(time / 4000.0)})


class Reader:
    """A log in memory that counts how often it is read."""

    def __init__(self) -> None:
        self.read: list[float] = []
        self.fails = False

    def __call__(self, _folder, start: float, end: float) -> Telemetry:
        if self.fails:
            raise StoreError("the log cannot be read")
        self.read.append(start)
        return log(start, min(end, NOW))


def test_least_mean_and_greatest_are_those_of_the_rows_in_each_bucket():
    rows = log(0.0, 7200.0)
    course = reduce(rows, 1800)["air_temperature"]
    values = rows["air_temperature"].reshape(4, 30)
    assert course.time.tolist() == [900.0, 2700.0, 4500.0, 6300.0]
    np.testing.assert_allclose(course.low, values.min(axis=1))
    np.testing.assert_allclose(course.mean, values.mean(axis=1))
    np.testing.assert_allclose(course.high, values.max(axis=1))


def test_missing_values_are_left_out_and_a_bucket_of_them_is_none():
    time = (np.arange(6) * 600).astype("datetime64[s]")
    course = reduce(Telemetry(time, {"air_co2": np.array([1.0, np.nan, 3.0, np.nan, np.nan, np.nan])}), 1800)["air_co2"]
    assert (course.time.tolist(), course.mean.tolist()) == ([900.0], [2.0])
    assert reduce(Telemetry(time, {"air_co2": np.full(6, np.nan)}), 1800) == {}
    assert reduce(Telemetry(time[:0], {}), 1800) == {}


@pytest.mark.parametrize("span", SPANS.values(), ids=SPANS)
def test_a_span_has_some_hundred_points_and_ends_now(tmp_path, span):
    course = History(tmp_path, Reader()).courses(span, NOW)["air_temperature"]
    assert 280 <= len(course.time) <= 370
    assert NOW - span.seconds <= course.time[0]
    assert abs(course.time[-1] - NOW) <= span.bucket
    assert (np.diff(course.time) > 0).all()


def test_what_is_over_is_read_once_and_what_grows_again_and_again(tmp_path):
    reader, clock = Reader(), [0.0]
    history = History(tmp_path, reader, monotonic=lambda: clock[0])
    history.courses(SPANS["month"], NOW)
    first = len(reader.read)
    assert first == 121
    history.courses(SPANS["month"], NOW)
    assert len(reader.read) == first
    clock[0] = 60.0
    history.courses(SPANS["month"], NOW)
    assert set(reader.read[first:]) == {NOW // PIECE * PIECE, NOW // PIECE * PIECE - PIECE} & set(reader.read[first:])
    assert 1 <= len(reader.read) - first <= 2


def test_what_is_remembered_is_bounded(tmp_path):
    reader = Reader()
    history = History(tmp_path, reader, most_pieces=10)
    history.courses(SPANS["week"], NOW)
    assert len(history._pieces) == 10


def test_a_log_that_cannot_be_read_is_tried_again(tmp_path):
    reader = Reader()
    reader.fails = True
    history = History(tmp_path, reader)
    with pytest.raises(StoreError):
        history.courses(SPANS["day"], NOW)
    reader.fails = False
    assert history.courses(SPANS["day"], NOW)


def test_a_real_store_is_read_while_it_is_there_and_none_is_an_error(tmp_path):
    fill_log(tmp_path, days=2.0)
    courses = History(tmp_path / "state" / "store").courses(SPANS["day"], NOW)
    whole = read_telemetry(tmp_path / "state" / "store", NOW - 86_400.0, NOW + 1.0)
    assert abs(courses["air_temperature"].mean.mean() - np.nanmean(whole["air_temperature"])) < 0.05
    with pytest.raises(StoreError):
        History(tmp_path / "nowhere").courses(SPANS["day"], NOW)
