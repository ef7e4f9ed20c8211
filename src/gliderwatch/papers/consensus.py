"""Consensus of what nodes know of a field, as 003 has it: averages of (D, g) with Metropolis weights. Pure.

Kept for comparison: nodes that have met before share a past, and an average that does not know of it is
careful in the best case. `gliderwatch.fleet` exchanges the samples themselves.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gliderwatch.model import Array


def metropolis(links: NDArray[np.bool_], counts_itself: bool = True) -> Array:
    """Weights w ((n, n)) of nodes that are linked ((n, n), symmetric; its diagonal is not looked at) (003 eq.
    7).

    w_il = 1 / (1 + max(d_i, d_l)) between linked nodes, the rest of each row to the node itself. The paper's
    d_i counts the node itself; the usual degree does not.

    >>> metropolis(np.array([[False, True], [True, False]])).round(3).tolist()
    [[0.667, 0.333], [0.333, 0.667]]
    """
    joined = links & ~np.eye(len(links), dtype=np.bool_)
    degree = joined.sum(axis=1) + int(counts_itself)
    weights: Array = np.where(joined, 1 / (1.0 + np.maximum.outer(degree, degree)), 0.0)
    np.fill_diagonal(weights, 1 - weights.sum(axis=1))
    return weights


def agree(
    d: Sequence[Array], g: Sequence[Array], weights: Array
) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
    """One exchange: D_i <- sum_l w_il D_l and g_i <- sum_l w_il g_l (003 eqs. 5, 6) of all nodes at once.

    ``d`` are matrices ((L, L)), ``g`` vectors ((L,)), one a node; ``weights`` ((n, n)).
    """
    return _averages(d, weights), _averages(g, weights)


def _averages(values: Sequence[Array], weights: Array) -> tuple[Array, ...]:
    return tuple(
        sum((w * values[k] for k, w in enumerate(row) if w), np.zeros_like(values[0])) for row in weights
    )
