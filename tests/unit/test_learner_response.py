"""The closed forms against the exponential of the same matrix, summed in 60 digits."""

from decimal import Decimal, localcontext

import numpy as np
import pytest

from gliderwatch.papers.learner import response


def exact(k, b, h):
    """a, c, q by Taylor's series of exp(M h), M of eps' = r - k eps, r' = -b eps, integral' = eps."""
    with localcontext() as context:
        context.prec = 60
        zero, one = Decimal(0), Decimal(1)
        k, b, h = Decimal(k), Decimal(b), Decimal(h)
        columns = []
        for start in ([one, zero, zero], [zero, one, zero]):
            term, total = start, list(start)
            for n in range(1, 200):
                eps, r, _ = term
                term = [v * h / n for v in (r - k * eps, -b * eps, eps)]
                total = [x + y for x, y in zip(total, term, strict=True)]
            columns.append(total)
        (a, _, c), (c_too, _, q) = columns
        assert abs(c - c_too) < Decimal("1e-30")
        return [float(v) for v in (a, c, q)]


@pytest.mark.parametrize(
    ("k", "b", "h"),
    [
        (0.003, 1e-6, 300.0),  # overdamped
        (0.003, 2e-3, 300.0),  # underdamped, many turns
        (0.003, 2.25e-6, 300.0),  # critical
        (0.003, 2.25e-6 * (1 + 1e-9), 300.0),
        (0.003, 2.25e-6 * (1 - 1e-4), 300.0),
        (0.003, 2.25e-6 * (1 + 1e-12), 300.0),
        (0.003, 2.25e-6 * (1 + 2e-3), 300.0),
        (0.003, 2.26e-6, 4.0),
        (0.003, 1e-6, 4.0),
        (0.003, 0.0, 300.0),
        (0.003, 1e-19, 4.0),
        (0.003, 1e-12, 300.0),
        (1.0, 0.8, 0.1),
        (1.0, 1e-8, 9.0),
    ],
)
def test_closed_form(k, b, h):
    a, c, q = response(k, np.array([b]), np.array([h]))[0]
    want = exact(k, b, h)
    assert [a, c] == pytest.approx(want[:2], rel=1e-12)
    assert q == pytest.approx(want[2], rel=2e-7)


def test_long_steps_settle():
    a, c, q = response(5.0, np.array([1.0]), np.array([1e6]))[0]
    # all velocity is explained: eps is gone, its integral is r/b
    assert [a, c, q] == pytest.approx([0.0, 0.0, 1.0], abs=1e-12)
