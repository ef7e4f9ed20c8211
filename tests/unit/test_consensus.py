"""Consensus of 003: its weights, and what an exchange makes of information."""

import numpy as np
import pytest

from gliderwatch.papers.consensus import agree, metropolis

STAR = np.array([[False, False, True], [False, False, True], [True, True, False]])


def test_metropolis_weights_of_a_relay_with_two_gliders():
    literal = [[0.75, 0, 0.25], [0, 0.75, 0.25], [0.25, 0.25, 0.5]]
    usual = [[2 / 3, 0, 1 / 3], [0, 2 / 3, 1 / 3], [1 / 3, 1 / 3, 1 / 3]]
    assert metropolis(STAR) == pytest.approx(np.array(literal))
    assert metropolis(STAR, counts_itself=False) == pytest.approx(np.array(usual))


def test_two_nodes_weigh_each_other_by_a_third_or_a_half():
    pair = ~np.eye(2, dtype=bool)
    assert metropolis(pair)[0, 1] == pytest.approx(1 / 3)
    assert metropolis(pair, counts_itself=False)[0, 1] == pytest.approx(0.5)


def test_nodes_agree_on_the_mean_of_what_they_know():
    rng = np.random.default_rng(0)
    d, g = tuple(rng.normal(size=(3, 4, 4))), tuple(rng.normal(size=(3, 4)))
    mean_d, mean_g = np.mean(d, axis=0), np.mean(g, axis=0)
    for _ in range(80):
        d, g = agree(d, g, metropolis(STAR))
    assert d[0] == pytest.approx(mean_d)
    assert g[2] == pytest.approx(mean_g)


def test_who_is_alone_keeps_what_it_knows():
    d, g = (np.eye(2), 2 * np.eye(2)), (np.ones(2), np.zeros(2))
    after = agree(d, g, metropolis(np.zeros((2, 2), dtype=bool)))
    np.testing.assert_array_equal(after[0][1], d[1])
    np.testing.assert_array_equal(after[1][0], g[0])
