"""Whether a dive can be used, and what a reader should know of its data. Pure."""

from __future__ import annotations

import numpy as np

from gliderwatch.model import DiveFeatures, Fix, Segment, Unusable
from gliderwatch.navigation.clock import span
from gliderwatch.navigation.constants import (
    FASTEST_OVER_GROUND,
    HEADING_GAP,
    MOST_BLIND,
    MOST_DRIFT,
    MOST_UNOBSERVED,
    STEADY_COURSE,
    TURNED_MUCH,
)
from gliderwatch.navigation.fixes import distance
from gliderwatch.navigation.flight import Flight
from gliderwatch.navigation.samples import Samples, get


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


def corrected_notes(ahead: float, surface: float) -> tuple[str, ...]:
    """Notes on a clock that was set ``ahead`` (s), and on a depth sensor that shows ``surface`` (m) at the
    surface; 0: neither."""
    notes = []
    if ahead:
        notes.append(f"the glider's clock was set forward by {span(ahead)}, or it stayed at the surface")
    if surface:
        notes.append(f"depth is {surface:.1f} m at the surface: taken off (the pressure was not zeroed)")
    return tuple(notes)


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
        notes.append("commanded heading used, the measured one is not in the file")
    if features.heading_assumed:
        notes.append("headings missing: a steady course is assumed, in the direction that the current leaves")
    if features.heading_gap is not None:
        notes.append(f"no heading for {features.heading_gap / 3600:.1f} h of the dive: taken as steady")
    if features.unobserved:
        notes.append(f"{features.unobserved / 3600:.1f} h without data within the dive")
    return tuple(notes)
