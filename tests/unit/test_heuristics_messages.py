"""The heuristics of the words do what their page says: each case lies just on one side of a bound."""

from dataclasses import replace
from math import radians

import pytest

from alert_support import DISAGREE, SLOW, incident
from gliderwatch.incidents.notices import DriftEllipse, Situation
from gliderwatch.messages.causes import DRAG, HEAVY, WING, likeliest
from gliderwatch.messages.evidence import certainty, data_quality, normal_range, through_water, weigh
from gliderwatch.messages.incident_text import _course
from gliderwatch.messages.overdue_text import _size
from gliderwatch.model import Assessment, Kind


def slow(speed: float = SLOW.speed, **evidence: float) -> Assessment:
    """A slow dive of which nothing else is known."""
    return replace(SLOW, speed=speed, evidence=evidence, notes=())


@pytest.mark.parametrize(("degrees", "is_named"), [(14.0, False), (16.0, True)])
def test_a_roll_of_15_degrees_is_unusual_on_any_glider(degrees: float, is_named: bool) -> None:
    dive = slow(roll_mean=radians(degrees))
    assert (likeliest(Kind.ANOMALY, dive).cause is WING) == is_named
    pro, con = weigh(dive, Kind.ANOMALY, WING)
    assert bool(pro) == is_named and bool(con) != is_named


@pytest.mark.parametrize(("believed", "is_wing"), [(0.24, False), (0.26, True)])
def test_a_tenth_less_than_it_believes_points_to_a_wing(believed: float, is_wing: bool) -> None:
    dive = slow(0.225, own_speed=believed)
    assert (likeliest(Kind.ANOMALY, dive).cause is WING) == is_wing


@pytest.mark.parametrize(
    ("across", "sigma", "misses"), [(0.045, 0.0, 0), (0.055, 0.0, 1), (0.1, 0.027, 0), (0.1, 0.023, 1)]
)
def test_a_misfit_is_one_from_5_cm_a_second_and_4_standard_errors_on(
    across: float, sigma: float, misses: int
) -> None:
    dive = replace(DISAGREE, evidence={"across_misfit": across, "across_sigma": sigma})
    pro, _ = weigh(dive, Kind.FALSE_ALARM, DRAG)
    assert sum("across the heading the track misses" in text for text in pro) == misses


@pytest.mark.parametrize(("climb", "is_named"), [(-0.105, False), (-0.095, True)])
def test_rates_that_are_apart_by_half_are_named(climb: float, is_named: bool) -> None:
    pro, con = weigh(slow(depth_rate_dive=0.15, depth_rate_climb=climb), Kind.ANOMALY, HEAVY)
    assert any("climbs at" in text for text in (*pro, *con)) == is_named


@pytest.mark.parametrize(
    ("name", "quiet", "named", "words"),
    [
        ("unobserved_h", 0.09, 0.11, "missing from the data"),
        ("fix_gap_minutes", 14.0, 16.0, "between surfacing and fix"),
        ("drift_h", 0.45, 0.55, "surface drift"),
        ("duration_h", 1.1, 0.9, "short dive"),
        ("heading_steadiness", 0.975, 0.985, "heading hardly changed"),
    ],
)
def test_what_is_worth_a_line_on_the_data(name: str, quiet: float, named: float, words: str) -> None:
    assert not any(words in line for line in data_quality(slow(**{name: quiet})))
    assert any(words in line for line in data_quality(slow(**{name: named})))


def test_what_decides_stands_before_what_is_good_to_know() -> None:
    """Weights: a misfit across 3, flows apart 2, what the glider reports of itself 0.5 of what has none."""
    apart = {"across_misfit": 0.31, "onboard_speed": 0.27}
    pro, con = weigh(replace(DISAGREE, evidence=apart), Kind.FALSE_ALARM, DRAG)
    assert [text.split()[0] for text in pro] == ["across", "the", "the"]
    assert "current estimated" in pro[1] and "reports" in pro[2] and con == ()
    agree = replace(DISAGREE, p_e=0.1, evidence={"across_misfit": 0.01})
    _, con = weigh(agree, Kind.FALSE_ALARM, DRAG)
    assert [text.split()[0] for text in con] == ["fixes,", "the"]


@pytest.mark.parametrize(("upper", "words"), [(0.39, "normal 0.22-0.39"), (0.41, "normal above 0.22")])
def test_a_bound_far_above_the_usual_speed_was_not_learnt(upper: float, words: str) -> None:
    assert normal_range(replace(slow(usual_speed=0.25), speed_max=upper)) == words


def test_more_than_99_percent_is_never_claimed() -> None:
    assert certainty(Kind.ANOMALY, slow(speed_sigma=0.001), 3) == "almost sure (99 %)"
    assert certainty(Kind.ANOMALY, slow(0.22 - 2.05 * 0.01, speed_sigma=0.01), 3) == "almost sure (98 %)"


@pytest.mark.parametrize(("now", "words"), [(0.120, "As bad as ever"), (0.124, "Better than its worst")])
def test_a_centimetre_a_second_is_no_change(now: float, words: str) -> None:
    latest = slow(now)
    assert _course(incident(), latest, Situation(latest)).startswith(words)


@pytest.mark.parametrize(("minor", "is_circle"), [(890.0, False), (910.0, True)])
def test_an_ellipse_that_is_nearly_one_is_called_a_circle(minor: float, is_circle: bool) -> None:
    assert (" x " not in _size(DriftEllipse(24.0, -83.0, 1000.0, minor, 0.0))) == is_circle


def test_the_angle_of_attack_takes_8_percent_of_what_it_reckons_with() -> None:
    assert through_water(0.25) == pytest.approx(0.23)
