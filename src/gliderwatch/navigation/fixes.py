"""Which of the reported satellite positions are new fixes, and a depth offset that shows at them. Pure.

A glider goes on reporting its last fix until it has a new one, also as the first line of a file, and
now and then a wild one (`domain` notes in `docs/how-it-decides.md`).
"""

from __future__ import annotations

from math import cos, hypot, radians
from types import MappingProxyType

import numpy as np

from gliderwatch.model import Fix, Series, readonly
from gliderwatch.navigation.constants import (
    FASTEST_OVER_GROUND,
    SURFACE_STAY,
    SUSPECT_DISTANCE,
    ZERO_DEPTHS,
    ZERO_LEAST,
    ZERO_MOST,
    ZERO_NEAR,
    ZERO_QUANTILE,
)
from gliderwatch.navigation.flight import Samples, get

# ----------------------------------------
# Which of the reported satellite positions are new fixes. Pure.
#
# A glider goes on reporting its last fix until it has a new one, also as the first line of a file, and
# now and then a wild one (`domain` notes in `docs/how-it-decides.md`).

_DEGREE = 111_195.0
"""Metres of a degree of a great circle."""


def distance(a: Fix, b: Fix) -> float:
    """Metres between two fixes on a sphere: good to 0.5 %, and quick, as there are many fixes."""
    east = ((b.lon - a.lon + 180.0) % 360.0 - 180.0) * cos(radians((a.lat + b.lat) / 2))
    return _DEGREE * hypot(east, b.lat - a.lat)


def _clash(a: Fix, b: Fix) -> bool:
    """Whether two fixes of one stay at the surface cannot both be right."""
    return b.t - a.t < SURFACE_STAY and distance(a, b) > FASTEST_OVER_GROUND * (b.t - a.t) + SUSPECT_DISTANCE


def new_fixes(samples: Samples, last: Fix | None) -> list[Fix]:
    """The fixes of `samples` in order of time that are new, seen from the `last` good one.

    Left out: repeats of the value before, wild single values, and old values that the next fix
    contradicts. A fix closer than `SUSPECT_DISTANCE` to the one before a dive counts only once another
    follows it.
    """
    kept = _consistent(_changed(samples, last))
    before = kept[-2] if len(kept) > 1 else last
    return kept[:-1] if before is not None and kept and _may_be_old(before, kept[-1]) else kept


def _changed(samples: Samples, last: Fix | None) -> list[Fix]:
    """The reported positions after `last` that differ from the one reported before them."""
    lat, lon = get(samples, "fix_lat"), get(samples, "fix_lon")
    out: list[Fix] = []
    before, t, positions = last, lat.t, np.array([lat.v, lon.v])
    if len(t) > 1 and (t[1:] > t[:-1]).all() and (last is None or t[0] > last.t):
        # most repeat the line before: those that do are no news
        news = np.flatnonzero(np.concatenate([[True], (positions[:, 1:] != positions[:, :-1]).any(axis=0)]))
        t, positions = t[news], positions[:, news]
    for at, a, o in zip(t.tolist(), *positions.tolist(), strict=True):
        if before is None or (at > before.t and (a, o) != (before.lat, before.lon)):
            before = Fix(at, a, o)
            out.append(before)
    return out


def _consistent(fixes: list[Fix]) -> list[Fix]:
    """The fixes without those that their neighbours of the same stay contradict.

    Of two that contradict each other the earlier one goes, as it may be the old one; but if it has
    a neighbour that agrees with it and the later one has not, the later one is wild.
    """
    out: list[Fix] = []
    for i, fix in enumerate(fixes):
        after = fixes[i + 1] if i + 1 < len(fixes) else None
        while out and _clash(out[-1], fix):
            before = out[-2] if len(out) > 1 else None
            backed = _agree(before, out[-1]) or _agree(out[-1], after)
            if backed and not _agree(fix, after):
                break
            out.pop()
        else:
            out.append(fix)
    return out


def _agree(a: Fix | None, b: Fix | None) -> bool:
    """Whether both are fixes of one stay at the surface and both can be right."""
    return a is not None and b is not None and b.t - a.t < SURFACE_STAY and not _clash(a, b)


def surface_intervals(fixes: list[Fix], apart: float) -> list[tuple[Fix, Fix]]:
    """The first and the last fix of each stay, in which none is more than ``apart`` (s) after the one before.

    >>> fixes = [Fix(t, 0.0, 0.0) for t in (0.0, 60.0, 120.0, 9000.0)]
    >>> [(a.t, b.t) for a, b in surface_intervals(fixes, 120.0)]
    [(0.0, 120.0), (9000.0, 9000.0)]
    """
    out: list[tuple[Fix, Fix]] = []
    for fix in fixes:
        if out and fix.t - out[-1][1].t <= apart:
            out[-1] = (out[-1][0], fix)
        else:
            out.append((fix, fix))
    return out


def _may_be_old(last: Fix, fix: Fix) -> bool:
    return fix.t - last.t > SURFACE_STAY and distance(last, fix) < SUSPECT_DISTANCE


# ----------------------------------------
# A depth sensor that does not show zero at the surface: its pressure was not zeroed.


def zeroed(fresh: Samples, fixes: list[Fix], before: float) -> tuple[Samples, float]:
    """The samples of a segment with depths from the surface, and what its sensor shows at the surface (m).

    That is seen at its new ``fixes``; without them it is as ``before``. 0: near enough.
    """
    depth = get(fresh, "depth")
    if not len(depth):
        return fresh, before
    shown = _at_surface(depth, [fix.t for fix in fixes])
    if shown is not None:
        before = shown if abs(shown) > ZERO_LEAST else 0.0
    if not before:
        return fresh, 0.0
    return MappingProxyType({**fresh, "depth": Series(depth.t, readonly(depth.v - before))}), before


def _at_surface(depth: Series, fixes: list[float]) -> float | None:
    """The depth shown at the fixes (m), None where too few are."""
    if not fixes:
        return None
    t = np.asarray(fixes)
    at = np.maximum(t.searchsorted(depth.t), 1) - 1
    gap = np.minimum(np.abs(depth.t - t[at]), np.abs(depth.t - t[np.minimum(at + 1, len(t) - 1)]))
    near = depth.v[gap <= ZERO_NEAR]
    if len(near) < ZERO_DEPTHS:
        return None
    shown = _quantile(near.tolist(), ZERO_QUANTILE)
    # nobody flies above the surface: a fix at which it is much deeper than elsewhere is an old one
    return shown if abs(shown) <= ZERO_MOST and depth.v.min() > shown - ZERO_LEAST else None


def _quantile(values: list[float], part: float) -> float:
    """The quantile of a few values, linear between them; numpy's is for thousands.

    >>> _quantile([4.0, 1.0, 2.0], 0.25)
    1.5
    """
    values = sorted(values)
    at = part * (len(values) - 1)
    below = int(at)
    step = values[min(below + 1, len(values) - 1)] - values[below]
    return values[below] + step * (at - below)
