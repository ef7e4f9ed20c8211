"""Any order of arrival, with duplicates and broken-off copies, ends in exactly the same state."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gliderwatch.estimation.glider import Estimate, step
from gliderwatch.incidents.state_machine import RuleStates, advance
from gliderwatch.model import Assessment, Incident, Segment
from gliderwatch.navigation.dives import Navigation, extend
from gliderwatch.params import AnomalyRule, FalseAlarmRule, GliderParams, RuleParams
from gliderwatch.pipeline import digest
from gliderwatch.service.routing import Routing
from gliderwatch.service.transaction import tick
from gliderwatch.store import codec, segments
from missions import REAL, Ending, Leg, cut, ending, feed, mission, real

EAGER = GliderParams(
    speed_min=0.25,
    speed_max=0.35,
    speed_learnt=False,
    estimator="adaptive",
    gamma_f=0.15,
    rules=RuleParams(anomaly=AnomalyRule(open_after=1, clear_after=1), false_alarm=FalseAlarmRule(1, 1)),
)
"""So easily alarmed that incidents come and go."""


LONG = ("electa-2022", "george-2024", "maria-2022", "usf-sam-2019")


def assert_same(found: Ending, expected: Ending) -> None:
    """Equal to the last bit."""
    assert [codec.plain_encode(a) for a in found.assessments] == [
        codec.plain_encode(a) for a in expected.assessments
    ]
    assert [codec.plain_encode(i) for i in found.incidents] == [
        codec.plain_encode(i) for i in expected.incidents
    ]
    assert found.state == expected.state


legs = st.builds(
    Leg,
    speed=st.sampled_from([0.3, 0.3, 0.28, 0.1, 0.45]),
    heading=st.floats(0.0, 6.28),
    current=st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3)),
    hours=st.sampled_from([0.15, 0.4, 2.0, 3.0, 6.0]),
    first_error=st.floats(-0.1, 0.1),
    final_error=st.sampled_from([0.0, 0.0, 0.4]),
)


@st.composite
def arrivals(draw) -> tuple[list[Segment], list[Segment]]:
    """A mission, whose parts may be missing, and an order in which all that there is of it arrives."""
    made = mission(draw(st.lists(legs, min_size=2, max_size=9)), with_final=draw(st.booleans()))
    there = draw(st.lists(st.sampled_from(range(len(made))), min_size=1, unique=True).map(sorted))
    if draw(st.integers(0, 3)):
        there = list(range(len(made)))
    whole = [made[i] for i in there]
    copies = list(whole)
    for s in draw(st.lists(st.sampled_from(whole), max_size=4)):
        end = draw(st.floats(0.0, 1.0))
        copies.append(s if end > 0.9 else cut(s, s.id.opened_at + end * (s.last_t - s.id.opened_at)))
    return whole, draw(st.permutations(copies))


@settings(max_examples=30, suppress_health_check=[HealthCheck.too_slow])
@given(arrivals(), st.sampled_from([GliderParams(), EAGER]))
def test_any_order_of_a_mission(there, params):
    whole, order = there
    assert_same(ending(feed(order, params), "unit"), ending(feed(whole, params), "unit"))


def in_one_go(segments: list[Segment], params: GliderParams) -> tuple[list[Assessment], list[Incident]]:
    """Estimator and rules over the dives as they are known in the end, each taken once."""
    navigation, dives = Navigation(), {}
    for s in segments:
        navigation, told = extend(navigation, s)
        since = min((d.t_dive for d in told), default=math.inf)
        dives = {t: d for t, d in dives.items() if t < since or d.end is not None}
        dives |= {d.t_dive: d for d in told}
    estimate, watches, assessments, incidents = Estimate(), RuleStates(), [], {}
    for t in sorted(dives):
        estimate, assessment = step(estimate, dives[t], params, digest(params), bool(watches.open()))
        watches, found = advance(watches, assessment, params.rules)
        assessments.append(assessment)
        incidents |= {i.id: i for i in found}
    return assessments, sorted(incidents.values(), key=lambda i: (i.opened_at, i.id))


@settings(max_examples=30, suppress_health_check=[HealthCheck.too_slow])
@given(arrivals(), st.sampled_from([GliderParams(), EAGER]))
def test_taking_back_and_going_on_comes_to_the_same_as_in_one_go(there, params):
    """A current corrected later, a dive told again: nothing is learnt twice, no incident is left over."""
    whole, order = there
    assessments, incidents = in_one_go(whole, params)
    store = feed(order, params)
    assert store.assessments("unit") == assessments
    assert store.incidents("unit") == incidents


@pytest.fixture
def thinned(monkeypatch):
    """Two checkpoints are kept of the newest segments, some of the next, and hardly any of the older ones."""
    monkeypatch.setattr(segments, "RECENT", 2)
    monkeypatch.setattr(segments, "LATELY", 6)
    monkeypatch.setattr(segments, "CLOSE", 2)
    monkeypatch.setattr(segments, "SPARSE", 3)


@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(arrivals())
def test_any_order_with_few_checkpoints(thinned, there):
    whole, order = there
    assert_same(ending(feed(order, EAGER), "unit"), ending(feed(whole, EAGER), "unit"))


def test_few_checkpoints_are_kept(thinned):
    store = feed(mission([Leg(hours=1.0)] * 25)[::-1])
    kept = store._db.execute("SELECT count(*) FROM segments WHERE checkpoint IS NOT NULL").fetchone()[0]
    assert 2 + 3 <= kept <= 2 + 16  # one in two of 4, one in three of 19 older ones, as their names fall
    passing = store._db.execute(
        "SELECT count(*) FROM segments WHERE checkpoint IS NOT NULL AND NOT milestone"
    ).fetchone()[0]
    assert passing <= 2 + 4


def test_with_many_segments_old_checkpoints_go():
    """The numbers of the service."""
    store = feed(mission([Leg(hours=0.3)] * 200))
    kept = store._db.execute("SELECT count(*) FROM segments WHERE checkpoint IS NOT NULL").fetchone()[0]
    lately = segments.RECENT + 2 * (segments.LATELY - segments.RECENT) / segments.CLOSE
    assert segments.RECENT <= kept <= lately + 3 * (200 - segments.LATELY) / segments.SPARSE


@settings(max_examples=20, suppress_health_check=[HealthCheck.too_slow])
@given(arrivals())
def test_no_message_twice_in_any_order(there):
    """Said after each input: what is said differs with the order, but never twice."""
    whole, order = there
    spoken = Routing(channels=lambda alert: ["mail"], notices=lambda glider: True)
    store = feed(order, EAGER, spoken)
    ids = [a.id for a in store.alerts()]
    assert len(ids) == len(set(ids)) == len(store.undelivered())
    assert_same(ending(store, "unit"), ending(feed(whole, EAGER), "unit"))
    if (settles := store.notified("unit").settles) is not None:  # a change of mind waits for an hour
        tick(store, "unit", spoken, (), settles)
    open_now = {i.id for i in store.incidents("unit") if i.cleared_at is None}
    told = {
        t.reported.id
        for t in store.notified("unit").threads
        if not t.withdrawn and t.reported.cleared_at is None
    }
    assert told == open_now


def test_two_gliders_do_not_touch_each_other():
    one = mission([Leg(heading=k) for k in range(5)])
    other = [
        replace(s, id=replace(s.id, glider="other", name=s.id.name.replace("unit", "other")))
        for s in mission([Leg(heading=-k, speed=0.2) for k in range(5)])
    ]
    mixed = [s for pair in zip(one[::-1], other, strict=True) for s in pair]
    store = feed(mixed)
    assert_same(ending(store, "unit"), ending(feed(one), "unit"))
    assert_same(ending(store, "other"), ending(feed(other), "other"))


@pytest.mark.real
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if name in LONG else ()) for name in REAL]
)
def test_real_missions_in_any_order(shared_data, name, monkeypatch):
    """Shuffled, and newest first as some stations send them; with duplicates and broken-off copies.

    Newest first come those of the first 16 segments: each of them has all after it estimated again.
    """
    whole = real(shared_data, name)
    rng = np.random.default_rng(1)
    copies = list(whole)
    for i in rng.integers(0, len(whole), len(whole) // 4):
        s = whole[i]
        copies += [s, cut(s, s.id.opened_at + rng.uniform() * (s.last_t - s.id.opened_at))]
    glider = whole[0].id.glider
    shuffled = [copies[i] for i in rng.permutation(len(copies))]
    assert_same(ending(feed(shuffled, EAGER), glider), ending(feed(whole, EAGER), glider))
    monkeypatch.setattr(segments, "RECENT", 8)
    first = whole[:16]
    early = [s for s in copies if s.id <= first[-1].id]
    newest_first = sorted(early, key=lambda s: (s.id, s.completeness), reverse=True)
    assert_same(ending(feed(newest_first, EAGER), glider), ending(feed(first, EAGER), glider))
