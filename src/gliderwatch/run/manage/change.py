"""What is another after a glider was assessed anew, and how it is told."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from gliderwatch.alerts.words import clean, utc
from gliderwatch.model import Assessment, Flag, Incident
from gliderwatch.rules.constants import SPEED_CHANGE
from gliderwatch.store.sqlite import Store

_MOST = 50
"""Dives and files named; the rest is counted."""
_WORDS = {Flag.NORMAL: "0 normal", Flag.ANOMALY: "1 anomaly", Flag.FALSE_ALARM: "2 measurements disagree"}


@dataclass(frozen=True, slots=True)
class Change:
    """What was, and what is after all was assessed anew.

    ``files`` and ``held`` count the files and the held segments it was made from. ``dives``: how many before
    and after. ``flags``: pairs of a dive before and after whose flag is another (None: no such dive).
    ``speeds`` counts dives whose speed is another. ``incidents``: pairs, likewise, of those that are another.
    """

    glider: str
    files: int
    held: int
    dives: tuple[int, int]
    flags: tuple[tuple[Assessment | None, Assessment | None], ...]
    speeds: int
    incidents: tuple[tuple[Incident | None, Incident | None], ...]
    problems: tuple[tuple[str, str], ...]

    @property
    def is_none(self) -> bool:
        """Whether nothing that a pilot sees is another."""
        return not (self.flags or self.speeds or self.incidents)


def compare(
    glider: str, old: Store, new: Store, used: tuple[int, int], problems: Sequence[tuple[str, str]]
) -> Change:
    """What two states say of a glider; `used`: how many files, how many held segments."""
    before = {a.t_dive: a for a in old.assessments(glider)}
    after = {a.t_dive: a for a in new.assessments(glider)}
    dives = [(before.get(t), after.get(t)) for t in sorted(before.keys() | after.keys())]
    was, now = ({i.id: i for i in store.incidents(glider)} for store in (old, new))
    pairs = [(was.get(key), now.get(key)) for key in sorted(was.keys() | now.keys())]
    return Change(
        glider,
        *used,
        (len(before), len(after)),
        tuple((a, b) for a, b in dives if a is None or b is None or a.flag != b.flag),
        sum(_is_faster(a, b) for a, b in dives if a is not None and b is not None),
        tuple((a, b) for a, b in pairs if a is None or b is None or _outline(a) != _outline(b)),
        tuple(problems),
    )


def _is_faster(a: Assessment, b: Assessment) -> bool:
    if a.speed is None or b.speed is None:
        return a.speed is not b.speed
    return abs(a.speed - b.speed) > SPEED_CHANGE


def _outline(i: Incident) -> tuple[object, ...]:
    return i.severity, i.since, i.opened_at, i.cleared_at, i.dives


def as_lines(change: Change) -> Iterator[str]:
    """The change in words, a line each."""
    made = f"{change.files} files" + (f" and {change.held} segments held" if change.held else "")
    yield f"{clean(change.glider)}: {change.dives[1]} dives from {made}, {change.dives[0]} before"
    yield from _first([f"  {clean(path, 500)}: {clean(why)}" for path, why in change.problems])
    yield from _first([_dive(*pair) for pair in change.flags])
    for pair in change.incidents:
        yield from _incident(*pair)
    if change.is_none:
        yield "no dive has another flag or speed, no incident is another"
        return
    yield (
        f"{len(change.flags)} dives with another flag, {change.speeds} with a speed more than "
        f"{SPEED_CHANGE:.2f} m/s off, {len(change.incidents)} incidents"
    )


def _first(lines: Sequence[str]) -> Iterator[str]:
    yield from lines[:_MOST]
    if len(lines) > _MOST:
        yield f"  and {len(lines) - _MOST} more"


def _dive(old: Assessment | None, new: Assessment | None) -> str:
    one = new or old
    assert one is not None
    return f"  {utc(one.t_surface)}  {_flag(old)} -> {_flag(new)}"


def _flag(a: Assessment | None) -> str:
    if a is None:
        return "no such dive"
    return f"no flag ({clean(a.reason)})" if a.flag is None else _WORDS[Flag(a.flag)]


def _incident(old: Incident | None, new: Incident | None) -> Iterator[str]:
    if old is None or new is None:
        one = new or old
        assert one is not None
        yield f"  incident {'gone' if new is None else 'new'}: {clean(one.id)}, {_told(one)}"
        return
    yield f"  incident {clean(new.id)}: {_told(old)}"
    yield f"    now {_told(new)}"


def _told(i: Incident) -> str:
    over = "open" if i.cleared_at is None else f"cleared {utc(i.cleared_at)}"
    return f"{i.severity.name.lower()}, {i.dives} dives, {over}"
