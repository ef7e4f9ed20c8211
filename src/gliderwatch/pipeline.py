"""The single path: a segment comes in, assessments and incidents come out. Pure.

Live and replayed missions go through `process` alike. State is a value: a segment that comes late is
put in its place by going on from the checkpoint of the segment before it.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cache

import msgspec

from gliderwatch.estimation.dive_measurement import are_apart
from gliderwatch.estimation.glider import Estimate, step
from gliderwatch.forecast.outlook import after_dive
from gliderwatch.forecast.surfacing import Surfacings, WaypointLog, read_waypoints
from gliderwatch.incidents.state_machine import RuleStates, advance, end_all
from gliderwatch.model import Assessment, Dive, Incident, NextSurfacing, Segment
from gliderwatch.navigation.dives import Navigation, extend
from gliderwatch.params import GliderParams
from gliderwatch.sea.ocean_field import Field


@dataclass(frozen=True, slots=True)
class Memory:
    """What is known of a glider after a dive: the estimate, the state of the rules, how it surfaces, and
    where and when it comes up next (None: cannot be said yet)."""

    estimate: Estimate = Estimate()
    rules: RuleStates = RuleStates()
    surfacings: Surfacings = Surfacings()
    expected: NextSurfacing | None = None

    def open(self) -> tuple[Incident, ...]:
        """The incidents that are open."""
        return self.rules.open()


@dataclass(frozen=True, slots=True)
class GliderState:
    """All that is known of one glider after a segment: the checkpoint.

    ``settled`` is the memory after all dives but the last one, ``last`` that dive, ``assessment`` its
    assessment and ``changed`` the incidents that it changed, ``memory`` the memory after it. When the current
    of the last dive is corrected, that dive is assessed again from ``settled``.
    """

    navigation: Navigation = Navigation()
    settled: Memory = Memory()
    last: Dive | None = None
    assessment: Assessment | None = None
    changed: tuple[Incident, ...] = ()
    memory: Memory = Memory()
    waypoints: WaypointLog = ()


@dataclass(frozen=True, slots=True)
class Outcome:
    """What one segment leads to.

    ``assessments`` replace all of dives that began at ``since`` (s) or later; ``incidents`` replace all that
    were opened after it, and the earlier ones of the same id. ``expected`` is the next surfacing.
    """

    state: GliderState
    since: float
    assessments: tuple[Assessment, ...]
    incidents: tuple[Incident, ...]
    expected: NextSurfacing | None


@cache
def digest(params: GliderParams) -> str:
    """A short hash of all parameters, to be kept with what they led to."""
    return hashlib.sha256(msgspec.json.encode(params, order="sorted")).hexdigest()[:12]


def process(
    state: GliderState, segment: Segment, params: GliderParams, ocean: Field | None = None
) -> Outcome:
    """Advance one glider by one segment; segments must come in the order of their ids.

    ``ocean`` is the field of an ocean model or a radar, where the reference flow is to be taken from one.
    """
    navigation, dives = extend(state.navigation, segment)
    key = digest(params)
    settled, last, assessment, memory = state.settled, state.last, state.assessment, state.memory
    assessments = {assessment.t_dive: assessment} if assessment is not None else {}
    incidents = {i.id: i for i in settled.open()}
    waypoints = read_waypoints(state.waypoints, segment)
    changed = {i.id: i for i in state.changed}
    for dive in dives:
        if dive.end is None:  # not surfaced yet: assessed, not learnt from
            assessments[dive.t_dive] = step(memory.estimate, dive, params, key)[1]
            continue
        if last is None or dive.t_dive != last.t_dive:
            incidents |= changed
            settled = memory
        last = dive
        memory, assessment, opened = _after(settled, dive, waypoints, params, key, ocean)
        changed = {i.id: i for i in opened}
        assessments[dive.t_dive] = assessment
    since = state.last.t_dive if state.last is not None else float("-inf")
    return Outcome(
        GliderState(navigation, settled, last, assessment, tuple(changed.values()), memory, waypoints),
        since,
        tuple(assessments.values()),
        tuple((incidents | changed).values()),
        memory.expected,
    )


def _after(
    before: Memory,
    dive: Dive,
    waypoints: WaypointLog,
    params: GliderParams,
    key: str,
    ocean: Field | None,
) -> tuple[Memory, Assessment, tuple[Incident, ...]]:
    """The memory after one more dive that ended, what is said of the dive, and the incidents it changed."""
    over: tuple[Incident, ...] = ()
    last, begun = before.surfacings.fix, dive.start or dive.end
    if last is not None and begun is not None and are_apart(last, begun):
        # another deployment, another sea and perhaps another trim: what was open on the last one is over
        over, before = end_all(before.rules, dive.t_dive), Memory()
    frozen = bool(before.open())
    estimate, assessment = step(before.estimate, dive, params, key, frozen, ocean)
    rules, changed = advance(before.rules, assessment, params.rules)
    surfacings, expected = after_dive(
        before.surfacings, dive, waypoints, estimate, before.expected, params.surfacing_hours
    )
    return Memory(estimate, rules, surfacings, expected), assessment, over + changed
