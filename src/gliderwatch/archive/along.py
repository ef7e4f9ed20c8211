"""The law of the papers along the whole track, between surfacings too: Figs. 4, 5, 7 of 000 and their like.
Pure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gliderwatch.estimation.adaptive import Learner, Prepared, learner_params, prepared, step
from gliderwatch.model import Array, Dive, readonly
from gliderwatch.navigation.geodesy import from_plane
from gliderwatch.papers.learner import advance
from gliderwatch.params import GliderParams

SPACING = 600.0
"""s: how far apart moments are at which the learner is looked at."""


@dataclass(frozen=True, slots=True)
class Along:
    """The learner at times ``t`` (s, (n,)): where the glider was (``true``) and where the learnt trajectory
    was (``learnt``; degrees, (n, 2): latitude, longitude), the ``error`` between (m, (n, 2): the CLLE), the
    ``flow`` (m/s, (n, 2)) and the ``speed`` V_L (m/s, (n,)). ``low`` and ``high`` (m/s, (n,)) are its normal
    range."""

    t: Array
    true: Array
    learnt: Array
    error: Array
    flow: Array
    speed: Array
    low: Array
    high: Array

    def since_out(self, until: float) -> float | None:
        """The time (s) since which the speed is out of its range at ``until`` (s); None where it is not."""
        last = int(self.t.searchsorted(until, "right")) - 1
        out = (self.speed < self.low) | (self.speed > self.high)
        if last < 0 or not out[last]:
            return None
        inside = np.flatnonzero(~out[:last])
        return float(self.t[inside[-1] + 1 if len(inside) else 0])


def along(dives: Sequence[Dive], params: GliderParams) -> Along | None:
    """The learner over the track of all dives in order of time; None where none has a track.

    A track in pieces gives what the whole gives, so that the ends of dives are as they were assessed.
    """
    state, rows = Learner(), list[tuple[float, ...]]()
    for dive in dives:
        ready = prepared(state, dive, params)
        if ready is not None:
            rows += _of_dive(dive, ready)
        state, _ = step(state, dive, params, "")
    if not rows:
        return None
    t, *rest = (readonly(column) for column in np.array(rows).T)
    true, learnt, error, flow = (readonly(np.stack(rest[i : i + 2], -1)) for i in range(0, 8, 2))
    return Along(t, true, learnt, error, flow, *rest[8:])


def _of_dive(dive: Dive, ready: Prepared) -> Iterator[tuple[float, ...]]:
    """A row for each moment: time, and what `Along` holds, in its order."""
    assert dive.track is not None
    assert dive.start is not None
    t, x, heading = dive.track.t, dive.track.x, dive.track.heading
    cuts = np.unique(t.searchsorted(np.append(np.arange(t[0] + SPACING, t[-1], SPACING), t[-1])))
    learner, gains = ready.learner, learner_params(ready.params)
    for i, j in pairwise([0, *cuts[cuts > 0].tolist()]):
        part = slice(i, j + 1)
        learner, info = advance(learner, ready.t[part], x[part], heading[i:j], ready.basis, gains)
        places = (from_plane(at, dive.start.lat, dive.start.lon) for at in (x[j], x[j] - learner.e))
        yield (
            float(t[j]),
            *(float(v) for place in places for v in place),
            *learner.e.tolist(),
            *info.flow.tolist(),
            info.speed,
            ready.params.speed_min,
            ready.params.speed_max,
        )
