"""What a mission comes to: a few numbers that would show a change of navigation, estimation or rules."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gliderwatch.model import Assessment, Segment, Series, readonly
from gliderwatch.navigation.dives import Navigation, extend
from gliderwatch.navigation.frame import magnetic_to_true
from gliderwatch.navigation.track import closure
from missions import feed, real

HERE = Path(__file__).parent / "golden"


def golden_file(name: str) -> Path:
    """Where the numbers of a mission are kept."""
    return HERE / f"{name}.yml"


def statistics(data: Path, name: str) -> dict[str, Any]:
    """Counts and medians of one mission with default parameters."""
    segments = real(data, name)
    glider = segments[0].id.glider
    store = feed(segments)
    dives = store.assessments(glider)
    judged = [a for a in dives if a.speed is not None]
    return {
        "segments": len(segments),
        "dives": len(dives),
        "usable": len(judged),
        "flags": _counted("none" if a.flag is None else str(a.flag) for a in dives),
        "reasons": _counted(a.reason.split(":")[0].split(" for ")[0] for a in dives),
        "final_currents": sum(a.reference_final for a in dives),
        "hours_under_water": _round(sum(a.evidence.get("duration_h", 0.0) for a in judged), 1),
        "along_speed": _quantiles([a.evidence["along_speed"] for a in judged if "along_speed" in a.evidence]),
        "across_misfit": _quantiles([abs(x) for x in _of(judged, "across_misfit")]),
        "speed": _quantiles([a.speed for a in judged if a.speed is not None]),
        "p_e": _quantiles([a.p_e for a in judged if a.p_e is not None]),
        "speed_sigma": _quantiles(_of(judged, "speed_sigma")),
        "nis": _quantiles(_of(judged, "nis"), 2),
        "incidents": [f"{i.kind}, {i.dives} dives" for i in store.incidents(glider)],
    }


def _of(dives: Sequence[Assessment], key: str) -> list[float]:
    return [a.evidence[key] for a in dives if key in a.evidence]


def _counted(values: Any) -> dict[str, int]:
    return dict(sorted(Counter(values).items()))


def _quantiles(values: Sequence[float], digits: int = 4) -> list[float]:
    """Least, quartiles and greatest."""
    return [_round(x, digits) for x in np.quantile(values, [0, 0.25, 0.5, 0.75, 1])] if values else []


def _round(value: float, digits: int) -> float:
    return round(float(value), digits)


def median_misfit(segments: Sequence[Segment], *, rotate_heading: bool, rotate_current: bool) -> float:
    """Median over dives of |ground - current - speed on board times mean heading| (m/s), the closure test.

    Headings and currents are rotated by the declination or left relative to magnetic north.
    """
    state, dives = Navigation(), {}
    for s in segments:
        state, told = extend(state, _turned_back(s, rotate_heading, rotate_current))
        dives |= {d.t_dive: d for d in told}
    out = []
    for dive in dives.values():
        if dive.track is None or dive.current is None or dive.features.onboard_speed is None:
            continue
        found = closure(dive.track, dive.current)
        along = found.along_speed - dive.features.onboard_speed
        out.append(float(np.hypot(along, found.across_misfit)))
    return float(np.median(out))


def _turned_back(s: Segment, heading: bool, current: bool) -> Segment:
    """The segment with what is not to be rotated turned the other way beforehand."""
    angle = s.declination or 0.0
    held = dict(s.quantities)
    if not heading:
        for name in ("heading", "heading_commanded"):
            if name in held:
                held[name] = Series(held[name].t, readonly((held[name].v - angle) % (2 * np.pi)))
    if not current:
        for kind in ("current", "current_final"):
            x, y = held.get(f"{kind}_x"), held.get(f"{kind}_y")
            if x is not None and y is not None:
                pair = magnetic_to_true(np.column_stack([x.v, y.v]), -angle)
                held[f"{kind}_x"] = Series(x.t, readonly(pair[:, 0]))
                held[f"{kind}_y"] = Series(y.t, readonly(pair[:, 1]))
    return replace(s, quantities=held)
