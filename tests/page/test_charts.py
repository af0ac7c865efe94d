"""Charts are drawn as they should be: scale, gaps, steps, what lies ahead, and names for those who do not see them."""

from __future__ import annotations

import re
from xml.etree import ElementTree
from zoneinfo import ZoneInfo

import numpy as np
import pytest

from igrow.core.language import ENGLISH
from igrow.edge.page.svg import (
    Band,
    Frame,
    Limit,
    Line,
    Size,
    Stretch,
    chart,
    spark,
    swatch,
    ticks,
    time_ticks,
    value_range,
)
from igrow.edge.page.words import Words

AMSTERDAM = Words(ENGLISH, ZoneInfo("Europe/Amsterdam"))
T0 = 1_773_500_400.0
FRAME = Frame(T0 - 7200.0, T0 + 7200.0, T0, AMSTERDAM)
SIZE = Size(500, 200)


def line(value, time=None, **more) -> Line:
    value = np.array(value, dtype=np.float64)
    time = T0 - 7200.0 + 600.0 * np.arange(len(value)) if time is None else np.array(time, dtype=np.float64)
    return Line("measured", "measured", time, value, **more)


def drawn(lines, **more) -> ElementTree.Element:
    return ElementTree.fromstring(chart("what it shows", lines, FRAME, SIZE, **more))


def of_class(tree: ElementTree.Element, name: str) -> list[ElementTree.Element]:
    return [one for one in tree.iter() if name in one.get("class", "").split()]


def course_of(tree: ElementTree.Element, name: str) -> str:
    """What the first shape of this class goes along."""
    return of_class(tree, name)[0].attrib["d"]


def corners(path: str) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for x, y in re.findall(r"[ML](-?[\d.]+) (-?[\d.]+)", path)]


def test_a_chart_says_what_it_shows_to_those_who_do_not_see_it():
    tree = drawn([line([1.0, 2.0])])
    assert (tree.get("role"), tree.get("aria-label")) == ("img", "what it shows")


def test_a_greater_value_is_higher_and_a_later_one_farther_right():
    ((x0, y0), (x1, y1)) = corners(course_of(drawn([line([1.0, 2.0])]), "line"))
    assert x1 > x0
    assert y1 < y0


def test_a_gap_in_the_log_is_a_gap_in_the_line():
    path = course_of(drawn([line([1.0, 1.0, 2.0], [T0 - 7000, T0 - 6400, T0 - 1000], gap=1800.0)]), "line")
    assert path.count("M") == 2


def test_a_setpoint_holds_until_the_next():
    points = corners(course_of(drawn([line([1.0, 2.0], stepped=True)]), "line"))
    assert points[0][1] == points[1][1] != points[2][1]
    assert points[1][0] == points[2][0]


def test_least_and_greatest_values_lie_around_the_mean_and_within_the_scale():
    low, high = np.array([0.0, 0.0]), np.array([9.0, 9.0])
    tree = drawn([line([4.0, 5.0], low=low, high=high)])
    ribbon = [y for _, y in corners(course_of(tree, "ribbon"))]
    mean = [y for _, y in corners(course_of(tree, "line"))]
    assert min(ribbon) < min(mean)
    assert max(ribbon) > max(mean)
    assert min(ribbon) >= 0
    assert max(ribbon) <= SIZE.height


def test_what_is_ahead_is_told_apart_only_where_something_is():
    assert of_class(drawn([line([1.0, 2.0])]), "ahead")
    past = Frame(T0 - 7200.0, T0, T0, AMSTERDAM)
    assert 'class="ahead"' not in chart("past", [line([1.0, 2.0])], past, SIZE)


def test_a_limit_is_drawn_where_it_is_near_and_left_out_where_it_is_far():
    near, far = Limit("near", 2.2), Limit("far", 300.0)
    tree = drawn([line([1.0, 2.0])], limits=[near, far])
    assert [one.text for one in of_class(tree, "limit") if one.text] == ["near"]


def test_bands_and_what_stands_in_the_way_are_drawn_and_named():
    band = Band("allowed", np.array([T0 - 7200.0, T0]), np.array([1.0, 2.0]), np.array([3.0, 4.0]))
    tree = drawn([line([1.0, 2.0])], bands=[band], stretches=[Stretch("the night's limit", T0, T0 + 3600.0)])
    assert len(corners(course_of(tree, "band"))) == 8
    (held,) = of_class(tree, "binds")
    assert held[0].text == "the night's limit"


def test_names_from_outside_cannot_become_markup():
    evil = "<script>alert(1)</script>"
    markup = chart(evil, [line([1.0, 2.0])], FRAME, SIZE, limits=[Limit(evil, 1.0)], stretches=[Stretch(evil, T0, T0)])
    assert "<script" not in markup


@pytest.mark.parametrize("value", [[], [5.0], [5.0, 5.0], [-1e9, 1e9], [0.0, 1e-12]])
def test_any_series_makes_a_chart_or_none(value):
    markup = chart("any", [line(value)], FRAME, SIZE)
    assert (markup == "") == (not value)
    assert "nan" not in markup
    assert "inf" not in markup


def test_noise_does_not_fill_the_scale():
    low, high = value_range([line([20.0, 20.1])], [], [], 4.0)
    assert high - low >= 4.0


@pytest.mark.parametrize("ends", [(0.0, 1.0), (12.3, 13.1), (-40.0, 40.0), (400.0, 1000.0), (0.0, 0.001)])
def test_ticks_are_few_and_round(ends):
    marks = ticks(*ends)
    assert 2 <= len(marks) <= 6
    assert all(ends[0] <= mark <= ends[1] for mark in marks)


@pytest.mark.parametrize("days", [2, 8, 31])
def test_times_are_local_over_a_change_of_the_clocks(days):
    # Summer time begins on 29 March 2026.
    start = 1_774_648_800.0
    marks = list(time_ticks(start, start + days * 86_400.0, AMSTERDAM, 12))
    assert 2 <= len(marks) <= 12
    midnights = [time for time, name in marks if ":" not in name]
    assert midnights
    # 23:00 UTC before the change, 22:00 after it
    assert {time % 86_400.0 for time in midnights} <= {82_800.0, 79_200.0}


def test_a_small_line_needs_two_points_and_a_legend_shows_the_line_itself():
    assert spark(np.array([T0]), np.array([1.0])) == ""
    ElementTree.fromstring(spark(np.array([T0, T0 + 60.0]), np.array([1.0, 1.0])))
    assert 'class="line expected"' in swatch("line expected")
