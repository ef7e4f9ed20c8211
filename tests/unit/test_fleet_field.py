"""The field of a fleet: reference numbers of 003's basis, filter and stand-in; any order gives one field."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gliderwatch.fleet import scalar_field as sf
from gliderwatch.fleet.scalar_field import Batch, FieldParams, Information
from gliderwatch.simulate import stand_in

LITERAL = FieldParams("literal", deviation=1.0)
T0 = 1.7e9


def batch(k: int, hour: float, n: int = 12) -> Batch:
    rng = np.random.default_rng([7, k])
    t = T0 + hour * 3600 + 30.0 * np.arange(n)
    place = rng.uniform(0, 1, (n, 3))
    value = stand_in.temperature(place, t - T0)
    return Batch(f"b{k}", f"g{k % 3}", t, place, value, np.full(n, 30.0))


def test_basis_at_two_places():
    phi = sf.gaussians(np.array([[0.5, 0.5, 0.5], [0.21, 0.66, 0.93]]))
    assert phi.sum(axis=1) == pytest.approx([13.44254395, 11.05405573], abs=5e-9)
    assert phi[0, 171] == 1.0
    assert phi[1].argmax() == 83


def test_integrals_of_the_basis_over_the_box():
    m = sf.overlap(LITERAL)
    assert np.trace(m) == pytest.approx(4.43152862, abs=5e-9)
    assert m.max() == pytest.approx(0.02201024, abs=5e-9)
    assert m.sum() == pytest.approx(131.56149541, abs=5e-8)


def test_integrals_with_the_profile_are_those_of_the_rows():
    params = FieldParams()
    points = np.random.default_rng(0).uniform(0, 1, (20_000, 3))
    phi = sf.rows(points, params)
    assert np.abs(phi.T @ phi / len(points) - sf.overlap(params)).max() < 0.01


def test_prediction_of_a_random_walk():
    known = sf.predict(Information(2 * np.eye(2), np.array([2.0, 4.0])), np.ones(2), np.full(2, 0.5))
    assert known.d == pytest.approx(np.eye(2))
    assert known.coefficients()[0] == pytest.approx([1.0, 2.0])


def test_prediction_is_that_of_the_covariance():
    rng = np.random.default_rng(1)
    root = rng.normal(size=(5, 5))
    cov, mean = root @ root.T + np.eye(5), rng.normal(size=5)
    kept, noise = rng.uniform(0.3, 1, 5), rng.uniform(0.1, 2, 5)
    d = np.linalg.inv(cov)
    later = sf.predict(Information(d, d @ mean), kept, noise).coefficients()
    assert later[0] == pytest.approx(kept * mean)
    assert later[1] == pytest.approx(cov * np.outer(kept, kept) + np.diag(noise))


@pytest.mark.parametrize("params", [FieldParams(), LITERAL])
def test_two_waits_are_one(params):
    known = sf.run(None, [batch(0, 0.0)], params)[0].known
    twice = sf.elapse(sf.elapse(known, 3600.0, params), 7200.0, params)
    once = sf.elapse(known, 10800.0, params)
    assert twice.d == pytest.approx(once.d, rel=1e-7, abs=1e-7 * np.abs(once.d).max())


def test_without_samples_the_default_goes_back_to_what_was_before_any():
    params = FieldParams()
    known = sf.run(None, [batch(0, 0.0)], params)[0].known
    later = sf.elapse(known, 3e9, params)
    assert later.d == pytest.approx(sf.prior(params).d)


def test_sixty_scalar_updates_equal_one_batch():
    samples = batch(3, 0.0, 60)
    phi, r = sf.rows(samples.place, LITERAL), np.full(60, 0.05)
    mean, cov = sf.prior(LITERAL).coefficients()
    for row, value in zip(phi, samples.value, strict=True):
        gain = cov @ row / (row @ cov @ row + 0.05)
        mean, cov = mean + gain * (value - row @ mean), cov - np.outer(gain, row @ cov)
    at_once = sf.update(sf.prior(LITERAL), phi, samples.value, r).coefficients()
    assert np.abs(at_once[1] - cov).max() < 1e-12
    assert at_once[0] == pytest.approx(mean, abs=1e-11)


def test_stand_in_for_the_ocean_model():
    places = np.array([[0.1, 0.2, 0.3], [0.5, 0.5, 0.35], [0.79, 0.66, 0.05]])
    at_start, later = (stand_in.temperature(places, t) for t in (0.0, 48 * 3600.0))
    assert at_start == pytest.approx([6.232862, 1.205978, 6.710794], abs=5e-7)
    assert later == pytest.approx([4.406206, 1.381135, 8.029564], abs=5e-7)
    axis = np.linspace(0, 1, 30)
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1)
    assert np.sqrt(np.mean(stand_in.temperature(grid, 0.0) ** 2)) == pytest.approx(4.861444, abs=5e-7)


@settings(max_examples=4, deadline=None)
@given(st.permutations(range(5)))
def test_any_order_of_batches_ends_in_the_same_field(order):
    # the second and the third lie in one bin, the fourth in two
    batches = [batch(k, hour) for k, hour in enumerate((0.0, 2.1, 2.3, 3.95, 9.0))]
    params = FieldParams("literal")
    whole = sf.run(None, batches, params)
    kept: tuple[sf.Checkpoint, ...] = ()
    for n in range(1, 6):
        here = [batches[k] for k in order[:n]]
        first = int(here[-1].t[0] // sf.BIN)
        kept = tuple(c for c in kept if c.bin < first)
        kept += sf.run(kept[-1] if kept else None, here, params)
    assert [c.bin for c in kept] == [c.bin for c in whole]
    for a, b in zip(kept, whole, strict=True):
        np.testing.assert_array_equal(a.known.d, b.known.d)
        np.testing.assert_array_equal(a.known.g, b.known.g)


def test_a_field_is_found_with_its_profile_and_its_uncertainty():
    params = FieldParams()
    rng = np.random.default_rng(5)
    batches = []
    for k in range(30):
        place = rng.uniform(0, 1, (240, 3))
        t = T0 + 3600.0 * (k % 6) + np.arange(240)
        batches.append(
            Batch(f"{k}", "g", t, place, stand_in.temperature(place, 3 * 3600.0), np.full(240, 60.0))
        )
    last = sf.run(None, batches, params)[-1]
    points = rng.uniform(0, 1, (2000, 3))
    field, error = sf.estimate(sf.at(last, last.t, params), points, params)
    off = field - stand_in.temperature(points, 3 * 3600.0)
    assert np.sqrt(np.mean(off**2)) < 0.09 * 4.86
    assert 0.2 < np.mean(np.square(off / error)) < 1.5
