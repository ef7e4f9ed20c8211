"""The panels of a glider: what its dives tell, over time. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from math import degrees

import numpy as np

from gliderwatch.figures.plots import Line, Panel
from gliderwatch.model import Array, Assessment, Flag

FLAGS = {Flag.ANOMALY: "out of range", Flag.FALSE_ALARM: "disagree"}
"""What is marked in the plot of the speed."""


def panels(dives: Sequence[Assessment]) -> list[Panel]:
    """All panels of dives in order of time for which the dives have values."""
    made = (speed(dives), *flow(dives), *(one(dives) for one in _OTHERS))
    return [panel for panel in made if any(np.isfinite(line.v).any() for line in panel.lines)]


def speed(dives: Sequence[Assessment]) -> Panel:
    """The speed of each dive with its error, its normal range, and what is flagged."""
    t = _of(dives, lambda d: d.t_surface)
    v = _of(dives, lambda d: d.speed)
    band = (t, _of(dives, lambda d: d.speed_min), _of(dives, lambda d: d.speed_max))
    marked = []
    for flag, words in FLAGS.items():
        is_flagged = np.array([d.flag == flag for d in dives], dtype=bool) & np.isfinite(v)
        marked.append((words, t[is_flagged], v[is_flagged]))
    lines = (
        Line("through water", t, v, _evidence(dives, "speed_sigma"), joined=False),
        Line("own", t, _evidence(dives, "own_speed", "onboard_speed")),
    )
    shows = (
        "Speed through the water on each dive, with its standard error, against the normal range (shaded): "
        "below it something slows the glider. Marked are dives out of range and measurements that disagree. "
        "The dashed line is what the glider itself reckons with."
    )
    return Panel("Speed", "speed (m/s)", shows, lines, band, tuple(marked), zero=True)


def flow(dives: Sequence[Assessment]) -> Iterable[Panel]:
    """East and north of the current as estimated and as it is compared with."""
    t = _of(dives, lambda d: d.t_surface)
    for name, ours, theirs in (("east", "flow_u", "reference_u"), ("north", "flow_v", "reference_v")):
        yield Panel(
            f"Current to the {name}",
            f"{name} (m/s)",
            f"The current to the {name}, as estimated here and as it is compared with (usually as the glider "
            "reckons it): where they part for long, current, compass or fixes are wrong.",
            (Line("estimated", t, _field(dives, ours)), Line("compared with", t, _field(dives, theirs))),
        )


def _misfit(dives: Sequence[Assessment]) -> Panel:
    return _of_evidence(
        dives,
        "Misfit across",
        "misfit (m/s)",
        "What fixes, heading and current leave over across the heading: near 0 when all is well.",
        (("across", "across_misfit", 1.0),),
        sigma="across_sigma",
    )


def _depth(dives: Sequence[Assessment]) -> Panel:
    return _of_evidence(
        dives,
        "Depth",
        "depth (m)",
        "The greatest depth of each dive: less than commanded points to buoyancy or the bottom.",
        (("deepest", "depth_max", 1.0),),
        zero=True,
        down=True,
    )


def _pitch(dives: Sequence[Assessment]) -> Panel:
    return _of_evidence(
        dives,
        "Pitch",
        "pitch (degrees)",
        "Mean pitch going down (negative) and coming up: a change without a command shifts the trim.",
        (("climb", "pitch_climb", degrees(1)), ("dive", "pitch_dive", degrees(1))),
    )


def _roll(dives: Sequence[Assessment]) -> Panel:
    return _of_evidence(
        dives,
        "Roll",
        "roll (degrees)",
        "Mean roll, right side down positive: a step stays after a lost wing or something caught.",
        (("mean", "roll_mean", degrees(1)),),
        sigma="roll_std",
        scale=degrees(1),
    )


def _ballast(dives: Sequence[Assessment]) -> Panel:
    return _of_evidence(
        dives,
        "Ballast",
        "volume (cm³)",
        "The volume that the pump moves at the turns: less than before means less drive.",
        (("climb", "ballast_climb", 1e6), ("dive", "ballast_dive", 1e6)),
    )


def _rate(dives: Sequence[Assessment]) -> Panel:
    return _of_evidence(
        dives,
        "Vertical speed",
        "rate (m/s)",
        "How fast it sinks (positive) and climbs: both slower is drag, one of them is ballast or weight.",
        (("dive", "depth_rate_dive", 1.0), ("climb", "depth_rate_climb", 1.0)),
    )


def _vacuum(dives: Sequence[Assessment]) -> Panel:
    return _of_evidence(
        dives,
        "Vacuum",
        "vacuum (kPa)",
        "The vacuum in the hull: a steady fall is a leak of air, jumps go with temperature.",
        (("median", "vacuum", 1e-3),),
    )


def _interval(dives: Sequence[Assessment]) -> Panel:
    t = _of(dives, lambda d: d.t_surface)
    gaps = np.append(np.diff(t), np.nan) / 3600.0
    shows = "Hours from each surfacing to the next: a long one is a missed call or lost files."
    line = Line("between surfacings", t[1:], gaps[:-1], joined=False)
    return Panel("Time between surfacings", "interval (h)", shows, (line,), zero=True)


_OTHERS: tuple[Callable[[Sequence[Assessment]], Panel], ...] = (
    _misfit,
    _depth,
    _rate,
    _pitch,
    _roll,
    _ballast,
    _vacuum,
    _interval,
)


def _of_evidence(
    dives: Sequence[Assessment],
    name: str,
    unit: str,
    shows: str,
    keys: Sequence[tuple[str, str, float]],
    *,
    sigma: str = "",
    scale: float = 1.0,
    zero: bool = False,
    down: bool = False,
) -> Panel:
    t = _of(dives, lambda d: d.t_surface)
    error = _evidence(dives, sigma) * scale if sigma else None
    lines = (Line(label, t, _evidence(dives, key) * by, error, joined=False) for label, key, by in keys)
    return Panel(name, unit, shows, tuple(lines), zero=zero, down=down)


def _of(dives: Sequence[Assessment], value: Callable[[Assessment], float | None]) -> Array:
    return np.array([np.nan if (x := value(d)) is None else x for d in dives], dtype=float)


def _field(dives: Sequence[Assessment], name: str) -> Array:
    return _of(dives, lambda d: getattr(d, name))


def _evidence(dives: Sequence[Assessment], *keys: str) -> Array:
    """The first of some keys that a dive has."""
    return _of(dives, lambda d: next((d.evidence[key] for key in keys if key in d.evidence), None))
