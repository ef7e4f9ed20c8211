"""A run of segments of one glider, processed one after another: a value in, a value out. Pure.

What is to be processed is read from the state file, processed while nobody's write waits for it, and
committed if by then the same is to be processed (`service.transaction`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from gliderwatch.errors import GliderwatchError, NotAssessed
from gliderwatch.model import Segment
from gliderwatch.params import GliderParams
from gliderwatch.pipeline import GliderState, Outcome, process
from gliderwatch.sea.ocean_field import Field
from gliderwatch.store.segments import Plan


@dataclass(frozen=True, slots=True)
class Run:
    """A plan with all that it needs: the state after its base, its segments with what calls add to them."""

    plan: Plan
    state: GliderState
    segments: tuple[Segment, ...]


@dataclass(frozen=True, slots=True)
class Processed:
    """A run that was processed: the outcome of each of its segments."""

    run: Run
    outcomes: tuple[Outcome, ...]


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
    return Processed(run, tuple(outcomes))


def _outcome(state: GliderState, segment: Segment, params: GliderParams, ocean: Field | None) -> Outcome:
    """`process`, in which one segment of unforeseen content must not stop all gliders for good."""
    try:
        return process(state, segment, params, ocean)
    except Exception as error:
        what = f"{type(error).__name__}: {error}"
        raise NotAssessed(f"cannot be assessed, please report it ({segment.id.name}: {what})") from error
