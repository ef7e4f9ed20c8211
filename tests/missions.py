"""Segments for tests of the core: made by hand, sample by sample, or decoded from real missions."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gliderwatch.errors import Retry
from gliderwatch.model import Assessment, Incident, Segment, SegmentId, Series, readonly
from gliderwatch.navigation.geodesy import from_plane
from gliderwatch.params import GliderParams
from gliderwatch.service.routing import Routing
from gliderwatch.service.transaction import process_file
from gliderwatch.slocum import folders
from gliderwatch.slocum.decode import decode
from gliderwatch.store import codec
from gliderwatch.store.state_file import File, Status, Store

START = 1_700_000_000.0
LAT, LON = 36.0, -70.0
REAL = ("electa-2022", "usf-sam-2019", "george-2024", "osu-2025", "maria-2022")


def series(samples: Mapping[float, float] | Sequence[tuple[float, float]]) -> Series:
    """A series of pairs of time and value."""
    pairs = sorted(samples.items() if isinstance(samples, Mapping) else samples)
    return Series(readonly([t for t, _ in pairs]), readonly([v for _, v in pairs]))


def segment(
    name: str,
    opened: float,
    quantities: Mapping[str, Sequence[tuple[float, float]]],
    *,
    last: float | None = None,
    declination: float | None = 0.0,
    source: str = "glider",
    glider: str = "unit",
    complete: int | None = None,
) -> Segment:
    """A segment of pairs (time, value) by quantity."""
    held = {k: series(v) for k, v in quantities.items() if len(v)}
    ends = [s.t[-1] for s in held.values()]
    n = sum(len(s) for s in held.values())
    return Segment(
        SegmentId(opened, glider, name),
        "test.mi",
        "sbd",
        float(max(ends, default=opened) if last is None else last),
        (1, n if complete is None else complete, ""),
        held,
        declination,
        source,
    )


@dataclass(frozen=True)
class Leg:
    """One dive as it truly was.

    Speed through water (m/s), heading (rad, true), current (m/s: east, north), hours under water, error
    (m/s) of the current first published, and of the corrected one.
    """

    speed: float = 0.3
    heading: float = 1.0
    current: tuple[float, float] = (0.1, -0.05)
    hours: float = 2.0
    first_error: float = 0.02
    final_error: float = 0.0


FIRST_FIX, DIVES, SURFACE, GAP = 30.0, 180.0, 150.0, 300.0
"""Seconds from the opening of a segment to its first fix and to its dive, from the end of the dive to
that of the segment, and to the next segment."""


def opened(legs: Sequence[Leg], k: int) -> float:
    """When segment `k` of `mission` opens (s)."""
    return START + sum(DIVES + 3600 * leg.hours + SURFACE + GAP for leg in legs[:k])


def mission(legs: Sequence[Leg], *, declination: float = 0.1, with_final: bool = True) -> list[Segment]:
    """One segment a dive: at its start the corrected current of the dive before, at its end the first one of
    its own. The glider reports headings and currents relative to magnetic north."""
    out, lat, lon, before, last_t = [], LAT, LON, None, START
    for k, leg in enumerate(legs):
        t0 = opened(legs, k)
        current = np.array(leg.current)
        samples: dict[str, list[tuple[float, float]]] = {}

        def put(t: float, values: dict[str, float], samples=samples) -> None:
            for name, value in values.items():
                samples.setdefault(name, []).append((float(t), float(value)))

        def moved(seconds: float, velocity: np.ndarray, place: tuple[float, float]) -> tuple[float, float]:
            return from_plane(velocity * seconds, *place)

        place = moved(t0 - last_t, current, (lat, lon))
        for t in (FIRST_FIX, 60.0, 90.0):
            put(t0 + t, dict(zip(("fix_lat", "fix_lon"), moved(t, current, place), strict=True)))
        if before is not None:
            put(t0 + 60.0, _published(before.current, before.final_error, declination, with_final))
        dive, end = t0 + DIVES, t0 + DIVES + 3600 * leg.hours
        own = leg.speed * np.array([np.sin(leg.heading), np.cos(leg.heading)])
        for t in np.arange(dive, end + 1, 300.0):
            half = (t - dive) / (end - dive)
            put(t, {"heading": (leg.heading - declination) % (2 * np.pi), "roll": 0.02})
            put(t, {"pitch": -0.4 if half < 0.5 else 0.4, "depth": 5 + 200 * (1 - abs(2 * half - 1))})
        place = moved(DIVES, current, place)
        place = moved(end - dive, current + own, place)
        for t in (40.0, 80.0, 120.0):
            put(end + t, dict(zip(("fix_lat", "fix_lon"), moved(t, current, place), strict=True)))
        put(end + 60.0, _published(leg.current, leg.first_error, declination, False))
        last_t = end + SURFACE
        lat, lon = moved(SURFACE, current, place)
        out.append(segment(f"unit-2023-318-0-{k}", t0, samples, last=last_t, declination=declination))
        before = leg
    return out


def _published(
    current: tuple[float, float], error: float, declination: float, final: bool
) -> dict[str, float]:
    c, s = np.cos(-declination), np.sin(-declination)
    u, v = current[0] + error, current[1] - error
    x, y = c * u + s * v, -s * u + c * v
    out = {"current_x": x, "current_y": y}
    return out | ({"current_final_x": x, "current_final_y": y} if final else {})


def cut(whole: Segment, t: float) -> Segment:
    """A copy whose transfer broke off: nothing of it is later than `t` (s), and it is the lesser one."""
    held = {k: s.between(-np.inf, t) for k, s in whole.quantities.items()}
    held = {k: s for k, s in held.items() if len(s)}
    share = sum(map(len, held.values())) / max(sum(map(len, whole.quantities.values())), 1)
    rank, n, _ = whole.completeness
    return replace(
        whole,
        quantities=held,
        completeness=(rank, int(share * (n - 1)), ""),
        last_t=float(min(whole.last_t, t)),
    )


# --------------------------------------------------------------------------- real missions


@functools.cache
def real(data: Path, name: str) -> tuple[Segment, ...]:
    """The segments of a real mission in order of time; those without a cache file are left out."""
    out = []
    for path in sorted((data / name / "from-glider").iterdir()):
        if folders.kind(path.name) is not None:
            try:
                out.append(decode(path, [data / name / "cache"]))
            except Retry:
                continue
    return tuple(sorted(out, key=lambda s: s.id))


# --------------------------------------------------------------------------- feeding


def feed(
    segments: Sequence[Segment],
    params: GliderParams | None = None,
    speaking: Routing | None = None,
    store: Store | None = None,
) -> Store:
    """The store after all `segments` were taken in, in the order given."""
    store = store if store is not None else Store.open(":memory:")
    for i, s in enumerate(segments):
        file = File(f"/{i}/{s.id.name}", 1, 1, Status.WAITING, s.id.glider, s.id.name)
        process_file(store, file, s, params or GliderParams(), speaking, 0.0)
    return store


@dataclass(frozen=True)
class Ending:
    """All that a store holds of one glider that must not depend on the order of arrival."""

    assessments: list[Assessment]
    incidents: list[Incident]
    state: bytes


def ending(store: Store, glider: str) -> Ending:
    """What the store holds of a glider, with the bytes of its last checkpoint."""
    state, left = store.segments.resume(SegmentId(float("inf"), glider, ""))
    assert left == []
    return Ending(store.assessments(glider), store.incidents(glider), codec.encode(state))
