import math

import numpy as np
import pytest

from gliderwatch.estimation.verdict import Blame, Misfit, blame, disagrees, misfit

GATE = {"gate": 4.0, "least": 0.05}
GOOD = Misfit(along=0.25, across=0.002, sigma=0.01, heading=0.3)


def with_turn(angle: float, heading: float, along: float = 0.25) -> Misfit:
    """The headings of the file are off by an angle (rad) against those that the glider reckoned with."""
    return Misfit(along * math.cos(angle), along * math.sin(angle), 0.01, heading)


def with_error(error: tuple[float, float], heading: float) -> Misfit:
    """The current is off by so much, east and north."""
    rest = 0.25 * np.array([math.cos(heading), math.sin(heading)]) - error
    aside = np.array([-math.sin(heading), math.cos(heading)])
    return misfit(rest, np.array([math.cos(heading), math.sin(heading)]), (float(rest @ aside), 0.01))


def test_misfit_of_numbers():
    found = misfit(np.array([0.3, 0.1]), np.array([0.0, 0.9]), (-0.3, 0.02))
    assert found.along == pytest.approx(0.1)
    assert found.across == -0.3
    assert found.heading == pytest.approx(math.pi / 2)


@pytest.mark.parametrize(
    ("across", "sigma", "off"),
    [
        (0.03, 0.002, False),  # many standard errors of little
        (0.3, 0.1, False),  # much, but hardly known
        (0.3, 0.05, True),
        (-0.3, 0.05, True),
        (0.05, 0.001, False),
        (0.051, 0.001, True),
    ],
)
def test_disagrees_takes_both_bounds(across, sigma, off):
    assert disagrees(Misfit(0.25, across, sigma, 0.0), **GATE) is off


def test_a_slow_glider_never_disagrees():
    for speed in (0.0, 0.05, 0.1):
        assert not disagrees(Misfit(speed, 0.003, 0.01, 1.0), **GATE)


def test_single_dive_is_the_current():
    history = (GOOD, GOOD, with_error((0.2, -0.2), 0.3))
    assert blame(history, **GATE) is Blame.CURRENT


def test_first_dive_of_all_cannot_be_told():
    assert blame((with_error((0.2, -0.2), 0.3),), **GATE) is Blame.UNCLEAR


def test_steady_course_cannot_be_told():
    history = tuple(with_error((0.0, 0.3), 0.1 * k) for k in range(4))
    assert blame(history, **GATE) is Blame.UNCLEAR


def test_what_stays_when_the_glider_turns_is_the_current():
    history = tuple(with_error((0.3, 0.3), heading) for heading in (0.0, 0.4, 1.7, 2.0, 0.1))
    assert blame(history, **GATE) is Blame.CURRENT


@pytest.mark.parametrize("angle", [-0.5, 0.4])
def test_what_turns_with_the_glider_is_the_compass(angle):
    history = (GOOD, *(with_turn(angle, heading) for heading in (0.0, 0.8, 1.7, 3.0)))
    assert blame(history, **GATE) is Blame.COMPASS


def test_only_the_dives_since_the_last_good_one_count():
    history = (*(with_turn(0.4, heading) for heading in (0.0, 0.8, 1.7)), GOOD, with_error((0.0, 0.3), 0.3))
    assert blame(history, **GATE) is Blame.CURRENT
