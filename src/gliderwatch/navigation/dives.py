"""Segments in, dives out: the navigation of one glider, advanced segment by segment. Pure.

A dive lies between two fixes. The fix that ends it, and the current that the glider computed for it,
often come only with the next segment: so the state carries on the samples since the last fix,
and a dive is told again when more of it is known.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from gliderwatch.model import Dive, Fix, Segment
from gliderwatch.navigation.current import Known, Report, new_reports, pair, updated
from gliderwatch.navigation.fixes import FASTEST, distance, new_fixes
from gliderwatch.navigation.flight import SPARSE, Flight, find_flight
from gliderwatch.navigation.samples import Samples, after, concatenated, get, prepare
from gliderwatch.navigation.track import CIRCLING, build_track, evidence

SHORTEST = 900.0
"""Seconds: a shorter stay under water says too little of speed, a shorter hole in the data is none."""
LONGEST = 3 * 86400.0
"""Seconds between fixes: a longer one is not a dive but a gap between deployments."""
UNOBSERVED = 0.25
"""Share of the interval between two fixes that may be missing before a dive cannot be used."""
BLIND = 0.8
"""Share of a flight without any heading beyond which a dive cannot be used. Some files hold every
third yo only: a glider on its way to a waypoint steers much the same in between."""
STEADY = 0.9
"""Length of the mean of the headings seen above which the glider is taken to have kept it in between."""
SURFACE = 0.5
"""Share of the interval between two fixes that the glider may have drifted before it cannot be used."""


@dataclass(frozen=True, slots=True)
class Navigation:
    """State of the navigation of one glider after a segment.

    ``fix`` is the last good one and ``carry`` the samples after it; ``declination`` (rad) the last known;
    ``last_t`` the end of the latest segment (s); ``holes`` the times (start, end) since the fix of which
    no segment has come; ``holder`` the segment that holds the flight since the fix; ``known`` the
    currents reported last and ``reports`` those whose dive is not told yet; ``dive`` the last whole
    dive; ``notes`` on the data since the fix.
    """

    fix: Fix | None = None
    carry: Samples = field(default_factory=dict)
    declination: float | None = None
    last_t: float | None = None
    holes: tuple[tuple[float, float], ...] = ()
    holder: str = ""
    known: Known = (None, None)
    reports: tuple[Report, ...] = ()
    dive: Dive | None = None
    notes: tuple[str, ...] = ()


def extend(state: Navigation, segment: Segment) -> tuple[Navigation, list[Dive]]:
    """The state after one more segment, and the dives that are new or better known by it, in order of time.

    The first may be the last dive of before, told again: a dive replaces the one of the same ``t_dive``.
    A dive that cannot be used for estimation comes with its reason, also one that has not ended.
    """
    declination = segment.declination if segment.declination is not None else state.declination
    fresh = prepare(segment, declination or 0.0)
    samples = concatenated(state.carry, fresh)
    reports, known = new_reports(fresh, state.known)
    quality = _quality(segment, declination)
    state = replace(_placed(state, segment, fresh, quality), declination=declination, known=known)

    before = state.dive
    fixes = new_fixes(samples, state.fix)
    state, told = _withdraw_old_fix(state, fixes)
    for fix in fixes:
        if state.fix is None or fix.t - state.fix.t > SHORTEST:
            dive = _dive(state, segment.id.glider, samples, fix)
            told += [dive] if dive is not None else []
        holes = tuple((max(a, fix.t), b) for a, b in state.holes if b > fix.t)
        state = replace(state, fix=fix, holder=segment.id.name, holes=holes, notes=quality)
    told, waiting = _with_currents(told, samples, state.fix, [*state.reports, *reports])

    oldest = (state.last_t or 0.0) - LONGEST
    carry = after(samples, max(state.fix.t, oldest) if state.fix is not None else oldest)
    waiting = [report for report in waiting if report.t > oldest]
    state = replace(state, carry=carry, reports=tuple(waiting), dive=told[-1] if told else None)
    unended = _dive(state, segment.id.glider, carry, None)
    return state, [d for d in told if d is not before] + ([unended] if unended is not None else [])


def _quality(segment: Segment, declination: float | None) -> tuple[str, ...]:
    """Notes on the data of one segment."""
    notes = [f"{n} values of {name} out of range dropped" for name, n in sorted(segment.dropped.items())]
    if declination is None:
        notes.append("magnetic declination unknown: headings and currents are relative to magnetic north")
    elif segment.declination is not None and segment.declination_source != "glider":
        notes.append(f"magnetic declination from the model {segment.declination_source}")
    if not len(segment.get("heading")) and len(segment.get("heading_commanded")):
        notes.append("commanded heading used, the measured one is not in the file")
    return tuple(notes)


def _placed(state: Navigation, segment: Segment, fresh: Samples, quality: tuple[str, ...]) -> Navigation:
    """The state with the place of a segment in time: a hole before it, and whether it holds the flight."""
    holes = state.holes
    if state.last_t is not None and segment.id.opened_at - state.last_t > SHORTEST:
        holes = (*holes, (state.last_t, segment.id.opened_at))
    flies = find_flight(fresh, segment.id.opened_at - SPARSE, segment.last_t) is not None
    return replace(
        state,
        holes=holes,
        notes=tuple(dict.fromkeys(state.notes + quality)),
        last_t=max(segment.last_t, state.last_t or segment.last_t),
        holder=segment.id.name if flies or not state.holder else state.holder,
    )


def _withdraw_old_fix(state: Navigation, fixes: list[Fix]) -> tuple[Navigation, list[Dive]]:
    """The dives told before, the last one withdrawn if the next fix shows that an old fix ended it."""
    if state.dive is None:
        return state, []
    if fixes and state.fix is not None and state.dive.end == state.fix:
        gap = fixes[0].t - state.fix.t
        if gap < SHORTEST and distance(state.fix, fixes[0]) > FASTEST * gap + 100.0:
            withdrawn = replace(state.dive, track=None, current=None, reason="stale fix")
            return replace(state, fix=fixes[0]), [withdrawn]
    return state, [state.dive]


def _dive(state: Navigation, glider: str, samples: Samples, end: Fix | None) -> Dive | None:
    """The dive between the last fix and `end` (None: not surfaced yet as far as known), if there was one."""
    start = state.fix
    first = start.t if start is not None else min((s.t[0] for s in samples.values()), default=0.0)
    last = end.t if end is not None else max((s.t[-1] for s in samples.values()), default=0.0)
    flight = find_flight(samples, first, last)
    if flight is None or flight.end - flight.start < SHORTEST or last - first > LONGEST:
        return None
    reason = _why_unusable(state, samples, flight, end)
    track = None
    numbers: Mapping[str, float] = {"duration_h": (flight.end - flight.start) / 3600}
    if start is not None and end is not None and not reason:
        track = build_track(samples, flight, start, end)
        numbers = evidence(samples, flight, track)
        gap = _heading_gap(samples, flight)
        numbers |= {"heading_gap_h": gap / 3600} if gap > 2 * SPARSE else {}
        missing = _missing(state, end)
        numbers |= {"unobserved_h": missing / 3600} if missing else {}
    return Dive(
        glider=glider,
        segment=state.holder,
        t_dive=flight.start,
        t_surface=flight.end,
        start=start,
        end=end,
        track=track,
        current=None,
        reason=reason,
        n_samples=len(get(samples, "heading_e").between(flight.start, flight.end)),
        evidence=MappingProxyType(dict(numbers)),
        notes=state.notes + _notes(flight, numbers),
    )


def _why_unusable(state: Navigation, samples: Samples, flight: Flight, end: Fix | None) -> str:
    """Why the speed on this dive cannot be estimated; empty when it can."""
    if state.fix is None:
        return "no fix before the dive"
    if end is None:
        return "no fix"
    interval = end.t - state.fix.t
    missing = _missing(state, end)
    if missing > UNOBSERVED * interval:
        return f"data missing: {missing / 3600:.1f} of {interval / 3600:.1f} h between two fixes"
    if interval - (flight.end - flight.start) > SURFACE * interval:
        return "mostly surface drift"
    gap = _heading_gap(samples, flight)
    if gap > BLIND * (flight.end - flight.start):
        return f"no heading for {gap / 3600:.1f} h"
    turning = gap > 2 * SPARSE and _heading_length(samples, flight) < STEADY
    return f"turning, and no heading for {gap / 3600:.1f} h" if turning else ""


def _heading_length(samples: Samples, flight: Flight) -> float:
    """Length of the mean of the headings seen: 1 on a steady course."""
    e, n = (get(samples, f"heading_{c}").between(flight.start, flight.end).v for c in "en")
    return float(np.hypot(e.mean(), n.mean()))


def _heading_gap(samples: Samples, flight: Flight) -> float:
    """The longest time (s) of a flight without a heading."""
    heading = get(samples, "heading_e").between(flight.start, flight.end)
    return float(np.diff(np.concatenate([[flight.start], heading.t, [flight.end]])).max())


def _missing(state: Navigation, end: Fix) -> float:
    """Seconds between the last fix and `end` of which no segment has come."""
    return sum(min(b, end.t) - a for a, b in state.holes if a < end.t)


def _notes(flight: Flight, numbers: Mapping[str, float]) -> tuple[str, ...]:
    """What a reader of the assessment should know of the quality of a dive."""
    notes = []
    if flight.evidence == "heading":
        notes.append("no depth or pitch in the file: drift at the surface cannot be told from flight")
    if numbers.get("heading_steadiness", 1.0) < max(CIRCLING, 0.5):
        notes.append("the glider turned much: its speed is hardly observable")
    if "heading_gap_h" in numbers:
        notes.append(f"no heading for {numbers['heading_gap_h']:.1f} h of the dive: taken as steady")
    if "unobserved_h" in numbers:
        notes.append(f"{numbers['unobserved_h']:.1f} h without data within the dive")
    return tuple(notes)


def _with_currents(
    told: list[Dive], samples: Samples, fix: Fix | None, reports: list[Report]
) -> tuple[list[Dive], list[Report]]:
    """The dives with the currents published for them, and the reports of a dive that is not told yet."""
    surfaced = [d.t_surface for d in told]
    last = max((s.t[-1] for s in samples.values()), default=0.0)
    under_way = find_flight(samples, fix.t, last) if fix is not None else None
    if under_way is not None:
        surfaced.append(under_way.end)
    out, waiting = list(told), []
    for report, i in zip(reports, pair(reports, surfaced), strict=True):
        if i >= len(told):
            waiting.append(report)
        elif i >= 0 and not out[i].reason.startswith("stale"):
            out[i] = replace(out[i], current=updated(out[i].current, report))
    return out, waiting
