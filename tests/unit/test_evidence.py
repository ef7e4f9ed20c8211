"""Numbers beside what is usual, for and against, on the screen of a phone."""

from dataclasses import replace

import pytest

from alert_support import DISAGREE, SLOW
from gliderwatch.estimation.healthy_baseline import QUANTITIES, Baseline, evidence_of, learn
from gliderwatch.messages.baseline import WORDINGS, usual
from gliderwatch.messages.causes import DRAG, FLOW, HEAVY, TRIM, WING, Cause, likeliest
from gliderwatch.messages.evidence import LINES, weigh
from gliderwatch.model import Assessment, DiveFeatures, Kind
from gliderwatch.navigation.dives import COMMANDED_USED, COURSE_ASSUMED
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
    return {**evidence(dive), **evidence_of(known, dive)}


def slow(**changes: float) -> Assessment:
    return replace(SLOW, evidence=after(**changes), notes=())


@pytest.mark.parametrize("note", [COMMANDED_USED, COURSE_ASSUMED])
def test_where_no_heading_was_seen_a_glider_that_circles_is_named(note: str) -> None:
    words = "its heading is not in the file: a glider that circles looks like a slow one"
    assert words in weigh(replace(slow(roll_mean=-0.4), notes=(note,)), Kind.ANOMALY, WING)[1]
    assert words not in weigh(slow(roll_mean=-0.4), Kind.ANOMALY, WING)[1]


def test_each_number_of_the_baseline_has_words() -> None:
    assert {w.name for w in WORDINGS} == {q.name for q in QUANTITIES}


@pytest.mark.parametrize(
    ("changes", "cause", "words"),
    [
        ({"depth_rate_climb": -0.09}, HEAVY, "climbs at 0.09 m/s, usually 0.14 to 0.18: slower"),
        ({"depth_rate_dive": 0.1}, DRAG, "dives at 0.10 m/s, usually 0.14 to 0.18: slower"),
        ({"roll_mean": -0.4}, WING, "roll -23°, usually -4 to 5: to the left"),
        ({"pitch_climb": 0.3}, TRIM, "pitch 17° climbing, usually 21 to 30: flatter"),
        ({"pitch_dive": -0.6}, TRIM, "pitch 34° diving, usually 21 to 30: steeper"),
        ({"ballast_climb": 120e-6}, HEAVY, "pumps 120 cc to climb, usually 204 to 276: less"),
        ({"ballast_dive": -120e-6}, TRIM, "pumps 120 cc to dive, usually 213 to 288: less"),
        ({"vacuum": 15e3}, HEAVY, "vacuum 15.0 kPa, usually 20.0 to 28.0: less"),
        ({"yos": 3.0}, DRAG, "1.0 yos an hour, usually 1.4 to 2.6: fewer"),
        ({"duration": 5.0 * 3600}, DRAG, "surfaced after 5.0 h, usually 1.8 to 4.2: later"),
    ],
)
def test_out_of_the_usual_speaks_for_the_cause_that_it_fits(
    changes: dict[str, float], cause: Cause, words: str
) -> None:
    pro, con = weigh(slow(**changes), Kind.ANOMALY, cause)
    assert words in pro
    assert words not in con


@pytest.mark.parametrize(
    ("changes", "cause", "words"),
    [
        ({}, WING, "roll 1°, as usual (-4 to 5)"),
        ({}, DRAG, "climbs at 0.16 m/s, as usual (0.14 to 0.18)"),
        ({"roll_mean": -0.4}, DRAG, "roll -23°, usually -4 to 5: to the left"),
        ({"yos": 12.0}, DRAG, "4.0 yos an hour, usually 1.4 to 2.6: more"),
    ],
)
def test_what_the_cause_does_not_fit_speaks_against_it(
    changes: dict[str, float], cause: Cause, words: str
) -> None:
    pro, con = weigh(slow(**changes), Kind.ANOMALY, cause)
    assert words in con
    assert words not in pro


def test_what_the_cause_leaves_as_it_is_speaks_neither_way_or_for_it() -> None:
    pro, con = weigh(slow(depth_rate_climb=-0.09, depth_rate_dive=0.1), Kind.ANOMALY, HEAVY)
    assert not any("pitch" in line for line in (*pro, *con))
    pro, _ = weigh(slow(), Kind.ANOMALY, WING)
    assert "climbs at 0.16 m/s, as usual (0.14 to 0.18)" in pro


@pytest.mark.parametrize(
    ("changes", "cause"),
    [
        ({"roll_mean": -0.4}, WING),
        ({"depth_rate_climb": -0.09, "depth_rate_dive": 0.09}, DRAG),
        ({"depth_rate_climb": -0.09}, HEAVY),
        ({"pitch_climb": 0.3}, TRIM),
        ({"depth_rate_climb": -0.09, "depth_rate_dive": 0.09, "roll_mean": 0.2}, DRAG),
    ],
)
def test_the_likeliest_cause_follows_from_what_is_off(changes: dict[str, float], cause: Cause) -> None:
    assert likeliest(Kind.ANOMALY, slow(**changes)).cause is cause


def test_a_value_that_rounds_into_its_range_shows_why_it_is_outside() -> None:
    (found,) = (t for t in usual(after(depth_rate_climb=-0.1351)) if t.text.startswith("climbs at"))
    assert found.text == "climbs at 0.135 m/s, usually 0.136 to 0.184: slower"
    (found,) = (t for t in usual(after(depth_rate_climb=-0.1359)) if t.text.startswith("climbs at"))
    assert found.text == "climbs at 0.1359 m/s, usually 0.1360 to 0.1840: slower"


def test_the_further_out_the_earlier() -> None:
    pro, _ = weigh(slow(depth_rate_dive=0.05, depth_rate_climb=-0.13), Kind.ANOMALY, DRAG)
    places = [next(i for i, line in enumerate(pro) if line.startswith(w)) for w in ("dives at", "climbs at")]
    assert places == sorted(places)


def test_three_lines_on_each_side() -> None:
    odd = slow(depth_rate_climb=-0.05, depth_rate_dive=0.05, yos=1.0, duration=6.0 * 3600)
    more = {"speed_before": 0.1, "across_misfit": 0.01, "along_speed": 0.1}
    pro, con = weigh(replace(odd, evidence={**odd.evidence, **more}), Kind.ANOMALY, DRAG)
    assert len(pro) == LINES == 3
    assert len(con) <= LINES
    assert all(len(line) < 110 for line in (*pro, *con))


def test_fixed_bounds_only_where_nothing_is_usual() -> None:
    dive = DiveFeatures(3.0 * 3600, roll_mean=0.38, depth_rate_dive=0.3, depth_rate_climb=-0.15)
    tilted = evidence(dive)
    bare = replace(SLOW, evidence=tilted, notes=())
    assert "mean roll 22 degrees" in weigh(bare, Kind.ANOMALY, WING)[0]
    assert any(
        line.startswith("dives at 0.30 m/s but climbs") for line in weigh(bare, Kind.ANOMALY, HEAVY)[0]
    )
    known = Baseline()
    for _ in range(6):
        known = learn(known, dive)
    pro, con = weigh(replace(bare, evidence={**tilted, **evidence_of(known, dive)}), Kind.ANOMALY, WING)
    assert not any(line.startswith("mean roll") for line in (*pro, *con))
    assert "roll 22°, as usual (17 to 26)" in con


@pytest.mark.parametrize(
    ("misfit", "sigma", "wrong"), [(0.06, 0.01, True), (0.06, 0.02, False), (0.04, 0.001, False)]
)
def test_a_misfit_counts_beyond_four_standard_errors(misfit: float, sigma: float, wrong: bool) -> None:
    made = replace(DISAGREE, evidence={"across_misfit": misfit, "across_sigma": sigma})
    pro, _ = weigh(made, Kind.FALSE_ALARM, FLOW)
    assert any("the track misses" in line for line in pro) is wrong
    assert likeliest(Kind.FALSE_ALARM, made).fact.startswith("the track misses") is wrong


@pytest.mark.parametrize(
    ("p_e", "fact"), [(0.4, "reckoned and estimated current are 0.58 m/s apart"), (0.1, "")]
)
def test_where_the_track_fits_the_currents_are_what_disagrees(p_e: float, fact: str) -> None:
    made = replace(DISAGREE, p_e=p_e, evidence={"across_misfit": 0.02, "across_sigma": 0.02})
    assert likeliest(Kind.FALSE_ALARM, made).fact == fact


def test_not_a_number_is_left_out() -> None:
    evidence = dict.fromkeys(after(), float("nan"))
    assert usual(evidence) == []


@pytest.mark.parametrize(("own", "is_out"), [(0.24, True), (0.25, False)])
def test_what_a_glider_believes_is_compared_less_the_slip(own: float, is_out: bool) -> None:
    """The normal range is of the speed through the water: 0.24 m/s of its own are 0.22, below 0.225."""
    dive = replace(SLOW, speed_min=0.225, evidence={"onboard_speed": own})
    pro, con = weigh(dive, Kind.ANOMALY, DRAG)
    assert any("out of the normal range" in line for line in (*pro, *con)) is is_out
