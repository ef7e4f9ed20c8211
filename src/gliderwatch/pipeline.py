"""The single path: a segment comes in, assessments and incidents come out. Pure.

Live and replayed missions go through `process` alike. State is a value: a segment that comes late is
put in its place by going on from the checkpoint of the segment before it.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import msgspec

from gliderwatch.estimation.glider import Estimate, step
from gliderwatch.model import Assessment, Dive, Incident, Segment
from gliderwatch.navigation.dives import Navigation, extend
from gliderwatch.params import GliderParams
from gliderwatch.rules.incident import Watches, judge


@dataclass(frozen=True, slots=True)
class Memory:
    """What is known of a glider after a dive: the estimate and the state of the rules."""

    estimate: Estimate = Estimate()
    watches: Watches = Watches()


@dataclass(frozen=True, slots=True)
class GliderState:
    """All that is known of one glider after a segment: the checkpoint.

    ``settled`` is the memory after all dives but the last one, ``last`` that dive, ``assessment`` and
    ``told`` what was said of it, ``memory`` the memory after it. When the current of the last dive is
    corrected, that dive is taken again from ``settled``.
    """

    navigation: Navigation = Navigation()
    settled: Memory = Memory()
    last: Dive | None = None
    assessment: Assessment | None = None
    told: tuple[Incident, ...] = ()
    memory: Memory = Memory()


@dataclass(frozen=True, slots=True)
class Outcome:
    """What one segment leads to.

    ``assessments`` replace all of dives that began at ``since`` (s) or later; ``incidents`` replace all that
    were opened after it, and the earlier ones of the same id.
    """

    state: GliderState
    since: float
    assessments: tuple[Assessment, ...]
    incidents: tuple[Incident, ...]


def digest(params: GliderParams) -> str:
    """A short hash of all parameters, to be kept with what they led to."""
    return hashlib.sha256(msgspec.json.encode(params, order="sorted")).hexdigest()[:12]


def process(state: GliderState, segment: Segment, params: GliderParams) -> Outcome:
    """Advance one glider by one segment; segments must come in the order of their ids."""
    navigation, dives = extend(state.navigation, segment)
    key = digest(params)
    settled, last, assessment, memory = state.settled, state.last, state.assessment, state.memory
    assessments = {assessment.t_dive: assessment} if assessment is not None else {}
    incidents = {i.id: i for i in settled.watches.open()}
    changed = {i.id: i for i in state.told}
    for dive in dives:
        if dive.end is None:  # not surfaced yet: worth telling, not worth learning from
            assessments[dive.t_dive] = step(memory.estimate, dive, params, key)[1]
            continue
        if last is None or dive.t_dive != last.t_dive:
            incidents |= changed
            settled = memory
        last = dive
        estimate, assessment = step(settled.estimate, dive, params, key)
        watches, told = judge(settled.watches, assessment, params.rules)
        memory, changed = Memory(estimate, watches), {i.id: i for i in told}
        assessments[dive.t_dive] = assessment
    since = state.last.t_dive if state.last is not None else float("-inf")
    return Outcome(
        GliderState(navigation, settled, last, assessment, tuple(changed.values()), memory),
        since,
        tuple(assessments.values()),
        tuple((incidents | changed).values()),
    )
