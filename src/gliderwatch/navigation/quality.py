"""Whether a dive can be used, and what a reader should know of its data. Pure."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gliderwatch.model import Fix, Segment
from gliderwatch.navigation.fixes import FASTEST, distance
from gliderwatch.navigation.flight import SPARSE, Flight
from gliderwatch.navigation.samples import Samples, get
from gliderwatch.navigation.track import CIRCLING

NOT_SURFACED = "no fix"
"""The reason of a dive that has not ended, as far as known."""
UNOBSERVED = 0.25
"""Share of the interval between two fixes that may be missing before a dive cannot be used."""
BLIND = 0.8
"""Share of a flight without any heading beyond which a dive cannot be used. Some files hold every
third yo only: a glider on its way to a waypoint steers much the same in between."""
STEADY = 0.9
"""Length of the mean of the headings seen above which the glider is taken to have kept it in between."""
SURFACE = 0.5
"""Share of the interval between two fixes that the glider may have drifted before it cannot be used."""


def why_unusable(samples: Samples, flight: Flight, start: Fix | None, end: Fix | None, missing: float) -> str:
    """Why the speed on a dive cannot be estimated; empty when it can.

    `missing`: seconds between the fixes of which no segment has come.
    """
    if end is None:
        return NOT_SURFACED
    if start is None:
        return "no fix before the dive"
    interval = end.t - start.t
    if flight.evidence == "missing" or missing > UNOBSERVED * interval:
        return f"data missing: {missing / 3600:.1f} of {interval / 3600:.1f} h between two fixes"
    if interval - flight.duration > SURFACE * interval:
        return "mostly surface drift"
    over_ground = distance(start, end) / interval
    return (
        f"wild fix: {over_ground:.0f} m/s over ground" if over_ground > FASTEST else _blind(samples, flight)
    )


def _blind(samples: Samples, flight: Flight) -> str:
    """Why the headings of a flight do not do; empty when they do, or when depth or pitch tell how fast it was."""
    return "" if flight.evidence.startswith(("depth", "pitch")) else unsteered(samples, flight)


def unsteered(samples: Samples, flight: Flight) -> str:
    """Why the course of a flight is not known from its headings; empty when it is."""
    gap = heading_gap(samples, flight)
    if gap > BLIND * flight.duration:
        return f"no heading for {gap / 3600:.1f} h"
    turning = gap > 2 * SPARSE and _heading_length(samples, flight) < STEADY
    return f"turning, and no heading for {gap / 3600:.1f} h" if turning else ""


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
    if declination is None:
        notes.append("magnetic declination unknown: headings and currents are relative to magnetic north")
    elif from_model and segment.declination is not None:
        notes.append(f"magnetic declination from the model {segment.declination_source}")
    return tuple(notes)


def flight_notes(flight: Flight, numbers: Mapping[str, float]) -> tuple[str, ...]:
    """What a reader of the assessment should know of the quality of a dive."""
    notes = []
    if flight.evidence == "heading":
        notes.append("no depth or pitch in the file: drift at the surface cannot be told from flight")
    if numbers.get("heading_steadiness", 1.0) < max(CIRCLING, 0.5):
        notes.append("the glider turned much: its speed is hardly observable")
    if "heading_gap_h" in numbers:
        notes.append(f"no heading for {numbers['heading_gap_h']:.1f} h of the dive: taken as steady")
    if "heading_reckoned" in numbers:
        notes.append("no measured heading in the file: direction of the dead-reckoned way used")
    if "heading_commanded" in numbers:
        notes.append("commanded heading used, the measured one is not in the file")
    if "heading_assumed" in numbers:
        notes.append("headings missing: a steady course is assumed, in the direction that the current leaves")
    if "unobserved_h" in numbers:
        notes.append(f"{numbers['unobserved_h']:.1f} h without data within the dive")
    return tuple(notes)
