import numpy as np
import pytest

from gliderwatch.forecast import timing
from gliderwatch.forecast.constants import LONGEST_ERROR


def test_one_odd_interval_leaves_no_trace_after_two_usual_ones():
    assert timing.usual([180.0, 40.0, 181.0, 180.0]) == pytest.approx(180.0, abs=1.0)


def test_a_new_interval_is_believed_at_its_second_time():
    assert timing.usual([120.0, 120.0, 120.0, 180.0]) == pytest.approx(150.0)
    assert timing.usual([120.0, 120.0, 180.0, 180.0]) == pytest.approx(180.0)


def test_only_the_last_four_count():
    assert timing.usual([1e6, 10.0, 10.0, 10.0, 10.0]) == 10.0


def test_error_is_alike_for_twice_and_half_and_bounded():
    assert timing.error(100.0, 200.0) == pytest.approx(timing.error(200.0, 100.0))
    assert timing.error(1.0, 1e6) == LONGEST_ERROR


def test_quantile_forgets():
    old_misses = [0.5] * 5 + [0.01] * 60
    assert timing.quantile(old_misses, [0.3], 0.2, 0.9) == 0.01
    assert timing.quantile(old_misses[::-1], [0.3], 0.2, 0.9) == 0.5


def test_a_glider_as_regular_as_clockwork_is_expected_more_sharply():
    assert timing.spread((0.003,) * 20) < 0.5 * timing.spread(())


@pytest.mark.parametrize("odd", [0.0, 0.1])
def test_interval_of_95_percent_holds_as_many(odd):
    """Regular surfacings, of which some come at any time: no normal distribution."""
    rng = np.random.default_rng(3)
    errors, inside = [], []
    for _ in range(800):
        error = min(abs(rng.normal(0, 0.03)) if rng.random() > odd else rng.uniform(0, 0.8), 1.0)
        inside.append(error < 1.96 * timing.spread(tuple(errors[-30:])))
        errors.append(error)
    assert 0.90 <= np.mean(inside) <= 0.99
