import math

import numpy as np
import pytest

from gliderwatch.papers.basis import Basis, new_centres, phi

TWO = np.array([[0.0, 0.0], [3000.0, 4000.0]])


def basis(kernel):
    return Basis(TWO, np.array([1000.0, 2500.0]), np.array([1e-3, 0.0]), np.array([0.0, math.pi / 3]), kernel)


@pytest.mark.parametrize(
    ("kernel", "far"),
    [("exponential", math.exp(-5000 / 2000)), ("gaussian", math.exp(-(5000**2) / (2 * 1000**2)))],
)
def test_value_by_hand(kernel, far):
    values = phi(TWO[1], 500.0, basis(kernel))
    assert values == pytest.approx([far * math.cos(0.5), math.cos(math.pi / 3)], rel=1e-12)


@pytest.mark.parametrize("kernel", ["exponential", "gaussian"])
def test_both_kernels_are_exp_minus_half_at_sigma(kernel):
    one = Basis.uniform([[100.0, 0.0]], sigma=800.0, omega=0.0, nu=0.0, kernel=kernel)
    assert phi(np.array([100.0, 800.0]), 0.0, one)[0] == pytest.approx(math.exp(-0.5))


def test_many_points_at_once_equal_one_by_one():
    rng = np.random.default_rng(3)
    x, t = rng.normal(0, 5e3, (4, 5, 2)), rng.uniform(0, 1e6, (4, 5))
    many = phi(x, t, basis("gaussian"))
    assert many.shape == (4, 5, 2)
    for index in np.ndindex(4, 5):
        assert many[index] == pytest.approx(phi(x[index], t[index], basis("gaussian")), rel=1e-12)


def test_no_functions_give_no_values():
    assert phi(np.zeros((3, 2)), np.zeros(3), Basis.uniform([], 1.0, 0.0, 0.0)).shape == (3, 0)


def test_a_new_track_puts_its_first_centre_at_its_start():
    assert new_centres(np.empty((0, 2)), np.array([[5.0, 6.0], [7.0, 6.0]]), 10.0).tolist() == [[5.0, 6.0]]


def test_a_covered_track_adds_nothing():
    track = np.array([[0.0, 0.0], [10.0, 0.0]])
    assert new_centres(np.array([[0.0, 0.0]]), track, 10.0).shape == (0, 2)


def test_growth_covers_the_track_with_centres_apart():
    track = np.cumsum(np.random.default_rng(7).normal(0, 300.0, (400, 2)), axis=0)
    centres = new_centres(np.empty((0, 2)), track, 1000.0)
    distance = np.hypot(*(track[:, None] - centres[None]).transpose(2, 0, 1))
    assert distance.min(axis=1).max() <= 1000.0
    between = np.hypot(*(centres[:, None] - centres[None]).transpose(2, 0, 1))
    assert between[~np.eye(len(centres), dtype=bool)].min() > 1000.0


def test_growth_dive_by_dive_equals_growth_at_once():
    track = np.cumsum(np.random.default_rng(8).normal(0, 300.0, (300, 2)), axis=0)
    whole = new_centres(np.empty((0, 2)), track, 1500.0)
    grown = np.empty((0, 2))
    for piece in np.array_split(track, 17):
        grown = np.vstack([grown, new_centres(grown, piece, 1500.0)])
    assert grown.tolist() == whole.tolist()
