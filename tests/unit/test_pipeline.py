"""What a segment leads to: incidents, the next surfacing, another deployment."""

from dataclasses import replace

import numpy as np
import pytest

from gliderwatch.model import Segment, Series, readonly
from gliderwatch.params import GliderParams
from gliderwatch.pipeline import GliderState, Outcome, process
from missions import Leg, mission

HEALTHY = [Leg(heading=0.6 * k, hours=3) for k in range(8)]
SLOW = [Leg(heading=0.6 * k, hours=3, speed=0.1) for k in range(8, 12)]
MONTH = 30 * 86400.0


def run(segments: list[Segment], params: GliderParams | None = None) -> list[Outcome]:
    state, out = GliderState(), []
    for s in segments:
        out.append(process(state, s, params or GliderParams()))
        state = out[-1].state
    return out


def later(segment: Segment, by: float) -> Segment:
    """The same segment after some time (s)."""
    return replace(
        segment,
        id=replace(segment.id, opened_at=segment.id.opened_at + by, name=f"{segment.id.name}-later"),
        last_t=segment.last_t + by,
        quantities={k: Series(readonly(s.t + by), s.v) for k, s in segment.quantities.items()},
    )


def test_an_incident_opens_on_a_glider_that_slows_down():
    told = [i for outcome in run(mission(HEALTHY + SLOW)) for i in outcome.incidents]
    assert {i.kind for i in told} == {"anomaly"}
    assert told[-1].cleared_at is None and told[-1].last.reason


def test_what_was_open_is_over_when_another_deployment_begins():
    first = mission(HEALTHY + SLOW)
    second = [later(s, MONTH) for s in mission(HEALTHY)]
    outcomes = run(first + second)
    [opened] = {i.id for o in outcomes for i in o.incidents}
    last = [i for o in outcomes for i in o.incidents if i.id == opened][-1]
    assert last.cleared_at is not None and last.cleared_at > second[0].id.opened_at
    assert outcomes[-1].state.memory.rules.open() == ()
    # what is normal is learnt anew
    state = run(second)[-1].state
    assert outcomes[-1].state.memory.estimate.speed.normal.speeds.tolist() == pytest.approx(
        state.memory.estimate.speed.normal.speeds.tolist(), abs=1e-3
    )


def test_another_deployment_is_judged_as_if_it_were_the_first():
    """Whichever estimator: nothing of the sea, the speed or the trim is carried over."""
    for params in (GliderParams(), GliderParams(estimator="adaptive")):
        second = [later(s, MONTH) for s in mission(HEALTHY)]
        alone, after = run(second, params)[-1].state, run(mission(SLOW) + second, params)[-1].state
        speeds = [state.assessment.speed for state in (after, alone)]
        assert speeds[0] == pytest.approx(speeds[1], abs=1e-5)
        assert after.memory.estimate.learner.begun == pytest.approx(alone.memory.estimate.learner.begun)


def test_after_each_surfacing_the_next_one_is_expected():
    outcomes = run(mission(HEALTHY))
    dives = {a.t_dive: a for o in outcomes for a in o.assessments if a.lat is not None}
    expected = [o.expected for o in outcomes if o.expected is not None]
    assert len(expected) >= len(HEALTHY) - 2
    ends = sorted(a.t_surface for a in dives.values())
    misses = [np.min(np.abs(np.array(ends) - e.t)) for e in expected[3:-1]]
    assert max(misses) < 1800.0
    assert all(e.t > e.after and e.t_sigma > 0 and e.east > 0 and e.north > 0 for e in expected)
