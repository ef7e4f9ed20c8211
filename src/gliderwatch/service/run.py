"""A run of segments of one glider, processed one after another: a value in, a value out. Pure.

What is to be processed is read from the state file, processed while nobody's write waits for it, and
committed if by then the same is to be processed (`service.transaction`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from gliderwatch.errors import GliderwatchError, NotAssessed
from gliderwatch.model import Segment
from gliderwatch.params import GliderParams
from gliderwatch.pipeline import GliderState, Outcome, process
from gliderwatch.sea.ocean_field import Field
from gliderwatch.store.codec import encode
from gliderwatch.store.segments import Plan


@dataclass(frozen=True, slots=True)
class Run:
    """A plan with all that it needs: the state after its base, its segments with what calls add to them."""

    plan: Plan
    state: GliderState
    segments: tuple[Segment, ...]


@dataclass(frozen=True, slots=True)
class Processed:
    """The outcome of each segment of a plan, and the state to be kept after each: as it is, as its record, or
    None. The outcomes of a worker have no state but the last."""

    plan: Plan
    outcomes: tuple[Outcome, ...]
    states: tuple[GliderState | bytes | None, ...]


class StoppedError(GliderwatchError):
    """The daemon ends while an input is processed: nothing of it is kept, the next start processes it."""


def processed(
    run: Run, params: GliderParams, ocean: Field | None, stopping: Callable[[], bool] = lambda: False
) -> Processed:
    """Process a run. Raises NotAssessed for a segment that cannot be assessed, StoppedError once `stopping`
    holds."""
    state, outcomes = run.state, list[Outcome]()
    for segment in run.segments:
        if stopping():
            raise StoppedError(f"{segment.id.name} was not processed: the daemon ends")
        outcomes.append(_outcome(state, segment, params, ocean))
        state = outcomes[-1].state
    return Processed(run.plan, tuple(outcomes), tuple(outcome.state for outcome in outcomes))


def processed_for_another(run: Run, params: GliderParams, is_kept: Sequence[bool]) -> Processed:
    """Process a run in a worker: what is not to be kept is not sent back."""
    done = processed(run, params, None)
    *before, last = done.outcomes
    records = [encode(one.state) if kept else None for one, kept in zip(before, is_kept, strict=False)]
    bare = [replace(one, state=GliderState()) for one in before]
    return Processed(run.plan, (*bare, last), (*records, last.state))


def _outcome(state: GliderState, segment: Segment, params: GliderParams, ocean: Field | None) -> Outcome:
    """`process`, in which one segment of unforeseen content must not stop all gliders for good."""
    try:
        return process(state, segment, params, ocean)
    except Exception as error:
        what = f"{type(error).__name__}: {error}"
        raise NotAssessed(f"cannot be assessed, please report it ({segment.id.name}: {what})") from error
