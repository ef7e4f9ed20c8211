import math
from dataclasses import fields, replace

import msgspec
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from gliderwatch.model import readonly
from gliderwatch.papers.learner import AdaptiveParams, AdaptiveState, advance, init

CENTRES = [[0.0, 0.0], [4e3, 1e3], [-2e3, -5e3]]


def numbers(low, high):
    return st.floats(low, high, allow_nan=False)


@st.composite
def gains(draw):
    return AdaptiveParams(
        sigma=draw(numbers(500.0, 5e4)),
        kernel=draw(st.sampled_from(["exponential", "gaussian"])),
        omega=draw(numbers(0.0, 2e-4)),
        nu=draw(numbers(-math.pi, math.pi)),
        k=draw(numbers(1e-4, 0.05)),
        gamma=draw(numbers(1e-8, 1e-4)),
        speed_gain=draw(st.none() | numbers(1e-8, 1e-4)),
    )


@st.composite
def tracks(draw, moving=True):
    """Up to 40 intervals of 4 s to 30 min, any headings, at the surface now and then."""
    n = draw(st.integers(1, 40))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    t = 1.7e9 + np.concatenate([[0.0], np.cumsum(np.exp(rng.uniform(math.log(4), math.log(1800), n)))])
    angle = rng.uniform(0, 2 * math.pi, n)
    heading = np.column_stack([np.cos(angle), np.sin(angle)]) * (rng.random((n, 1)) > 0.2)
    velocity = rng.normal(0.0, 0.4, (n, 2)) * moving
    x = np.vstack([np.zeros(2), np.cumsum(velocity * np.diff(t)[:, None], axis=0)])
    return t, x, heading


@st.composite
def states(draw):
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    state = init(float(rng.normal(0.25, 0.1)), len(CENTRES))
    return replace(
        state, e=readonly(rng.normal(0, 50, 2)), xi=readonly(rng.normal(0, 0.2, (2, len(CENTRES))))
    )


def distance(state, params):
    """Square root of twice the Lyapunov function (001 eq. 16) for no flow and no speed, m/s of error as m."""
    flow = float(np.sum(state.xi**2)) / params.gamma
    speed = state.speed**2 / params.rate_of_speed
    return math.sqrt(float(state.e @ state.e) + flow + speed)


@given(states(), tracks(), gains())
def test_the_error_is_bounded_by_the_way_gone(state, track, params):
    x = track[1]
    after, info = advance(state, *track, params.basis(CENTRES), params)
    way = float(np.hypot(*np.diff(x, axis=0).T).sum())
    bound = (distance(state, params) + way) * (1 + 1e-9)
    assert info.clle_max <= bound
    assert distance(after, params) <= bound


@given(states(), tracks(moving=False), gains())
def test_without_motion_the_lyapunov_function_never_grows(state, track, params):
    """Whatever the spacing, the gains and the headings: no step is unstable."""
    t, x, heading = track
    for i in range(len(heading)):
        before = distance(state, params)
        state, _ = advance(
            state, t[i : i + 2], x[i : i + 2], heading[i : i + 1], params.basis(CENTRES), params
        )
        assert distance(state, params) <= before * (1 + 1e-9)


@given(states(), states(), tracks(), gains(), numbers(-2.0, 2.0))
def test_superposition(one, other, track, params, share):
    """On one track the end is an affine function of the start."""
    basis = params.basis(CENTRES)

    def blend(a, b):
        return AdaptiveState(
            e=readonly((1 - share) * a.e + share * b.e),
            e_delta=a.e_delta,
            xi=readonly((1 - share) * a.xi + share * b.xi),
            speed=(1 - share) * a.speed + share * b.speed,
            gram=a.gram,
            flown=a.flown,
        )

    want = blend(advance(one, *track, basis, params)[0], advance(other, *track, basis, params)[0])
    got, _ = advance(blend(one, other), *track, basis, params)
    scale = 1.0 + float(np.abs(want.e).max())
    assert np.allclose(got.e, want.e, rtol=1e-9, atol=1e-9 * scale)
    assert np.allclose(got.xi, want.xi, rtol=1e-9, atol=1e-9)
    assert math.isclose(got.speed, want.speed, rel_tol=1e-9, abs_tol=1e-9)


def through_json(state):
    text = msgspec.json.encode(state, enc_hook=np.ndarray.tolist)
    return msgspec.json.decode(text, type=AdaptiveState, dec_hook=lambda _, value: readonly(value))


@settings(max_examples=50)
@given(states(), tracks(), gains(), st.none() | numbers(0.1, 0.4))
def test_a_state_goes_through_json_between_any_two_steps(state, track, params, limit):
    t, x, heading = track
    params = replace(params, max_speed=limit)
    basis = params.basis(CENTRES)
    plain = stored = state
    for i in range(len(heading)):
        piece = t[i : i + 2], x[i : i + 2], heading[i : i + 1]
        plain, info = advance(plain, *piece, basis, params)
        stored, info_too = advance(through_json(stored), *piece, basis, params)
        assert info.excitation == info_too.excitation
        for field in fields(plain):
            assert np.array_equal(getattr(plain, field.name), getattr(stored, field.name))
