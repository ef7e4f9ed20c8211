"""Which of the reported satellite positions are new fixes. Pure.

A glider goes on reporting its last fix until it has a new one, also as the first line of a file, and
now and then a wild one (`domain` notes in `docs/how-it-decides.md`).
"""

from __future__ import annotations

import numpy as np

from gliderwatch.model import Fix
from gliderwatch.navigation.frame import to_plane
from gliderwatch.navigation.samples import Samples, get

FASTEST = 3.0
"""m/s over ground at the surface: more between two fixes close in time means that one is old or wild."""
SURFACE_SPELL = 600.0
"""Seconds: fixes closer in time than this are of one stay at the surface."""
SUSPECT = 30.0
"""Metres: a fix this near to the last one from before a dive may be the old one again."""


def distance(a: Fix, b: Fix) -> float:
    """Metres between two fixes."""
    return float(np.hypot(*to_plane(b.lat, b.lon, a.lat, a.lon)))


def _clash(a: Fix, b: Fix) -> bool:
    """Whether two fixes of one stay at the surface cannot both be right."""
    return b.t - a.t < SURFACE_SPELL and distance(a, b) > FASTEST * (b.t - a.t) + SUSPECT


def new_fixes(samples: Samples, last: Fix | None) -> list[Fix]:
    """The fixes of `samples` in order of time that are new, seen from the `last` good one.

    Left out: repeats of the value before, wild single values, and old values that the next fix
    contradicts. A fix closer than `SUSPECT` to the one before a dive counts only if another
    follows it.
    """
    lat, lon = get(samples, "fix_lat"), get(samples, "fix_lon")
    reported = [Fix(float(t), float(a), float(o)) for t, a, o in zip(lat.t, lat.v, lon.v, strict=True)]
    fixes: list[Fix] = []
    before = last
    for fix in reported:
        if before is None or (fix.lat, fix.lon) != (before.lat, before.lon):
            if before is None or fix.t > before.t:
                fixes.append(fix)
            before = fix
    kept = _without_contradicted(_without_wild(fixes))
    if last is not None and len(kept) == 1 and _may_be_old(last, kept[0]):
        return []
    return kept


def _without_wild(fixes: list[Fix]) -> list[Fix]:
    """Drop a fix that clashes with both neighbours while these agree with each other."""
    out: list[Fix] = []
    for i, fix in enumerate(fixes):
        if 0 < i < len(fixes) - 1:
            a, b = fixes[i - 1], fixes[i + 1]
            if _clash(a, fix) and _clash(fix, b) and not _clash(a, b):
                continue
        out.append(fix)
    return out


def _without_contradicted(fixes: list[Fix]) -> list[Fix]:
    """Drop a fix that the next one of the same stay contradicts: it was the old one, still reported."""
    return [f for i, f in enumerate(fixes) if i + 1 == len(fixes) or not _clash(f, fixes[i + 1])]


def _may_be_old(last: Fix, fix: Fix) -> bool:
    return fix.t - last.t > SURFACE_SPELL and distance(last, fix) < SUSPECT
