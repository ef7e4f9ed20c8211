"""What full files show otherwise than those that were sent: when an incident could be known, and was.

Pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gliderwatch.archive.onset import Onset
from gliderwatch.model import Assessment

SAME = 600.0
"""s: dives of full files and of files as sent that begin so near to each other are one dive."""
SAME_EVENT = 86400.0
"""s: an incident by files as sent that began longer than this before one by full files is another one."""


@dataclass(frozen=True, slots=True)
class Found:
    """An incident: its ``kind``, ``since`` (s, the first dive in it), ``opened_at`` (s, the surfacing at
    which a pilot would have known) and ``cleared_at`` (s, None: open at the end).

    ``on_shore`` (s) is when the file was there that made it known, ``out`` (s) since when the speed that the
    papers' law learns along the track was out of its range, ``onset`` what the samples of full files show;
    None where that is not known.
    """

    kind: str
    since: float
    opened_at: float
    cleared_at: float | None
    on_shore: float | None = None
    out: float | None = None
    onset: Onset | None = None

    @property
    def event(self) -> float:
        """When it began (s), by the best that is known."""
        return self.onset.t if self.onset is not None else self.since


@dataclass(frozen=True, slots=True)
class Delay:
    """An incident by ``full`` files, and the same one by files as ``sent`` (None: they did not show it).
    ``already`` is since when (s) those had an earlier one open then, which is not the same."""

    full: Found
    sent: Found | None
    already: float | None

    @property
    def later(self) -> float | None:
        """How much later (h) the files as sent opened it, surfacing for surfacing."""
        return None if self.sent is None else (self.sent.opened_at - self.full.opened_at) / 3600

    @property
    def after(self) -> float | None:
        """How long (h) after it began it was known on shore by the files as sent."""
        at = None if self.sent is None else self.sent.on_shore or self.sent.opened_at
        return None if at is None else (at - self.full.event) / 3600


@dataclass(frozen=True, slots=True)
class Difference:
    """What full files show otherwise than those that were sent: ``dives`` that both have, root mean square of
    the difference of ``speed`` and of a component of the ``current`` (m/s, None: no dive has both), and the
    ``delays`` of the incidents of the full files."""

    dives: int
    speed: float | None
    current: float | None
    delays: tuple[Delay, ...]


def compare(
    full: Sequence[Assessment],
    online: Sequence[Assessment],
    by_full: Sequence[Found],
    by_sent: Sequence[Found],
) -> Difference:
    """The difference between the dives and incidents of full files and of those as sent."""
    pairs = same_dives(full, online)
    speed = [a.speed - b.speed for a, b in pairs if a.speed is not None and b.speed is not None]
    current = [
        x - y
        for a, b in pairs
        for x, y in ((a.flow_u, b.flow_u), (a.flow_v, b.flow_v))
        if x is not None and y is not None
    ]
    return Difference(len(pairs), _rms(speed), _rms(current), delays(by_full, by_sent))


def same_dives(
    some: Sequence[Assessment], others: Sequence[Assessment]
) -> list[tuple[Assessment, Assessment]]:
    """The dives that are in both, each with itself."""
    starts = np.array([dive.t_dive for dive in others])
    out = []
    for dive in some:
        if (
            len(starts)
            and abs(starts[i := int(np.argmin(np.abs(starts - dive.t_dive)))] - dive.t_dive) < SAME
        ):
            out.append((dive, others[i]))
    return out


def delays(full: Sequence[Found], online: Sequence[Found]) -> tuple[Delay, ...]:
    """Each incident by full files with the one by files as sent that is the same.

    That is of its kind, began while it lasted or at most `SAME_EVENT` before, and is the nearest such that no
    other has. One that was open long before tells nothing of it, whenever it was opened.
    """
    left, out = list(online), list[Delay]()
    for one in full:
        kind = [other for other in left if other.kind == one.kind]
        same = [o for o in kind if one.since - SAME_EVENT <= o.since <= _end(one)]
        sent = min(same, key=lambda other: abs(other.since - one.since), default=None)
        if sent is not None:
            left.remove(sent)
        open_then = [o.since for o in online if o.kind == one.kind and o.opened_at < one.opened_at <= _end(o)]
        out.append(Delay(one, sent, min(open_then, default=None) if sent is None else None))
    return tuple(out)


def _end(one: Found) -> float:
    return np.inf if one.cleared_at is None else one.cleared_at


def _rms(values: Sequence[float]) -> float | None:
    return float(np.sqrt(np.mean(np.square(values)))) if values else None
