"""False claims are counted by kind of log and by season, with an interval that says what so many logs can show."""

from __future__ import annotations

from dataclasses import replace

from benchmarks.diagnosis import null_logs
from benchmarks.diagnosis.cases import SEASONS, Case
from benchmarks.diagnosis.false_claims import FOREIGN_SEEDS, SEEDS, line, places, rows
from benchmarks.diagnosis.null_logs import null_cases
from benchmarks.diagnosis.scoring import Outcome
from benchmarks.results import RESULTS

QUIET = Outcome(
    Case("winter-0-0", "nothing", "one", 1), "nothing", (), (),
    relative_size=None, relative_flux=None, covered=None, half_width=None, onset_error=None, deployed=2.0,
    recalibrated=2.0, corrected=2.0, perfect=2.0, expected_gain=None, known_gain=None, seconds=1.0,
)  # fmt: skip


def test_every_verdict_but_nothing_is_a_false_claim() -> None:
    noisy = replace(QUIET, case=replace(QUIET.case, name="spring-0-1", group="noise"))
    told = [replace(noisy, verdict=verdict) for verdict in ("named", "ambiguous", "unexplained")]
    found = {what: (claims, count) for what, claims, count in rows([QUIET, noisy, *told])}
    assert found["all"] == (3, 5)
    assert found["nothing else"] == (0, 1)
    assert found["disturbances twice as large"] == found["spring"] == (3, 4)
    assert found["winter"] == (0, 1)
    assert found["autumn"] == (0, 0)


def test_the_interval_is_as_wide_as_the_logs_are_few() -> None:
    # Of no event in n trials the exact upper end is 1 - 0.05^(1/n).
    assert line("all", 0, 144).split()[-1] == f"{1.0 - 0.05 ** (1 / 144):.3f}"
    assert line("all", 0, 0).split() == ["all", "0", "0"]


def test_no_seed_of_a_place_or_a_log_comes_twice() -> None:
    drawn = [one for foreign in (False, True) for one in places(foreign=foreign, greenhouses=2)]
    assert [one.season for one in drawn] == 3 * [season for season in SEASONS for _ in range(2)]
    assert [one.seed for one in drawn] == [
        first + 1000 * number for first in (*SEEDS, *FOREIGN_SEEDS) for number in range(6)
    ]
    autumn = places(foreign=False, greenhouses=2, seasons=["autumn"])
    assert [one.seed for one in autumn] == [first + more for first in SEEDS for more in (4000, 5000)]
    seeds = [case.seed for one in drawn for own in null_cases(one) for case in own]
    seeds += [greenhouse.seed for one in drawn for greenhouse in one.greenhouses]
    assert len(set(seeds)) == len(seeds)


def test_bounds_are_learned_at_nine_places_of_which_each_has_a_latitude_of_its_own() -> None:
    drawn = null_logs.places()
    latitudes = [{greenhouse.site.latitude for greenhouse in one.greenhouses} for one in drawn]
    assert all(len(one) == 1 for one in latitudes)
    assert len(set.union(*latitudes)) == len(drawn) == 9
    assert [sum(one.season == season for one in drawn) for season in SEASONS] == [3, 3, 3]
    seeds = [case.seed for one in drawn for own in null_cases(one) for case in own]
    seeds += [greenhouse.seed for one in drawn for greenhouse in one.greenhouses]
    assert len(set(seeds)) == len(seeds) == 96 * 4
    judged = {one.seed for foreign in (False, True) for one in places(foreign=foreign, greenhouses=1)}
    assert judged.isdisjoint(one.seed for one in drawn)


def test_pages_say_the_seeds_that_are_drawn() -> None:
    for page, seeds in (("diagnosis-false-claims", SEEDS), ("diagnosis-false-claims-foreign", FOREIGN_SEEDS)):
        assert RESULTS[page].seeds == ", ".join(f"{first} and on" for first in seeds)
