"""Numbers beside what is usual, for and against, on the screen of a phone."""

from dataclasses import replace

import pytest

from alert_support import DISAGREE, SLOW
from gliderwatch.alerts.evidence import how_sure, weigh
from gliderwatch.alerts.usual import WORDINGS, usual
from gliderwatch.estimation.baseline import QUANTITIES, Baseline, learn, told
from gliderwatch.model import Assessment, DiveFeatures, Kind
from gliderwatch.navigation.features import evidence

HEALTHY = {
    "duration": 3.0 * 3600,
    "roll_mean": 0.01,
    "pitch_dive": -0.45,
    "pitch_climb": 0.44,
    "depth_rate_dive": 0.16,
    "depth_rate_climb": -0.16,
    "ballast_dive": -250e-6,
    "ballast_climb": 240e-6,
    "depth_max": 180.0,
    "yos": 6.0,
    "vacuum": 24e3,
}


def after(**changes: float) -> dict[str, float]:
    """The evidence of a dive after twelve healthy ones."""
    known = Baseline()
    for _ in range(12):
        known = learn(known, DiveFeatures(**HEALTHY))
    dive = DiveFeatures(**HEALTHY | changes)
    return {**evidence(dive), **told(known, dive)}


def slow(**changes: float) -> Assessment:
    return replace(SLOW, evidence=after(**changes), notes=())


def test_each_number_of_the_baseline_has_words() -> None:
    assert {w.name for w in WORDINGS} == {q.name for q in QUANTITIES}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"depth_rate_climb": -0.09}, "climbs at 0.09 m/s, usually 0.14 to 0.18: slower"),
        ({"depth_rate_dive": 0.1}, "dives at 0.10 m/s, usually 0.14 to 0.18: slower"),
        ({"roll_mean": -0.4}, "roll -23 degrees, usually -4 to 5: to the left"),
        ({"pitch_climb": 0.3}, "pitch 17 degrees climbing, usually 21 to 30: flatter"),
        ({"pitch_dive": -0.6}, "pitch 34 degrees diving, usually 21 to 30: steeper"),
        ({"ballast_climb": 120e-6}, "pumps 120 cc to climb, usually 204 to 276: less"),
        ({"ballast_dive": -120e-6}, "pumps 120 cc to dive, usually 213 to 288: less"),
        ({"vacuum": 15e3}, "vacuum 15.0 kPa, usually 20.0 to 28.0: less"),
        ({"yos": 3.0}, "1.0 yos an hour, usually 1.4 to 2.6: fewer"),
        ({"duration": 5.0 * 3600}, "surfaced after 5.0 h, usually 1.8 to 4.2: later"),
    ],
)
def test_out_of_the_usual_speaks_for_an_anomaly(changes: dict[str, float], words: str) -> None:
    pro, con = weigh(slow(**changes), Kind.ANOMALY)
    assert words in pro
    assert words not in con
    assert words in weigh(replace(DISAGREE, evidence=after(**changes)), Kind.FALSE_ALARM)[1]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({}, "roll 1 degrees, as usual (-4 to 5)"),
        ({}, "climbs at 0.16 m/s, as usual (0.14 to 0.18)"),
        ({"ballast_climb": 400e-6}, "pumps 400 cc to climb, usually 204 to 276: more"),
        ({"duration": 1.2 * 3600, "yos": 2.4}, "surfaced after 1.2 h, usually 1.8 to 4.2: earlier"),
        ({"yos": 12.0}, "4.0 yos an hour, usually 1.4 to 2.6: more"),
    ],
)
def test_the_usual_and_what_a_pilot_chose_speak_against(changes: dict[str, float], words: str) -> None:
    pro, con = weigh(slow(**changes), Kind.ANOMALY)
    assert words in con
    assert words not in pro


def test_a_value_that_rounds_into_its_range_shows_why_it_is_outside() -> None:
    (found,) = (t for t in usual(after(depth_rate_climb=-0.1351)) if t.text.startswith("climbs at"))
    assert found.text == "climbs at 0.135 m/s, usually 0.136 to 0.184: slower"
    (found,) = (t for t in usual(after(depth_rate_climb=-0.1359)) if t.text.startswith("climbs at"))
    assert found.text == "climbs at 0.1359 m/s, usually 0.1360 to 0.1840: slower"


def test_the_further_out_the_earlier() -> None:
    pro, _ = weigh(replace(slow(roll_mean=0.3, depth_rate_climb=-0.13), reason=""), Kind.ANOMALY)
    places = [next(i for i, line in enumerate(pro) if line.startswith(w)) for w in ("roll", "climbs at")]
    assert places == sorted(places)


def test_six_lines_on_each_side() -> None:
    odd = slow(
        roll_mean=0.5,
        depth_rate_climb=-0.05,
        depth_rate_dive=0.05,
        vacuum=1e4,
        yos=1.0,
        duration=6.0 * 3600,
    )
    more = {"speed_before": 0.1, "across_misfit": 0.01, "along_speed": 0.1}
    pro, con = weigh(replace(odd, evidence={**odd.evidence, **more}), Kind.ANOMALY)
    assert len(pro) == 6
    assert len(con) <= 6
    assert all(len(line) < 110 for line in (*pro, *con))


def test_fixed_bounds_only_where_nothing_is_usual() -> None:
    dive = DiveFeatures(3.0 * 3600, roll_mean=0.38, pitch_dive=-0.45, pitch_climb=0.72)
    dive = replace(dive, depth_rate_dive=0.3, depth_rate_climb=-0.15)
    tilted = evidence(dive)
    pro, _ = weigh(replace(SLOW, evidence=tilted, notes=()), Kind.ANOMALY)
    assert sum(line.startswith(("mean roll", "pitch differs", "dives at")) for line in pro) == 3
    known = Baseline()
    for _ in range(6):
        known = learn(known, dive)
    pro, con = weigh(replace(SLOW, evidence={**tilted, **told(known, dive)}, notes=()), Kind.ANOMALY)
    assert not any(line.startswith(("mean roll", "pitch", "dives at")) for line in pro)
    assert "roll 22 degrees, as usual (17 to 26)" in con


def test_the_verdict_of_the_estimator_comes_first() -> None:
    words = "slower through the water than the glider itself believes: a wing may be lost or bent"
    pro, _ = weigh(replace(slow(roll_mean=0.5), reason=words), Kind.ANOMALY)
    assert pro[0] == words
    pro, _ = weigh(replace(DISAGREE, reason="the current is wrong"), Kind.FALSE_ALARM)
    assert pro[0] == "the current is wrong"
    assert weigh(replace(slow(), flag=0, reason="warming up"), Kind.ANOMALY)[0][0] != "warming up"


def test_the_standard_error_of_the_speed_is_told() -> None:
    made = replace(SLOW, evidence={**SLOW.evidence, "speed_sigma": 0.021})
    assert how_sure(made, 1).startswith("0.11 ± 0.02 m/s; first flagged dive")
    assert "±" not in how_sure(SLOW, 1)
    assert "±" not in how_sure(replace(made, speed=None), 1)


@pytest.mark.parametrize(
    ("misfit", "sigma", "wrong"), [(0.06, 0.01, True), (0.06, 0.02, False), (0.04, 0.001, False)]
)
def test_a_misfit_counts_beyond_four_standard_errors(misfit: float, sigma: float, wrong: bool) -> None:
    made = replace(SLOW, evidence={"across_misfit": misfit, "across_sigma": sigma})
    assert any("the track misses" in line for line in weigh(made, Kind.ANOMALY)[1]) is wrong


def test_not_a_number_is_left_out() -> None:
    evidence = dict.fromkeys(after(), float("nan"))
    assert usual(evidence) == []
