"""The estimator that the settings choose, and the reference flow that it is compared with."""

from dataclasses import replace

import numpy as np
import pytest

from gliderwatch.estimation.glider import Estimate, step
from gliderwatch.model import Assessment, Dive, readonly
from gliderwatch.params import GliderParams
from gliderwatch.sea.ocean_field import Field
from joint_support import DAY, LAT, LON, START, mission, ways

STRAIGHT = mission(ways(16, 3, lambda k: 0.4 * k))


def told(dives: list[Dive], ocean: Field | None = None, **params: object) -> list[Assessment]:
    state, out = Estimate(), []
    for dive in dives:
        state, assessment = step(state, dive, replace(GliderParams(), **params), "digest", ocean=ocean)
        out.append(assessment)
    return out


def field(u: float, v: float, days: float = 4.0) -> Field:
    """The same current everywhere, around the dives and for some days."""
    shape = (2, 1, 2, 2)
    return Field(
        t=readonly([START - DAY, START + days * DAY]),
        depth=readonly([]),
        lat=readonly([LAT - 2, LAT + 2]),
        lon=readonly([LON - 2, LON + 2]),
        u=readonly(np.full(shape, u)),
        v=readonly(np.full(shape, v)),
        source="model.nc",
        stale=10 * DAY,
    )


@pytest.mark.parametrize("estimator", ["joint", "adaptive"])
def test_each_estimator_finds_a_healthy_glider_healthy(estimator):
    found = told(STRAIGHT, estimator=estimator)
    assert {a.flag for a in found[4:]} == {0}
    assert found[-1].speed == pytest.approx(0.23, abs=0.03)


def test_only_the_estimator_chosen_is_advanced():
    state = Estimate()
    for dive in STRAIGHT[:3]:
        state, _ = step(state, dive, GliderParams(), "digest")
    assert state.learner == Estimate().learner and state.speed.filter is not None
    state = Estimate()
    for dive in STRAIGHT[:3]:
        state, _ = step(state, dive, GliderParams(estimator="adaptive"), "digest")
    assert state.speed == Estimate().speed and state.learner.learner is not None


def test_the_uncertainty_of_the_speed_is_told():
    found = told(STRAIGHT)
    first, last = (found[k].evidence["speed_sigma"] for k in (0, -1))
    assert 0.003 < last < first < 0.1


@pytest.mark.parametrize("estimator", ["joint", "adaptive"])
def test_a_model_that_fits_is_told_of_and_flags_nothing(estimator):
    flow = np.mean([[d.current.u, d.current.v] for d in STRAIGHT], axis=0)
    found = told(STRAIGHT, field(*flow), estimator=estimator, reference="model")
    assert {a.flag for a in found[4:]} == {0}
    assert (found[5].reference_u, found[5].reference_v) == pytest.approx(tuple(flow))
    assert "reference flow: model.nc" in found[5].notes[-1]


def test_with_the_fleet_a_model_is_evidence_and_not_the_reference():
    own, both = told(STRAIGHT, None), told(STRAIGHT, field(0.1, -0.2), reference="fleet")
    last = both[-1]
    assert (last.evidence["model_u"], last.evidence["model_v"]) == pytest.approx((0.1, -0.2), abs=0.02)
    assert last.evidence["model_sigma"] > 0
    assert [each.flag for each in both] == [each.flag for each in own]
    assert (last.reference_u, last.reference_v) == (own[-1].reference_u, own[-1].reference_v)
    assert "model_u" not in told(STRAIGHT, None, reference="fleet")[-1].evidence


def test_a_model_that_does_not_fit_is_flag_2():
    found = told(STRAIGHT, field(-0.6, 0.5), reference="model")
    assert {a.flag for a in found} == {2}
    assert {a.reason for a in found} == {"the flow does not fit the reference"}


def test_a_model_that_says_nothing_is_a_note_and_no_flag():
    for ocean in (None, field(0.0, 0.0, days=-0.5)):
        found = told(STRAIGHT, replace(ocean, stale=1.0) if ocean else None, reference="model")
        assert {a.flag for a in found} == {0}
        assert all(a.reference_u is None and a.p_e is None for a in found)
        assert all(a.notes[-1].startswith("no reference flow: ") for a in found)


@pytest.mark.parametrize("reference", ["tides", "learnt"])
@pytest.mark.parametrize("estimator", ["joint", "adaptive"])
def test_a_forecast_as_the_reference(estimator, reference):
    found = told(STRAIGHT, estimator=estimator, reference=reference)
    assert found[0].reference_u is None and "no reference flow" in found[0].notes[-1]
    misses = [
        np.hypot(a.reference_u - d.current.u, a.reference_v - d.current.v)
        for a, d in zip(found[4:], STRAIGHT[4:], strict=True)
    ]
    assert np.median(misses) < 0.1
    assert not any(a.reference_u == d.current.u for a, d in zip(found[1:], STRAIGHT[1:], strict=True))


def test_a_slow_glider_stays_an_anomaly_whatever_the_model_says():
    slow = mission(ways(10, 3, lambda k: 0.4 * k) + ways(4, 3, lambda k: 0.4 * k, speed=0.1, own=0.11))
    found = told(slow, field(-0.6, 0.5), reference="model", speed_min=0.18, speed_max=0.3, speed_learnt=False)
    assert {a.flag for a in found[-3:]} == {1}
