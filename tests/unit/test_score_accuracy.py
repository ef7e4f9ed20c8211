"""Forecasts of the next surfacing beside what came."""

from dataclasses import replace

import numpy as np
import pytest

from alert_support import HEALTHY
from gliderwatch.model import Assessment, NextSurfacing
from gliderwatch.navigation.geodesy import from_plane
from gliderwatch.score.accuracy import next_scores, results
from unit.test_score_measures import glider

HOUR = 3600.0
LAT, LON = 27.5, -84.0


def dive(k: int, east: float, **evidence: float) -> Assessment:
    """The ``k``-th dive of 3 h, with a fix two minutes after it, ``east`` metres from the start."""
    lat, lon = from_plane(np.array([east, 0.0]), LAT, LON)
    t = k * 3 * HOUR
    evidence = {"fix_gap_minutes": 2.0} | evidence
    return replace(HEALTHY, t_dive=t, t_surface=t + 2.8 * HOUR, lat=lat, lon=lon, evidence=evidence)


def fix(k: int) -> float:
    return k * 3 * HOUR + 2.8 * HOUR + 120.0


def said(k: int, east: float, late: float = 0.0, sigma: float = 300.0) -> NextSurfacing:
    """What was said after the ``k``-th dive: the next fix is ``east`` of the start (m)."""
    lat, lon = from_plane(np.array([east, 0.0]), LAT, LON)
    return NextSurfacing(fix(k), fix(k + 1) - late, 600.0, lat, lon, sigma**2, 0.0, sigma**2, "test")


DIVES = [dive(0, 0.0), dive(1, 1000.0), dive(2, 3000.0), dive(3, 3500.0)]


def test_errors_of_place_and_time():
    [first, second] = results([said(1, 2500.0, late=300.0), said(2, 5000.0, late=-1800.0)], DIVES)
    assert (first.late, first.miss, first.persistence) == pytest.approx((300.0, 500.0, 1000.0), rel=1e-3)
    assert first.in_ellipse and first.in_time  # 500 m of 300 m a component: 1.67 standard errors
    late = (second.late, second.miss, second.persistence)
    assert late == pytest.approx((-1800.0, 1500.0, 1500.0), rel=1e-3)
    assert not second.in_ellipse and not second.in_time


def test_what_was_said_first_counts():
    [only] = results([said(1, 2500.0), said(1, 3000.0)], DIVES)
    assert only.miss == pytest.approx(500.0, rel=1e-3)


def test_what_files_do_not_tell_is_left_out():
    forecasts = [said(1, 2500.0), said(2, 3500.0)]
    assert len(results(forecasts, DIVES)) == 2
    assert len(results(forecasts, DIVES, until=fix(2))) == 1
    hidden = [*DIVES[:3], dive(3, 3500.0, unobserved_h=1.0)]
    assert len(results(forecasts, hidden)) == 1
    without = [DIVES[0], DIVES[1], replace(DIVES[2], lat=None), DIVES[3]]
    assert results(forecasts, without) == ()


def test_the_score_is_the_mean_of_a_sea():
    found = results([said(1, 2500.0), said(2, 5000.0)], DIVES)
    calm, tidal = (glider(sea=sea, next=found) for sea in ("calm", "tidal"))
    scores = next_scores([calm, replace(calm, size=9.0), tidal])  # sizes of a fault share the days before
    assert [(s.sea, s.forecasts) for s in scores] == [("calm", 2), ("tidal", 2)]
    assert scores[0].miss.value == pytest.approx(1000.0, rel=1e-3)
    assert (scores[0].in_ellipse, scores[0].in_time) == (0.5, 1.0)
