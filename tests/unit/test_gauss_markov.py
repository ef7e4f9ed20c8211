"""The one model of the sea: reference numbers of the augmented filter, and what holds for any sea."""

import math

import numpy as np
import pytest

from gliderwatch.estimation.kalman import JointParams, step
from gliderwatch.sea.gauss_markov import (
    EARTH,
    HOUR,
    FlowParams,
    Passage,
    Tide,
    intensities,
    passage,
    prior,
    rates,
)
from gliderwatch.simulate.ocean import Constituent, Ellipse
from joint_support import Way, mission

LAT = 30.0
M2 = math.radians(28.9841042) / HOUR


def learnt(x, cov, went: Passage, current, params, noise):
    """A Kalman update by one current, written out."""
    x, cov = went.matrix @ x, went.matrix @ cov @ went.matrix.T + went.noise
    rows = np.zeros((2, params.size))
    rows[:, params.mean] = np.eye(2)
    innovation = np.array(current) - rows @ x
    gain = cov @ rows.T @ np.linalg.inv(rows @ cov @ rows.T + noise * np.eye(2))
    return x + gain @ innovation, cov - gain @ rows @ cov, innovation


def test_numbers_of_the_augmented_filter():
    """A residual of 0.08 m/s and 30 h and M2 that wanders, on three dives: innovations, and the next
    displacement."""
    params = FlowParams(passing=0.08, memory=30 * HOUR, tides=(Tide(M2, 0.5 / math.sqrt(2)),))
    q = np.array([0.0, 2 * 0.08**2 / (30 * HOUR), 0.0, *[1e-6 / HOUR / 2] * 2])
    variance = prior(params)
    variance[[0, 1, 4, 5]] = 0.0  # neither a lasting part nor inertial motion
    x, cov, end, innovations = np.zeros(params.size), np.diag(variance), 0.0, []
    for z, start, stop in ((0.3, 0.0, 3.0), (-0.1, 3.2, 6.2), (-0.35, 6.4, 9.4)):
        went = passage((start - end) * HOUR, (stop - start) * HOUR, LAT, q, params)
        x, cov, innovation = learnt(x, cov, went, (z, 0.0), params, 1e-4)
        end = stop
        innovations.append(innovation[0])
    assert innovations == pytest.approx([0.3, -0.0941918574, -0.0711185996], abs=1e-9)
    ahead = passage(0.2 * HOUR, 3 * HOUR, LAT, q, params)
    mean = ahead.matrix @ x
    spread = ahead.matrix @ cov @ ahead.matrix.T + ahead.noise
    at = params.mean.start
    assert mean[at] * 3 * HOUR == pytest.approx(813.4671, abs=1e-3)
    assert math.sqrt(spread[at, at]) * 3 * HOUR == pytest.approx(472.2680, abs=1e-3)


@pytest.mark.parametrize("lat", [-50.0, 0.0, 30.0, 74.5])
def test_two_gaps_do_what_one_of_their_length_does(lat):
    params = FlowParams()
    q = intensities(np.full(params.size, 0.1), 1.0, params)
    whole = passage(7 * HOUR, 2 * HOUR, lat, q, params)
    first, second = passage(3 * HOUR, 1 * HOUR, lat, q, params), passage(3 * HOUR, 2 * HOUR, lat, q, params)
    assert second.matrix @ first.matrix == pytest.approx(whole.matrix, abs=1e-12)
    both = second.matrix @ first.noise @ second.matrix.T + second.noise
    assert both == pytest.approx(whole.noise, abs=1e-15)
    assert np.linalg.eigvalsh(whole.noise).min() > -1e-15


@pytest.mark.parametrize(("major", "minor"), [(0.6, 0.0), (0.5, 0.3), (0.4, -0.4)])
def test_any_ellipse_is_two_rotary_parts(major, minor):
    """The mean of an ellipse over a dive, by a fine sum, is what the state gives."""
    params = FlowParams(tides=(Tide(Constituent.M2.frequency, 0.25),))
    ellipse = Ellipse(Constituent.M2, major, minor, inclination=0.7, phase=1.1)
    u, v = ellipse.current(np.array([0.0, 0.25 * 2 * math.pi / Constituent.M2.frequency]))
    # z = p e^(i w t) + m e^(-i w t): from the flow at two times a quarter of a period apart
    now, later = complex(u[0], v[0]), complex(u[1], v[1])
    plus, minus = (now - 1j * later) / 2, (now + 1j * later) / 2
    x = np.zeros(params.size)
    x[6:10] = plus.real, plus.imag, minus.real, minus.imag
    went = passage(5 * HOUR, 4 * HOUR, LAT, np.zeros(params.parts), params)
    t = np.linspace(5 * HOUR, 9 * HOUR, 20001)
    east, north = ellipse.current(t)
    assert (went.matrix @ x)[params.mean] == pytest.approx(
        [np.trapezoid(east, t) / (4 * HOUR), np.trapezoid(north, t) / (4 * HOUR)], abs=1e-6
    )


def test_inertial_motion_turns_clockwise_in_the_north():
    assert rates(30.0, FlowParams())[2].imag == pytest.approx(-EARTH)
    assert rates(-30.0, FlowParams())[2].imag == pytest.approx(EARTH)


def test_a_tide_wanders_by_a_part_of_what_it_is():
    params = FlowParams()
    state = np.zeros(params.size)
    calm = intensities(state, 1.0, params)
    state[6:8] = 0.3, 0.4
    strong = intensities(state, 1.0, params)
    assert strong[3] > 100 * calm[3]
    assert strong[4:] == pytest.approx(calm[4:])
    assert intensities(state, 4.0, params)[:3] == pytest.approx(4 * calm[:3])


def tidal(t: float, hours: float) -> tuple[float, float]:
    """The mean of a strong elliptic tide with its spring and neap over a dive that ends at a time (s)."""
    parts = (Ellipse(Constituent.M2, 0.5, 0.25, 0.4, 1.0), Ellipse(Constituent.S2, 0.2, 0.1, 0.6, 2.0))
    at = np.linspace(t, t + hours * HOUR, 60)
    found = np.sum([ellipse.current(at) for ellipse in parts], axis=0).mean(axis=1)
    return float(found[0]), float(found[1])


def test_a_shelf_sea_is_no_slow_glider():
    """A tide of 0.7 m/s on an ellipse, a glider that turns now and then: no step, and the speed as it is."""
    ways = [Way(heading=0.9 * (k // 6), flow=tidal(k * (3 * HOUR + 600), 3.0)) for k in range(160)]
    state, params = None, JointParams()
    for k, dive in enumerate(mission(ways)):
        state, info = step(state, dive, params)
        assert info.proven is None
        if k > 24:
            assert info.estimate.speed == pytest.approx(0.23, abs=0.02)
    assert state.process_scale < 0.5  # it was all tide
