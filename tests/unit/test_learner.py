import math
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML

from euler import euler_step
from gliderwatch.model import readonly
from gliderwatch.papers.basis import phi
from gliderwatch.papers.learner import AdaptiveParams, advance, init, with_basis

TABLE_I = AdaptiveParams(13e3, "exponential", omega=2e-6 * math.pi, nu=0.0, k=0.003, gamma=5e-7)
TIDAL = AdaptiveParams(3e3, "gaussian", omega=1.4e-4, nu=0.3, k=0.003, gamma=5e-6, speed_gain=2e-6)
CENTRES = [[0.0, 0.0], [5e3, 2e3], [-3e3, 4e3], [2e3, -6e3]]
PRESETS = Path(__file__).resolve().parents[2] / "config" / "presets.yml"


def start():
    xi = [[0.02, 0.05, -0.03, 0.1], [0.04, -0.06, 0.02, 0.01]]
    return replace(init(0.3, 4), e=readonly([5.0, -8.0]), xi=readonly(xi))


def turning(spacing, hours=6.0):
    """A wandering heading and a slowly changing current, 0.25 m/s through water."""
    rng = np.random.default_rng(0)
    t = 1.667e9 + np.arange(0.0, hours * 3600.0 + 1.0, spacing)
    angle = np.cumsum(rng.normal(0.0, 0.03 * math.sqrt(spacing), len(t) - 1))
    heading = np.column_stack([np.cos(angle), np.sin(angle)])
    current = [0.1, -0.05] + 0.03 * np.column_stack([np.sin(t[:-1] / 4e3), np.cos(t[:-1] / 7e3)])
    x = np.vstack([np.zeros(2), np.cumsum((0.25 * heading + current) * np.diff(t)[:, None], axis=0)])
    return t, x, heading


def steady(hours, velocity, heading, spacing=60.0):
    """Constant velocity over ground and constant heading."""
    t = np.arange(0.0, hours * 3600.0 + 1.0, spacing)
    return t, t[:, None] * np.array(velocity), np.tile(np.array(heading, dtype=float), (len(t) - 1, 1))


def runge_kutta(state, track, basis, params, dt=4.0):
    """The equations of 001 themselves, with (7), (9), (25), (27), (28), by steps of at most dt.

    With beta as (9) has it, phi at the estimated place comes and goes again: it is left out.
    Returns e, e_delta, xi, V_L as one vector and the greatest
    |e|. Of fourth order: half the step makes less of a difference than a tenth of any accuracy asked for.
    """
    t, x, heading = track
    g = params.gamma if params.speed_gain is None else params.speed_gain
    u_0 = math.inf if params.max_speed is None else params.max_speed

    def slope(y, at_x, place, velocity, psi):
        z, e_delta, xi, v = y[:2], y[2:4], y[4:-1].reshape(2, -1), y[-1]
        e = place - z
        z_rate = xi @ at_x + v * psi + params.k * e
        delta = (min(v, u_0) - v) * psi - params.k * e_delta
        eps = e - e_delta
        xi_rate = params.gamma * np.outer(eps, at_x)
        return np.concatenate([z_rate, delta, xi_rate.ravel(), [g * eps @ psi]])

    y = np.concatenate([x[0] - state.e, state.e_delta, state.xi.ravel(), [state.speed]])
    greatest = math.hypot(*state.e)
    for i in range(len(t) - 1):
        n = math.ceil((t[i + 1] - t[i]) / dt)
        h = (t[i + 1] - t[i]) / n
        velocity = (x[i + 1] - x[i]) / (t[i + 1] - t[i])
        since = 0.5 * h * np.arange(2 * n + 1)
        places = x[i] + since[:, None] * velocity
        values = phi(places, t[i] + since, basis)
        for j in range(n):
            args = [(values[s], places[s], velocity, heading[i]) for s in (2 * j, 2 * j + 1, 2 * j + 2)]
            k1 = slope(y, *args[0])
            k2 = slope(y + h / 2 * k1, *args[1])
            k3 = slope(y + h / 2 * k2, *args[1])
            k4 = slope(y + h * k3, *args[2])
            y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            greatest = max(greatest, math.hypot(*(args[2][1] - y[:2])))
    y[:2] = x[-1] - y[:2]
    return y, greatest


# accuracy: e (m), xi and V_L (m/s) after six hours
@pytest.mark.parametrize(
    ("params", "spacing", "metres", "speeds"),
    [
        (TABLE_I, 4.0, 1e-5, 1e-8),
        (TABLE_I, 60.0, 1e-3, 1e-6),
        (TABLE_I, 1800.0, 0.02, 2e-6),
        (TIDAL, 4.0, 1e-4, 1e-7),
        (TIDAL, 60.0, 0.01, 1e-5),
        (TIDAL, 1800.0, 0.2, 2e-4),
    ],
)
def test_against_the_paper_s_equations_integrated_finely(params, spacing, metres, speeds):
    basis, track = params.basis(CENTRES), turning(spacing)
    want, greatest = runge_kutta(start(), track, basis, params)
    got, info = advance(start(), *track, basis, params)
    assert got.e == pytest.approx(want[:2], abs=metres)
    assert got.xi.ravel() == pytest.approx(want[4:-1], abs=speeds)
    assert got.speed == pytest.approx(want[-1], abs=speeds)
    # |e| may peak inside a substep of 300 s
    assert info.clle_max == pytest.approx(greatest, rel=0.02)
    z = track[1][-1] - want[:2]
    assert info.flow == pytest.approx(
        want[4:-1].reshape(2, 4) @ phi(z, track[0][-1], basis), abs=max(speeds, 1e-6) * 4
    )


@pytest.mark.parametrize(
    ("spacing", "metres", "speeds"), [(4.0, 1e-3, 1e-6), (60.0, 0.1, 1e-5), (1800.0, 1.0, 5e-3)]
)
@pytest.mark.parametrize("limit", [0.2, 0.25])
def test_saturation_against_the_paper_s_equations(spacing, metres, speeds, limit):
    """0.2 m/s: saturated all the way; 0.25 m/s: in and out of saturation."""
    params = replace(TABLE_I, speed_gain=5e-6, max_speed=limit)
    basis, track = params.basis(CENTRES), turning(spacing)
    want, _ = runge_kutta(start(), track, basis, params)
    got, _ = advance(start(), *track, basis, params)
    assert np.hypot(*want[2:4]) > 1.0
    assert got.e == pytest.approx(want[:2], abs=metres)
    assert got.e_delta == pytest.approx(want[2:4], abs=metres)
    assert got.xi.ravel() == pytest.approx(want[4:-1], abs=speeds)
    assert got.speed == pytest.approx(want[-1], abs=speeds)


def test_a_limit_out_of_reach_changes_nothing():
    basis, track = TABLE_I.basis(CENTRES), turning(60.0)
    free, _ = advance(start(), *track, basis, TABLE_I)
    limited, _ = advance(start(), *track, basis, replace(TABLE_I, max_speed=9.0))
    for field in fields(free):
        assert np.array_equal(getattr(free, field.name), getattr(limited, field.name))


def test_no_flow_and_constant_heading():
    """Without basis functions V_L - V_R is a damped oscillator with a solution in one line."""
    params = replace(TABLE_I, speed_gain=1e-6)
    track = steady(1.0, [0.15, 0.2], [0.6, 0.8])
    state = replace(init(0.1, 0), e=readonly([12.0, 16.0]))
    got, _ = advance(state, *track, params.basis([]), params)
    d = math.sqrt(0.0015**2 - 1e-6)
    slow, fast = 0.0015 - d, 0.0015 + d
    # at the start V_L - V_R = -0.15 m/s, and it changes by speed_gain times e along, 20 m
    p = (fast * -0.15 + 1e-6 * 20.0) / (fast - slow)
    left = p * math.exp(-slow * 3600.0) + (-0.15 - p) * math.exp(-fast * 3600.0)
    assert got.speed == pytest.approx(0.25 + left, rel=1e-9)


def test_flow_and_speed_share_what_a_constant_heading_cannot_tell_apart():
    """0.3 m/s along, 0.1 across, phi = 1: the start's shortfall is split as the learning rates are."""
    params = AdaptiveParams(1e12, "exponential", omega=0.0, nu=0.0, k=0.003, gamma=2e-6, speed_gain=1e-6)
    got, info = advance(init(0.24, 1), *steady(48.0, [0.3, 0.1], [1.0, 0.0]), params.basis([[0, 0]]), params)
    assert got.speed == pytest.approx(0.24 + 0.06 / 3, abs=1e-6)
    assert info.flow == pytest.approx([0.04, 0.1], abs=1e-6)
    assert got.e == pytest.approx([0.0, 0.0], abs=1e-3)


def test_turning_tells_speed_and_flow_apart():
    params = AdaptiveParams(1e9, "gaussian", omega=0.0, nu=0.0, k=0.003, gamma=5e-7)
    t = np.arange(0.0, 5 * 86400.0, 60.0)
    angle = t[:-1] / 3000.0
    heading = np.column_stack([np.cos(angle), np.sin(angle)])
    x = np.vstack([[0, 0], np.cumsum(60.0 * (0.25 * heading + [0.08, -0.03]), axis=0)])
    got, info = advance(init(0.1, 1), t, x, heading, params.basis([[0, 0]]), params)
    assert got.speed == pytest.approx(0.25, abs=1e-3)
    assert info.flow == pytest.approx([0.08, -0.03], abs=1e-3)


def test_the_surface_leaves_the_speed_alone_and_still_learns_the_drift():
    t, x, heading = steady(3.0, [0.2, -0.1], [0.0, 0.0])
    got, info = advance(start(), t, x, heading, TABLE_I.basis(CENTRES), TABLE_I)
    assert got.speed == start().speed
    assert got.flown == 0.0
    assert info.excitation == 0.0
    want, _ = runge_kutta(start(), (t, x, heading), TABLE_I.basis(CENTRES), TABLE_I)
    assert got.xi.ravel() == pytest.approx(want[4:-1], abs=1e-6)


def test_headings_averaged_over_an_interval_may_be_shorter_than_one():
    t, x, heading = turning(60.0)
    track = t, x, heading * np.random.default_rng(2).uniform(0.3, 1.0, (len(heading), 1))
    want, _ = runge_kutta(start(), track, TIDAL.basis(CENTRES), TIDAL)
    got, _ = advance(start(), *track, TIDAL.basis(CENTRES), TIDAL)
    assert got.speed == pytest.approx(want[-1], abs=1e-5)
    assert got.xi.ravel() == pytest.approx(want[4:-1], abs=1e-5)


def test_a_speed_gain_of_none_is_gamma():
    basis, track = TABLE_I.basis(CENTRES), turning(60.0)
    one, _ = advance(start(), *track, basis, TABLE_I)
    other, _ = advance(start(), *track, basis, replace(TABLE_I, speed_gain=TABLE_I.gamma))
    assert one.speed == other.speed


@pytest.mark.parametrize("spacing", [4.0, 60.0, 1800.0])
@pytest.mark.parametrize("limit", [None, 0.27])
def test_a_track_in_two_calls_equals_one(spacing, limit):
    params = replace(TABLE_I, max_speed=limit)
    basis, (t, x, heading) = params.basis(CENTRES), turning(spacing)
    whole, info = advance(start(), t, x, heading, basis, params)
    i = len(t) // 3
    half, first = advance(start(), t[: i + 1], x[: i + 1], heading[:i], basis, params)
    both, second = advance(half, t[i:], x[i:], heading[i:], basis, params)
    for field in fields(whole):
        assert getattr(both, field.name) == pytest.approx(getattr(whole, field.name), rel=1e-10, abs=1e-10)
    assert max(first.clle_max, second.clle_max) == pytest.approx(info.clle_max, rel=1e-10)
    assert max(first.flow_speed_max, second.flow_speed_max) == pytest.approx(info.flow_speed_max, rel=1e-10)
    assert first.n_steps + second.n_steps == info.n_steps
    assert second.excitation == pytest.approx(info.excitation, rel=1e-6)


def test_another_plane_changes_nothing():
    """The error is kept, not the estimated place: track and centres may move together."""
    shift = np.array([4e4, -2e4])
    t, x, heading = turning(60.0)
    here, _ = advance(start(), t, x, heading, TABLE_I.basis(CENTRES), TABLE_I)
    there, _ = advance(start(), t, x + shift, heading, TABLE_I.basis(CENTRES + shift), TABLE_I)
    assert there.e == pytest.approx(here.e, abs=1e-6)
    assert there.speed == pytest.approx(here.speed, abs=1e-9)


def test_long_intervals_are_cut_and_short_ones_are_not():
    basis = TABLE_I.basis(CENTRES)
    assert advance(start(), *turning(1800.0), basis, TABLE_I)[1].n_steps == 12 * 6
    assert advance(start(), *turning(60.0), basis, TABLE_I)[1].n_steps == 360


def test_one_point_changes_nothing():
    t, x, heading = turning(60.0)
    got, info = advance(start(), t[:1], x[:1], heading[:0], TABLE_I.basis(CENTRES), TABLE_I)
    assert (got.speed, got.xi.tolist(), got.e.tolist()) == (0.3, start().xi.tolist(), [5.0, -8.0])
    assert (info.n_steps, info.clle_max) == (0, pytest.approx(math.hypot(5, 8)))
    assert info.flow == pytest.approx(start().xi @ phi(x[0] - [5.0, -8.0], t[0], TABLE_I.basis(CENTRES)))


def test_results_are_read_only_and_inputs_left_alone():
    state, track, basis = start(), turning(60.0), TABLE_I.basis(CENTRES)
    kept = [np.copy(v) for v in (*track, state.e, state.e_delta, state.xi, state.gram)]
    got, info = advance(state, *track, basis, TABLE_I)
    for now, then in zip((*track, state.e, state.e_delta, state.xi, state.gram), kept, strict=True):
        assert np.array_equal(now, then)
    after = euler_step(
        got, 0.0, 1.0, np.zeros(2), np.ones(2), heading=track[2][0], basis=basis, params=TABLE_I
    )
    for array in (got.e, got.e_delta, got.xi, got.gram, info.flow, after.e, after.xi, with_basis(got, 1).xi):
        assert not array.flags.writeable


def test_euler_saturates_as_the_equations_do():
    params = replace(TABLE_I, speed_gain=5e-6, max_speed=0.2)
    basis, (t, x, heading) = params.basis(CENTRES), turning(4.0, hours=2.0)
    want, _ = runge_kutta(start(), (t, x, heading), basis, params)
    state = start()
    for i in range(len(t) - 1):
        state = euler_step(state, t[i], 4.0, x[i], x[i + 1], heading=heading[i], basis=basis, params=params)
    assert state.e_delta == pytest.approx(want[2:4], rel=0.02)
    assert state.speed == pytest.approx(want[-1], abs=1e-3)


def test_new_functions_start_at_nothing():
    basis, track = TABLE_I.basis(CENTRES), turning(60.0)
    before, _ = advance(start(), *track, basis, TABLE_I)
    more = with_basis(before, 2)
    assert more.xi.tolist() == np.hstack([before.xi, np.zeros((2, 2))]).tolist()
    far = TABLE_I.basis([*CENTRES, [1e9, 0.0], [0.0, 1e9]])
    wide, _ = advance(more, *track, far, TABLE_I)
    narrow, _ = advance(before, *track, basis, TABLE_I)
    assert wide.speed == pytest.approx(narrow.speed, abs=1e-12)
    assert wide.xi[:, :4] == pytest.approx(narrow.xi, abs=1e-12)
    assert wide.gram[:6, :6] == pytest.approx(narrow.gram, abs=1e-12)


def paper_w(track, basis, flown):
    """W of 001 eq. (15), entry by entry: an exponentially forgetting mean by small steps."""
    t, x, heading = track
    w = np.zeros((2 * len(basis) + 1,) * 2)
    weight = 0.0
    for i in range(len(t) - 1):
        values = phi((x[i] + x[i + 1]) / 2, (t[i] + t[i + 1]) / 2, basis)
        rows = np.zeros((len(w), 2))
        rows[: len(basis), 0] = rows[len(basis) : -1, 1] = values
        rows[-1] = heading[i]
        kept = math.exp(-(t[i + 1] - t[i]) / 86400.0)
        w, weight = kept * w + (1 - kept) * rows @ rows.T, kept * weight + 1 - kept
    return w / weight


def test_excitation_is_the_smallest_eigenvalue_of_w():
    params = replace(TABLE_I, sigma=2e3)
    basis, track = params.basis(CENTRES[:2]), turning(60.0, hours=30.0)
    _, info = advance(init(0.25, 2), *track, basis, params)
    want = np.linalg.eigvalsh(paper_w(track, basis, 30 * 3600.0))[0]
    assert info.excitation == pytest.approx(want, rel=1e-6)


def test_excitation_needs_turns():
    params = AdaptiveParams(1e9, "exponential", omega=0.0, nu=0.0, k=0.003, gamma=5e-7)
    basis = params.basis([[0, 0]])
    _, straight = advance(init(0.25, 1), *steady(30.0, [0.3, 0.1], [0.6, 0.8]), basis, params)
    t, x, heading = steady(30.0, [0.3, 0.1], [1.0, 0.0])
    heading[len(heading) // 2 :] = [0.0, 1.0]
    _, turned = advance(init(0.25, 1), t, x, heading, basis, params)
    assert straight.excitation < 1e-9
    assert turned.excitation > 0.1


def test_excitation_forgets():
    params = AdaptiveParams(1e9, "exponential", omega=0.0, nu=0.0, k=0.003, gamma=5e-7)
    basis = params.basis([[0, 0]])
    t, x, heading = steady(12.0, [0.3, 0.1], [1.0, 0.0])
    heading[len(heading) // 2 :] = [0.0, 1.0]
    turned, before = advance(init(0.25, 1), t, x, heading, basis, params)
    straight = steady(240.0, [0.3, 0.1], [1.0, 0.0], spacing=1800.0)
    _, after = advance(turned, *straight, basis, params)
    assert after.excitation < 1e-3 < before.excitation


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda t, x, h: (t[::-1], x, h), "increase"),
        (lambda t, x, h: (np.repeat(t, 2)[: len(t)], x, h), "increase"),
        (lambda t, x, h: (t, np.where(x == x[3], np.nan, x), h), "finite"),
        (lambda t, x, h: (t, x, h * math.nan), "finite"),
        (lambda t, x, h: (t, x, h[:-1]), "need"),
        (lambda t, x, h: (t[:-1], x, h), "need"),
        (lambda t, x, h: (t[:0], x[:0], h[:0]), "need"),
    ],
)
def test_a_bad_track_is_refused(spoil, message):
    with pytest.raises(ValueError, match=message):
        advance(start(), *spoil(*turning(60.0)), TABLE_I.basis(CENTRES), TABLE_I)


def test_weights_must_fit_the_basis():
    with pytest.raises(ValueError, match="with_basis"):
        advance(init(0.3, 3), *turning(60.0), TABLE_I.basis(CENTRES), TABLE_I)


@pytest.mark.parametrize("bad", [{"k": 0.0}, {"sigma": -1.0}, {"gamma": -1e-7}, {"speed_gain": -1e-7}])
def test_impossible_gains_are_refused(bad):
    with pytest.raises(ValueError, match="must"):
        replace(TABLE_I, **bad)


@pytest.mark.parametrize(
    ("name", "sigma", "k", "gamma"),
    [
        ("franklin", 13e3, 0.003, 5e-7),
        ("usf-sam", 50e3, 0.002, 5e-7),
        ("usf-gansett", 32e3, 0.003, 1e-6),
        ("usf-stella", 30e3, 0.003, 1e-7),
    ],
)
def test_presets_hold_table_i(name, sigma, k, gamma):
    presets = YAML(typ="safe").load(PRESETS)
    assert len(presets) == 4
    assert presets[name]["normal_speed"] == {"min": 0.15, "max": 0.25}
    assert presets[name]["estimator"] == "adaptive"
    assert presets[name]["detection"] == {"gamma_f": 1.0}
    assert AdaptiveParams(**presets[name]["adaptive"]) == AdaptiveParams(
        sigma, "exponential", omega=2 * math.pi * 1e-6, nu=0.0, k=k, gamma=gamma
    )
