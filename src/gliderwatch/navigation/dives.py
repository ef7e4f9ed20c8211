"""Segments in, dives out: the navigation of one glider, advanced segment by segment. Pure."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from gliderwatch.model import Dive, DiveFeatures, Fix, Segment, Series, Unusable, readonly, replace
from gliderwatch.navigation.clock import forward_step, span
from gliderwatch.navigation.constants import (
    CURRENT_EARLY,
    FASTEST_OVER_GROUND,
    HEADING_GAP,
    HIDING_HOLE,
    JUMP,
    LONGEST_DIVE,
    MOST_BLIND,
    MOST_DRIFT,
    MOST_UNOBSERVED,
    SHORTEST_DIP,
    SHORTEST_DIVE,
    SHORTEST_HOLE,
    SPARSE,
    STEADY_COURSE,
    SUSPECT_DISTANCE,
    TURNED_MUCH,
)
from gliderwatch.navigation.dac import LastReported, Report, new_reports, pair, updated
from gliderwatch.navigation.features import flight_features, track_features
from gliderwatch.navigation.fixes import distance, new_fixes, surface_intervals, zeroed
from gliderwatch.navigation.flight import (
    Flight,
    Samples,
    after,
    concatenated,
    find_flight,
    get,
    lengthened,
    prepare,
    unseen,
)
from gliderwatch.navigation.track import build_track

# ----------------------------------------
# Whether a dive can be used, and what a reader should know of its data.


def why_unusable(
    samples: Samples, flight: Flight, start: Fix | None, end: Fix | None, missing: float
) -> tuple[Unusable | None, str]:
    """Why the speed on a dive cannot be estimated, and the same in words; None and empty when it can.

    `missing`: seconds between the fixes of which no segment has come.
    """
    if end is None:
        return Unusable.NOT_SURFACED, "no fix"
    if start is None:
        return Unusable.NO_FIX_BEFORE, "no fix before the dive"
    interval = end.t - start.t
    if flight.evidence == "missing" or missing > MOST_UNOBSERVED * interval:
        words = f"data missing: {missing / 3600:.1f} of {interval / 3600:.1f} h between two fixes"
        return Unusable.DATA_MISSING, words
    if interval - flight.duration > MOST_DRIFT * interval:
        return Unusable.SURFACE_DRIFT, "mostly surface drift"
    over_ground = distance(start, end) / interval
    if over_ground > FASTEST_OVER_GROUND:
        return Unusable.WILD_FIX, f"wild fix: {over_ground:.0f} m/s over ground"
    return _blind(samples, flight)


def _blind(samples: Samples, flight: Flight) -> tuple[Unusable | None, str]:
    """Why the headings of a flight do not do, and the same in words; None and empty when they do, or when
    depth or pitch tell how fast it was."""
    return (None, "") if flight.evidence.startswith(("depth", "pitch")) else unsteered(samples, flight)


def unsteered(samples: Samples, flight: Flight) -> tuple[Unusable | None, str]:
    """Why the course of a flight is not known from its headings, and the same in words; None and empty when
    it is."""
    gap = heading_gap(samples, flight)
    if gap > MOST_BLIND * flight.duration:
        return Unusable.NO_HEADING, f"no heading for {gap / 3600:.1f} h"
    if gap > HEADING_GAP and _heading_length(samples, flight) < STEADY_COURSE:
        return Unusable.TURNING, f"turning, and no heading for {gap / 3600:.1f} h"
    return None, ""


def heading_gap(samples: Samples, flight: Flight) -> float:
    """The longest time (s) of a flight without a heading."""
    heading = get(samples, "heading_e").between(flight.start, flight.end)
    return float(np.diff(np.concatenate([[flight.start], heading.t, [flight.end]])).max())


def _heading_length(samples: Samples, flight: Flight) -> float:
    """Length of the mean of the headings seen: 1 on a steady course."""
    e, n = (get(samples, f"heading_{c}").between(flight.start, flight.end).v for c in "en")
    return float(np.hypot(e.mean(), n.mean()))


def segment_notes(segment: Segment, declination: float | None, from_model: bool) -> tuple[str, ...]:
    """Notes on the data of one segment; `declination` (rad) is the one used, perhaps `from_model`."""
    notes = [f"{n} values of {name} out of range dropped" for name, n in sorted(segment.dropped.items())]
    notes += segment.notes
    if declination is None:
        notes.append("magnetic declination unknown: headings and currents are relative to magnetic north")
    elif from_model and segment.declination is not None:
        notes.append(f"magnetic declination from the model {segment.declination_source}")
    return tuple(notes)


def corrected_notes(step: float, surface: float) -> tuple[str, ...]:
    """Notes on a clock that was set forward by a ``step`` (s), and on a depth sensor that shows ``surface``
    (m) at the surface; 0: neither."""
    notes = []
    if step:
        notes.append(f"the glider's clock was set forward by {span(step)}, or it stayed at the surface")
    if surface:
        notes.append(f"depth is {surface:.1f} m at the surface: taken off (the pressure was not zeroed)")
    return tuple(notes)


COMMANDED_USED = "commanded heading used, the measured one is not in the file"
COURSE_ASSUMED = "headings missing: a steady course is assumed, in the direction that the current leaves"


def flight_notes(flight: Flight, features: DiveFeatures) -> tuple[str, ...]:
    """What a reader of the assessment should know of the quality of a dive."""
    notes = []
    if flight.evidence == "heading":
        notes.append("no depth or pitch in the file: drift at the surface cannot be told from flight")
    if features.heading_steadiness is not None and features.heading_steadiness < TURNED_MUCH:
        notes.append("the glider turned much: its speed is hardly observable")
    if features.heading_reckoned:
        notes.append("no measured heading in the file: direction of the dead-reckoned way used")
    if features.heading_commanded:
        notes.append(COMMANDED_USED)
    if features.heading_assumed:
        notes.append(COURSE_ASSUMED)
    if features.heading_gap is not None:
        notes.append(f"no heading for {features.heading_gap / 3600:.1f} h of the dive: taken as steady")
    if features.unobserved:
        notes.append(f"{features.unobserved / 3600:.1f} h without data within the dive")
    return tuple(notes)


# ----------------------------------------
# Segments in, dives out: the navigation of one glider, advanced segment by segment. Pure.
#
# A dive lies between two fixes. The fix that ends it, and the current that the glider computed for it,
# often come only with the next segment: so the state carries on the samples since the last fix,
# and a dive is returned again when more of it is known.


@dataclass(frozen=True, slots=True)
class Navigation:
    """State of the navigation of one glider after a segment.

    ``fix`` is the last good one and ``carry`` the samples after it; ``declination`` (rad) the last known,
    ``declination_t`` when the glider reported it (s; None: a model's); ``last_t`` the end of the
    latest segment (s); ``holes`` the times (start, end) since the fix of which no segment has come;
    ``calls`` those between two segments that follow each other, in which none is missing, and ``last_name``
    the name of the latest segment if it holds a whole flight and ends at the surface (else empty: it may
    break off); ``holder`` the segment that holds the flight since the fix; ``last_reported`` the currents
    reported last and ``reports`` those whose dive is not returned yet; ``dive`` the last whole dive,
    ``pending`` the surfacing (s) of a later one that is not returned; ``notes`` on the data since the fix;
    ``latest`` the name of the latest segment; ``surface_depth`` what the depth sensor shows at the surface
    (m; 0: near enough).
    """

    fix: Fix | None = None
    carry: Samples = field(default_factory=dict)
    declination: float | None = None
    declination_t: float | None = None
    last_t: float | None = None
    holes: tuple[tuple[float, float], ...] = ()
    calls: tuple[tuple[float, float], ...] = ()
    last_name: str = ""
    holder: str = ""
    last_reported: LastReported = (None, None)
    reports: tuple[Report, ...] = ()
    dive: Dive | None = None
    pending: float | None = None
    notes: tuple[str, ...] = ()
    latest: str = ""
    surface_depth: float = 0.0


def extend(state: Navigation, segment: Segment) -> tuple[Navigation, list[Dive]]:
    """The state after one more segment, and the dives that are new or better known by it, in order of time.

    The first may be the last dive of before, returned again: a dive replaces the one of the same ``t_dive``.
    A dive that cannot be used for estimation comes with its reason, also one that has not ended.
    """
    state = _with_declination(state, segment)
    fresh = prepare(segment, state.declination or 0.0)
    fixes = new_fixes(fresh, state.fix)
    state, step = _with_clock(state, segment, fixes)
    fixes = new_fixes(fresh, state.fix) if step else fixes
    fresh, surface = zeroed(fresh, fixes, state.surface_depth)
    samples = concatenated(state.carry, fresh)
    reports, last_reported = new_reports(segment, state.declination or 0.0, state.last_reported)
    quality = segment_notes(segment, state.declination, from_model=state.declination_t is None)
    quality += corrected_notes(step, surface)
    state = _placed(state, segment, fresh, quality, surface, last_reported)

    before = state.dive
    if "fix_lat" in state.carry:
        fixes = new_fixes(samples, state.fix)
    state, finished = _withdraw_old_fix(state, fixes)
    pending = [state.pending] if state.pending is not None else []
    for first, last in surface_intervals(fixes, SHORTEST_DIP):
        flight = _flight_since(state, samples, first)
        if flight is not None and flight.duration >= SHORTEST_DIVE:
            finished.append(_dive(state, segment.id.glider, samples, flight, first))
        elif flight is not None and flight.duration >= SHORTEST_DIP:
            pending.append(flight.end)
        holes = tuple((max(a, last.t), b) for a, b in state.holes if b > last.t)
        calls = tuple((a, b) for a, b in state.calls if b > last.t)
        state = replace(state, fix=last, holder=segment.id.name, holes=holes, calls=calls, notes=quality)

    oldest = (state.last_t or 0.0) - LONGEST_DIVE
    carry = after(samples, max(state.fix.t, oldest) if state.fix is not None else oldest)
    under_way = _flight_since(state, carry, None)
    finished, waiting = _with_currents(finished, pending, under_way, [*state.reports, *reports])
    waiting = [report for report in waiting if report.t > oldest]
    latest, later = (finished[-1] if finished else None), max(pending, default=None)
    later = later if later is not None and (latest is None or later > latest.t_surface) else None
    name = state.last_name if under_way is None else ""
    state = replace(state, carry=carry, reports=tuple(waiting), dive=latest, pending=later, last_name=name)
    news = [d for d in finished if d is not before]
    if under_way is not None and under_way.duration >= SHORTEST_DIVE:
        news.append(_dive(state, segment.id.glider, carry, under_way, None))
    return state, news


def _with_declination(state: Navigation, segment: Segment) -> Navigation:
    """The state with the declination to use for a segment: the glider's own, as long as it is not old.

    A model differs by up to a degree from what the glider steers and reckons by.
    """
    if segment.declination is None:
        return state
    t = segment.id.opened_at
    if segment.declination_source == "glider":
        return replace(state, declination=segment.declination, declination_t=t)
    if state.declination_t is not None and t - state.declination_t < LONGEST_DIVE:
        return state
    return replace(state, declination=segment.declination, declination_t=None)


def _placed(
    state: Navigation,
    segment: Segment,
    fresh: Samples,
    quality: tuple[str, ...],
    surface_depth: float,
    last_reported: LastReported,
) -> Navigation:
    """The state with the place of a segment in time: a hole before it, and whether it holds the flight; and
    with what depth and currents it reported."""
    holes, calls = state.holes, state.calls
    if state.last_t is not None and segment.id.opened_at - state.last_t > SHORTEST_HOLE:
        gap = (state.last_t, segment.id.opened_at)
        if follows(state.last_name, segment.id.name):
            calls = (*calls, gap)
        else:
            holes = (*holes, gap)
    flies = find_flight(fresh, segment.id.opened_at - SPARSE, segment.last_t) is not None
    return replace(
        state,
        holes=holes,
        calls=calls,
        last_name=segment.id.name if flies else "",
        notes=tuple(dict.fromkeys(state.notes + quality)),
        last_t=max(segment.last_t, state.last_t or segment.last_t),
        holder=segment.id.name if flies or not state.holder else state.holder,
        latest=segment.id.name,
        surface_depth=surface_depth,
        last_reported=last_reported,
    )


def follows(before: str, name: str) -> bool:
    """Whether a segment is the next one of the same mission after another, so that none is missing between
    them.

    >>> follows("unit-2024-120-3-7", "unit-2024-120-3-8"), follows("unit-2024-120-3-7", "unit-2024-120-3-9")
    (True, False)
    """
    mission, _, number = name.rpartition("-")
    mission_before, _, number_before = before.rpartition("-")
    if not (number.isdecimal() and number_before.isdecimal() and mission == mission_before):
        return False
    return int(number) == int(number_before) + 1


def _with_clock(state: Navigation, segment: Segment, fixes: list[Fix]) -> tuple[Navigation, float]:
    """The state by the clock of a segment with new ``fixes``, where that was set forward before it, and by
    how much (s).

    Nothing comes between two segments of consecutive numbers. Where the glider was at the surface at the end
    of one and at the beginning of the next, and near enough, the hours between the two are none.
    """
    step = forward_step(state.latest, state.last_t, state.fix, segment.id, next(iter(fixes), None))
    if not step or state.fix is None or state.last_t is None:
        return state, 0.0
    carry = {name: Series(readonly(s.t + step), s.v) for name, s in state.carry.items()}
    holes = tuple((a + step, b + step) for a, b in state.holes)
    calls = tuple((a + step, b + step) for a, b in state.calls)
    fix, last_t = replace(state.fix, t=state.fix.t + step), state.last_t + step
    return replace(
        state, fix=fix, last_t=last_t, carry=MappingProxyType(carry), holes=holes, calls=calls
    ), step


def _withdraw_old_fix(state: Navigation, fixes: list[Fix]) -> tuple[Navigation, list[Dive]]:
    """The dives returned before, the last one withdrawn if the next fix shows that an old fix ended it."""
    if state.dive is None:
        return state, []
    if fixes and state.fix is not None and state.dive.end == state.fix:
        gap = fixes[0].t - state.fix.t
        if gap < SHORTEST_DIVE and distance(state.fix, fixes[0]) > FASTEST_OVER_GROUND * gap + JUMP:
            withdrawn = replace(
                state.dive,
                end=fixes[0],
                track=None,
                current=None,
                reason="stale fix",
                unusable=Unusable.STALE_FIX,
            )
            return replace(state, fix=fixes[0]), [withdrawn]
    return state, [state.dive]


def _flight_since(state: Navigation, samples: Samples, end: Fix | None) -> Flight | None:
    """The flight between the last fix and `end` (None: the last sample), also one that a hole may hide."""
    first = (
        state.fix.t if state.fix is not None else min((float(s.t[0]) for s in samples.values()), default=0.0)
    )
    last = end.t if end is not None else max((float(s.t[-1]) for s in samples.values()), default=0.0)
    if not SHORTEST_DIP < last - first <= LONGEST_DIVE:
        return None
    flight = find_flight(samples, first, last)
    if (
        flight is None
        and state.fix is not None
        and (end is None or distance(state.fix, end) > SUSPECT_DISTANCE)
    ):
        hidden = [(a, min(b, last)) for a, b in state.holes if min(b, last) - a >= HIDING_HOLE]
        flight = Flight(*hidden[-1], evidence="missing") if hidden else None
        called = sum(min(b, last) - max(a, first) for a, b in state.calls if a < last and b > first)
        if flight is None and end is not None and last - first - called >= HIDING_HOLE:
            flight = unseen(samples, first, last)
    return flight


def _dive(state: Navigation, glider: str, samples: Samples, flight: Flight, end: Fix | None) -> Dive:
    """The dive between the last fix and `end` (None: not surfaced yet as far as known)."""
    start, seen = state.fix, flight
    if end is not None:
        flight = lengthened(flight, samples, end.t, state.holes)
    missing = sum((min(b, end.t) - a for a, b in state.holes if a < end.t), 0.0) if end is not None else 0.0
    unusable, reason = why_unusable(samples, flight, start, end, missing)
    if start is None or end is None or unusable is not None:
        track = None
        features = flight_features(samples, flight)
    else:
        track = build_track(samples, flight, start, end)
        gap = heading_gap(samples, flight)
        features = track_features(samples, flight, track)
        unsure = unsteered(samples, flight)[0] is not None and not features.heading_reckoned
        features = replace(
            features,
            heading_assumed=features.heading_assumed or unsure,
            heading_gap=gap if gap > HEADING_GAP else None,
            unobserved=missing,
        )
    return Dive(
        glider=glider,
        segment=state.holder,
        t_dive=flight.start,
        t_surface=seen.end,
        start=start,
        end=end,
        track=track,
        current=None,
        reason=reason,
        n_samples=len(get(samples, "heading_e").between(flight.start, flight.end)),
        features=features,
        notes=state.notes + flight_notes(flight, features),
        unusable=unusable,
    )


def _with_currents(
    finished: list[Dive], pending: list[float], under_way: Flight | None, reports: list[Report]
) -> tuple[list[Dive], list[Report]]:
    """The dives with the currents published for them, and the reports of a dive that is not returned yet.

    `pending` are surfacings (s) of dives that are never returned: their currents are nobody's. One that was
    published well within a flight is that of a part of it, up to a surfacing without a fix: so is then the
    one at its end, and neither is the current between the two fixes.
    """
    flights = [(d.t_dive, d.t_surface, i) for i, d in enumerate(finished)]
    if under_way is not None:
        flights.append((under_way.start, under_way.end, -1))
    ends: list[tuple[float, int | None]] = [(d.t_surface, i) for i, d in enumerate(finished)]
    ends = sorted([*ends, *((t, None) for t in pending)], key=lambda end: end[0])
    surfaced = [t for t, _ in ends] + ([under_way.end] if under_way is not None else [])
    out, waiting = list(finished), []
    for report, k in zip(reports, pair(reports, surfaced), strict=True):
        part = next((i for a, b, i in flights if a + SPARSE < report.t < b - CURRENT_EARLY), None)
        if part is not None:
            if part < 0:
                waiting.append(report)
            else:
                out[part] = _with_partial_currents(out[part])
            continue
        i = ends[k][1] if 0 <= k < len(ends) else None
        if k == len(ends):
            waiting.append(report)
        elif (
            i is not None
            and out[i].unusable is not Unusable.STALE_FIX
            and not out[i].features.surfacing_unseen
        ):
            out[i] = replace(out[i], current=updated(out[i].current, report, out[i].t_surface))
    return out, waiting


def _with_partial_currents(dive: Dive) -> Dive:
    """A dive in which the glider surfaced without a fix."""
    if dive.features.surfacing_unseen:
        return dive
    note = "it surfaced without a fix on the way: the currents reported are those of parts of the dive"
    features = replace(dive.features, surfacing_unseen=True)
    return replace(dive, current=None, features=features, notes=(*dive.notes, note))
