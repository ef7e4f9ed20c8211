"""The measures of the score, on gliders made by hand."""

import math
from dataclasses import replace

import pytest

from gliderwatch.params import RuleParams
from gliderwatch.score import summary
from gliderwatch.score.accuracy import speed_scores
from gliderwatch.score.measures import (
    MONTH,
    Detection,
    DiveResult,
    OpenedIncident,
    Record,
    bootstrap,
    detection,
    false_scores,
    fault_scores,
    quantile,
)
from gliderwatch.score.summary import summarise, tables, write

HOUR = 3600.0
ONSET = 120 * HOUR


def dive(k, speed, flag=0, sigma=None, true=0.25):
    return DiveResult(3 * k * HOUR, (3 * k + 2.5) * HOUR, flag, speed, sigma, true, true + 0.02)


def glider(
    fault="remora", openings=(), *, seed=0, size=3.0, sea="calm", speeds=(0.25,) * 80, onset=ONSET, **more
):
    dives = tuple(dive(k, v) for k, v in enumerate(speeds))
    made = Record(
        estimator="adaptive",
        sea=sea,
        fault=fault,
        size=size,
        seed=seed,
        is_real=False,
        start=0.0,
        end=240 * HOUR,
        onset=None if fault == "none" else onset,
        usual=0.25,
        low=0.175,
        high=0.325,
        surfacings=tuple((3 * k + 2.5) * HOUR for k in range(80)),
        dives=dives,
        openings=tuple(openings),
    )
    return replace(made, **more)


def opening(flag, hours, late=0.1):
    return OpenedIncident(flag, hours * HOUR, (hours + late) * HOUR)


def test_the_delay_counts_from_the_onset_to_the_file_that_told():
    # surfacings after 120 h: 122.5, 125.5, 128.5 h
    assert detection(glider(openings=[opening(1, 125.5, late=3.0)])) == Detection(3, pytest.approx(8.5))


def test_only_the_right_flag_after_the_onset_detects():
    assert detection(glider(openings=[opening(1, 119.0, late=2.0), opening(2, 125.5)])) is None
    assert detection(glider("dac_wrong", [opening(2, 125.5), opening(1, 122.5)])).surfacings == 2
    assert detection(glider("strong_current", [opening(1, 125.5)])) is None


def test_a_miss_makes_the_late_quantiles_endless():
    assert quantile([3.0, math.inf, 1.0, 2.0], 0.75) == 3.0
    gliders = [glider(openings=[opening(1, 122.5)], seed=k) for k in range(4)] + [glider(seed=4)]
    in_sea, score = fault_scores(gliders)
    assert (in_sea.sea, score.sea) == ("calm", "")
    assert (score.detected.value, score.surfacings_median, score.surfacings_90) == (0.8, 1.0, math.inf)
    assert 0.2 <= score.detected.low < 0.8 < score.detected.high <= 1.0


def test_the_first_flag_and_the_unexpected_ones():
    score, _ = fault_scores([glider(openings=[opening(2, 122.5), opening(1, 128.5)]), glider(seed=1)])
    assert (score.flag_1, score.flag_2, score.first) == (0.5, 0.5, 0.0)
    assert score.unexpected.value == pytest.approx(1 / (2 * 120 * HOUR / MONTH))


def test_false_messages_are_those_of_healthy_gliders_and_before_the_onset():
    healthy = glider("none", [opening(1, 50.0), opening(2, 130.0)])
    faulty = glider(openings=[opening(1, 50.0), opening(1, 130.0)])
    bigger = replace(faulty, size=5.0)  # the same glider: what it did before the fault counts once
    in_calm, overall = false_scores([healthy, faulty, bigger])
    assert (in_calm.gliders, in_calm.sea, overall.sea) == (2, "calm", "")
    assert in_calm.months == pytest.approx((240 + 120) * HOUR / MONTH)
    assert in_calm.flag_1.value == pytest.approx(2 / in_calm.months)
    assert in_calm.flag_2.value == pytest.approx(1 / in_calm.months)


def test_a_false_incident_that_never_ends_shows_in_the_dives():
    dives = tuple(dive(k, 0.1, flag=int(k >= 20)) for k in range(80))
    score = false_scores([glider("none", [opening(1, 66.0)], dives=dives)])[0]
    assert score.flag_1.value == pytest.approx(1 / score.months)
    assert (score.dives_1, score.dives_2) == (0.75, 0.0)


def test_of_none_seen_the_bound_is_that_of_a_count():
    score = false_scores([glider("none")])[0]
    assert (score.flag_1.value, score.flag_1.high) == (0.0, pytest.approx(3 / score.months))


def test_what_false_messages_alone_would_detect():
    restless = [glider("none", [opening(1, 30.0 * k) for k in range(8)], seed=k) for k in range(2)]
    _, score = fault_scores([*restless, glider(openings=[opening(1, 130.0)], sea="calm")])
    # 16 messages in 2 x 240 + 120 hours, the fault is there for 120
    assert score.chance == pytest.approx(1 - math.exp(-16 * 120 / 600))


def test_a_strong_current_is_no_fault():
    score, _ = fault_scores([glider("strong_current", [opening(1, 130.0)])])
    assert (score.expected, score.detected, score.flag_1) == (None, None, 1.0)
    assert score.unexpected.value == pytest.approx(1 / (120 * HOUR / MONTH))


def test_speed_errors_apart_for_healthy_and_faulty_dives():
    dives = [dive(k, 0.25 + 0.03 * (-1) ** k, sigma=0.02) for k in range(40)]
    dives += [dive(k, 0.15, sigma=0.02, true=0.10) for k in range(40, 80)]
    healthy, faulty = speed_scores([replace(glider(), dives=tuple(dives))])
    assert (healthy.is_faulty, faulty.is_faulty) == (False, True)
    assert (healthy.rms.value, faulty.rms.value) == (pytest.approx(0.03), pytest.approx(0.05))
    assert faulty.rms_believed.value == pytest.approx(0.03)
    assert (healthy.coverage, faulty.coverage) == (1.0, 0.0)


def test_bootstrap_is_the_same_each_time_and_as_wide_as_gliders_differ():
    gliders = [glider(seed=k, usual=float(k)) for k in range(20)]

    def mean(some):
        return sum(g.usual for g in some) / len(some)

    found = bootstrap(gliders, mean)
    assert found == bootstrap(gliders, mean)
    assert found.high - found.low == pytest.approx(2 * 1.96 * 5.77 / math.sqrt(20), rel=0.15)


def test_other_bounds_are_judged_by_the_same_rules():
    speeds = (0.25,) * 40 + (0.20,) * 40
    assert summary.judged(glider(speeds=speeds), 0.7, RuleParams()).openings == ()
    (opened,) = summary.judged(glider(speeds=speeds), 0.9, RuleParams()).openings
    assert (opened.flag, opened.t_surface) == (1, 122.5 * HOUR + 3 * HOUR)  # two dives in a row


def test_the_curve_rises_with_the_bound():
    speeds = (0.25,) * 40 + (0.20,) * 40
    found = {p.lower: p for p in summary.points([glider(speeds=speeds), glider("none", seed=1)])}
    assert (found[0.7].detected, found[0.9].detected) == (0.0, 1.0)
    assert found[0.9].false == 0.0


def test_a_summary_is_written_and_shown(tmp_path):
    summary = summarise([glider(), glider("none"), glider("strong_current")], "v")
    write(tmp_path / "score.json", summary)
    text = (tmp_path / "score.json").read_text()
    assert '"hours_90": null' in text
    assert len(list(tables(summary))) == 4


def test_faults_are_shown_with_a_column_for_each_sea():
    reported = glider(openings=[OpenedIncident(1, ONSET + 2 * HOUR, ONSET + 3 * HOUR)], sea="rotary")
    seas = [replace(reported, sea=name) for name in ("mixed", "shallow", "deep", "slack", "front")]
    by_sea = [t for t in tables(summarise([reported, glider(), *seas], "v")) if "detected of" in str(t.title)]
    names = [str(column.header) for table in by_sea for column in table.columns]
    assert {"rotary", "calm", "mixed", "shallow", "deep", "slack", "front"} <= set(names)
    cells = {str(c.header): list(c.cells) for table in by_sea for c in table.columns}
    assert cells["rotary"] == ["100% 3 h"]
    assert cells["calm"] == ["0%"]
