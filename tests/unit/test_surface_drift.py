import math

import numpy as np
import pytest

from gliderwatch.estimation.surface_drift import Drifts, added, drift, evidence
from gliderwatch.model import Fix, readonly
from gliderwatch.navigation.geodesy import from_plane

HOUR = 3600.0
LEG = [0.0] * 24 + [1.6] * 24
"""rad: headings of a glider that turns."""


def drifts(
    headings, loss=0.0, side=0.0, since=math.inf, wind=lambda t: (0.0, 0.0), spread=0.1, speed=0.25, seed=1
):
    """Surfacings every 3 h; the drift departs from the flow that is believed by a loss since a time (s)."""
    rng, out = np.random.default_rng(seed), Drifts()
    for k, heading in enumerate(headings):
        t = 3 * HOUR * k
        way = speed * np.array([math.cos(heading), math.sin(heading)])
        aside = speed * np.array([-math.sin(heading), math.cos(heading)])
        beside = (loss * way + side * aside) * (t > since) + wind(t) + spread * rng.standard_normal(2)
        out = added(out, t, beside, way)
    return out


def fix(t, north):
    return Fix(t, *from_plane(np.array([0.0, north]), 30.0, -80.0))


@pytest.mark.parametrize(
    ("seconds", "is_told"), [(230.0, False), (250.0, True), (2390.0, True), (2410.0, False)]
)
def test_a_drift_is_between_fixes_of_one_surfacing(seconds, is_told):
    found = drift(fix(0.0, 0.0), fix(seconds, 0.2 * seconds))
    assert (found is not None) == is_told
    if is_told:
        assert found == pytest.approx([0.0, 0.2], abs=1e-4)
    assert drift(None, fix(seconds, 0.0)) is None
    assert drift(fix(0.0, 0.0), fix(600.0, 5000.0)) is None  # a wild fix


@pytest.mark.parametrize("seed", range(5))
def test_it_speaks_for_a_loss_that_there_is_and_against_one_that_there_is_not(seed):
    since = 20 * 3 * HOUR
    lost, well = drifts(LEG, 0.4, since=since, seed=seed), drifts(LEG, seed=seed)
    assert evidence(lost, since, 0.4, 0.0) > 1
    assert evidence(well, since, 0.4, 0.0) < -1
    off = drifts(LEG, side=-0.4, since=since, seed=seed)
    assert evidence(off, since, 0.0, -0.4) > 1 > -1 > evidence(off, since, 0.0, 0.4)


def test_it_is_bounded():
    """Wind blows for days."""
    lost = drifts(LEG, 0.9, since=0.0, spread=0.01)
    assert evidence(lost, 0.0, 0.9, 0.0) == 10.0
    assert evidence(lost, 0.0, -0.9, 0.0) == -20.0


def written_out(found, since, slip, side, spread):
    """Twice the log of the ratio of two normal densities, the covariance being written out."""
    n = len(found.times)
    cov = np.empty((n, n))
    for i in range(n):
        for j in range(n):
            lasting = 0.6 * math.exp(-abs(found.times[i] - found.times[j]) / (10 * HOUR)) + 0.4 * (i == j)
            cov[i, j] = spread**2 * lasting + 0.15**2
    twice = 0.0
    for c in (0, 1):
        aside = (-1, 1)[c] * found.ways[:, 1 - c]
        step = (slip * found.ways[:, c] + side * aside) * (found.times > since)
        for sign, expected in ((1, step), (-1, 0 * step)):
            left = found.beside[:, c] - expected
            twice -= sign * left @ np.linalg.inv(cov) @ left
    return twice


def test_it_is_what_two_normal_distributions_make_of_it():
    found = drifts(LEG, 0.3, since=25 * 3 * HOUR, seed=4)
    spread = np.median(np.hypot(*(found.beside - found.beside.mean(axis=0)).T)) / 1.1774
    expected = written_out(found, 25 * 3 * HOUR, 0.2, 0.1, spread)
    assert -20 < expected < 10
    assert evidence(found, 25 * 3 * HOUR, 0.2, 0.1) == pytest.approx(expected, rel=1e-9)


def test_calm_drifts_are_not_believed_better_than_8_cm():
    calm = drifts(LEG, 0.1, since=25 * 3 * HOUR, spread=1e-4)
    expected = written_out(calm, 25 * 3 * HOUR, 0.1, 0.0, 0.08)
    assert 0 < expected < 10
    assert evidence(calm, 25 * 3 * HOUR, 0.1, 0.0) == pytest.approx(expected, rel=1e-6)


def test_a_steady_wind_is_no_loss():
    """It was there before, and does not turn with the glider."""
    windy = drifts([0.0] * 48, wind=lambda t: (0.15, 0.0))
    assert evidence(windy, 24 * 3 * HOUR, 0.4, 0.0) < 0
    assert evidence(drifts(LEG, wind=lambda t: (0.15, 0.0)), 10 * 3 * HOUR, 0.4, 0.0) < -5


def test_where_the_wind_turns_with_the_step_on_one_heading_it_says_little():
    """0.1 m/s from the step on: as much as 0.4 of the speed would do."""
    turned = drifts([0.0] * 30, wind=lambda t: (0.1 * (t > 60 * HOUR), 0.0), spread=0.15)
    assert abs(evidence(turned, 60 * HOUR, 0.4, 0.0)) < 5


def test_one_that_is_far_off_counts_as_four_spreads():
    well = drifts(LEG, seed=3)
    beside = well.beside.copy()
    beside[40] += [2.0, 2.0]
    wild = Drifts(well.times, readonly(beside), well.ways)
    assert evidence(wild, 60 * HOUR, 0.4, 0.0) == pytest.approx(evidence(well, 60 * HOUR, 0.4, 0.0), abs=3.0)


def test_few_tell_nothing():
    assert evidence(Drifts(), 0.0, 0.4, 0.0) == 0.0
    assert evidence(drifts([0.0] * 7, 0.9, since=0.0), 0.0, 0.9, 0.0) == 0.0
    assert evidence(drifts([0.0] * 8, 0.9, since=0.0), 0.0, 0.9, 0.0) != 0.0
    assert evidence(drifts(LEG), 1e9, 0.9, 0.0) == 0.0  # none since


def test_a_week_is_kept():
    found = drifts([0.1 * k for k in range(60)])
    assert len(found.times) == len(found.beside) == len(found.ways) == 48
    assert found.times[-1] == 59 * 3 * HOUR
