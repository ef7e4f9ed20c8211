"""The flow by the currents of other gliders: the reference numbers of its basis, honesty, and who counts."""

from dataclasses import replace

import numpy as np
import pytest

from gliderwatch.fleet.flow import DiveCurrent, Dives, FlowCovariance, Sea, dives_between, fleet_flow
from gliderwatch.model import Fix
from gliderwatch.navigation.geodesy import from_plane
from streamfunction import SPREAD, basis

T0, HOUR = 1.7e9, 3600.0
AXIS = np.linspace(0, 1, 7)
CENTRES = np.stack(np.meshgrid(AXIS, AXIS, indexing="ij"), -1).reshape(-1, 2)


def fix(t: float, east: float, north: float) -> Fix:
    return Fix(T0 + t, *from_plane((east, north), 50.0, 179.9))  # across the antimeridian


def fleet(n: int, seed: int, hours: float = 48.0) -> list[tuple[str, Fix, Fix]]:
    """Dives of ``n`` gliders, 3 h each, that wander about in 40 km."""
    rng = np.random.default_rng(seed)
    out = []
    for k in range(n):
        at, t = rng.uniform(-20e3, 20e3, 2), rng.uniform(0, 3 * HOUR)
        while t < hours * HOUR:
            to = np.clip(at + rng.normal(0, 2e3, 2), -20e3, 20e3)
            out.append((f"g{k}", fix(t, *at), fix(t + 3 * HOUR, *to)))
            at, t = to, t + 3.2 * HOUR
    return out


SEA = Sea()


def drawn(dives: list[tuple[str, Fix, Fix]], seed: int) -> np.ndarray:
    """Currents ((n, 2)) of dives in a sea as the estimate takes it to be."""
    ends = dives_between([(a, b) for _, a, b in dives], dives[0][1])
    cov = FlowCovariance(ends, ends, 50.0).of(SEA)
    root = np.linalg.cholesky(cov + 1e-9 * np.eye(len(cov)))
    return (root @ np.random.default_rng(seed).normal(size=len(cov))).reshape(-1, 2)


def test_basis_at_a_place_and_time():
    u, v = basis(np.array([[0.3, 0.7]]), np.array([5 * HOUR]), CENTRES)
    assert u.shape == v.shape == (1, 75)
    assert np.square(u).sum() == pytest.approx(4.569251, abs=5e-7)
    assert np.square(v).sum() == pytest.approx(4.569251, abs=5e-7)
    # 4.142570 by periods of fewer digits
    assert u.sum() + v.sum() == pytest.approx(4.142570, abs=3e-6)


def test_eddies_bring_no_water_from_nowhere():
    at, d = np.array([[0.31, 0.62]]), 1e-6
    n = len(CENTRES)
    east = [basis(at + np.array([s * d, 0]), np.zeros(1), CENTRES)[0][0, :n] for s in (1, -1)]
    north = [basis(at + np.array([0, s * d]), np.zeros(1), CENTRES)[1][0, :n] for s in (1, -1)]
    assert np.abs((east[0] - east[1] + north[0] - north[1]) / (2 * d)).max() < 1e-6


def test_eddies_are_those_of_the_basis_with_gaussians_everywhere():
    """Without drift of time: covariance of the closed form against the sum over a wide, dense grid."""
    grid, scale = np.arange(-1.5, 2.51, 1 / 12), 60e3
    centres = np.stack(np.meshgrid(grid, grid, indexing="ij"), -1).reshape(-1, 2)
    places = np.array([[0.4, 0.5], [0.55, 0.62], [0.3, 0.7]])
    rows = np.stack([part[:, : len(centres)] for part in basis(places, np.zeros(3), centres)], 1)
    rows = rows.reshape(6, -1)
    dives = Dives(places * scale, np.zeros(3), np.ones(3))
    nothing = Sea(eddy=0.0, reach=scale * np.sqrt(2 * SPREAD), gradient=0.0, inertial=0.0)
    cov = FlowCovariance(dives, dives, 50.0)
    found = cov.of(replace(nothing, eddy=1.0)) - cov.of(nothing)
    summed = rows @ rows.T
    np.testing.assert_allclose(found, summed / summed[0, 0], atol=1e-6)


def test_error_is_what_it_says_and_falls_with_the_number_of_neighbours():
    errors, ratios = {}, []
    for n in (2, 8):
        off, seeds = [], 8
        for seed in range(seeds):
            dives = fleet(n + 1, seed)
            truth = drawn(dives, seed)
            noise = np.random.default_rng(seed + 99).normal(0, 0.02, truth.shape)
            currents = [DiveCurrent(g, a, b, *(truth + noise)[k]) for k, (g, a, b) in enumerate(dives)]
            for k in [k for k, (g, *_) in enumerate(dives) if g == "g0"][-4:]:
                found = fleet_flow(currents, *dives[k], SEA)
                assert found is not None and "g0" not in found.gliders
                error = found.flow - truth[k]
                off.append(error)
                ratios.append(error @ np.linalg.solve(found.cov, error))
        errors[n] = np.sqrt(np.mean(np.square(off)))
    assert errors[8] < 0.75 * errors[2]
    assert 1.5 < np.mean(ratios) < 2.7  # chi square of two


def test_a_constant_current_is_found_by_one_neighbour():
    dives = fleet(2, 3)
    currents = [DiveCurrent(g, a, b, 0.12, -0.05) for g, a, b in dives]
    found = fleet_flow(currents, *dives[12], SEA)
    assert found is not None
    assert found.flow == pytest.approx([0.12, -0.05], abs=2 * np.sqrt(found.cov[0, 0]))
    assert found.gliders == ("g1",)


def test_order_does_not_matter():
    dives = fleet(4, 1)
    truth = drawn(dives, 1)
    currents = [DiveCurrent(g, a, b, *truth[k]) for k, (g, a, b) in enumerate(dives)]
    one, other = (fleet_flow(each, *dives[12], SEA) for each in (currents, currents[::-1]))
    np.testing.assert_array_equal(one.flow, other.flow)
    np.testing.assert_array_equal(one.cov, other.cov)


def test_no_neighbour_near_no_reference():
    alone = [DiveCurrent("g1", fix(0, 90e3, 0), fix(3 * HOUR, 91e3, 0), 0.1, 0.1)]
    assert fleet_flow(alone, "g0", fix(0, 0, 0), fix(3 * HOUR, 1e3, 0), SEA) is None
    old = [DiveCurrent("g1", fix(-11 * 86400, 9e3, 0), fix(-11 * 86400 + 9e3, 9e3, 0), 0.1, 0.1)]
    assert fleet_flow(old, "g0", fix(0, 0, 0), fix(3 * HOUR, 1e3, 0), SEA) is None


def test_a_doubtful_speed_counts_less_along_its_course():
    a, b = fix(0, 0, 0), fix(3 * HOUR, 1e3, 0)
    near = DiveCurrent("g1", fix(0, 1e3, 0), fix(3 * HOUR, 2e3, 0), 0.1, 0.1, course=(1.0, 0.0), along=0.5)
    found = fleet_flow([near], "g0", a, b, SEA)
    assert found.flow[0] < 0.75 * found.flow[1]
    assert found.cov[0, 0] > 5 * found.cov[1, 1]
