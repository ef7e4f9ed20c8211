"""Dives for tests of the joint estimator, made of what is true of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gliderwatch.model import Current, Dive, DiveFeatures, Fix, Track, readonly
from gliderwatch.navigation.geodesy import from_plane

START = 1_700_000_000.0
HOUR, DAY = 3600.0, 86400.0
SURFACE = 600.0
"""s at the surface between two dives."""
LAT, LON = 27.5, -84.0
FEATURES = DiveFeatures(duration=3 * HOUR, pitch_dive=-0.45, pitch_climb=0.45, roll_mean=0.0)


@dataclass(frozen=True)
class Way:
    """One dive as it truly is.

    ``heading`` (rad, counter-clockwise from east; several: one after another in equal times), true ``speed``
    and the glider's ``own`` (m/s), mean ``flow`` (m/s); the way is ``turned`` off the heading (rad,
    clockwise), the reported current ``wrong`` (m/s; None: not reported); mean ``roll`` (rad), setting of the
    ``thruster``.
    """

    heading: float | Sequence[float] = 0.0
    speed: float = 0.23
    own: float = 0.25
    flow: tuple[float, float] = (0.05, 0.02)
    turned: float = 0.0
    wrong: tuple[float, float] | None = (0.0, 0.0)
    roll: float = 0.0
    thruster: float = 0.0


def dive(k: int, way: Way, hours: float = 3.0, samples: int = 24, start: Fix | None = None) -> Dive:
    """The ``k``-th dive of a mission of dives of equal length, 10 minutes apart."""
    t0 = START + k * (hours * HOUR + SURFACE)
    angles = np.repeat(np.atleast_1d(way.heading), -(-samples // np.size(way.heading)))[:samples]
    vectors = np.column_stack([np.cos(angles), np.sin(angles)])
    t = np.linspace(t0, t0 + hours * HOUR, samples + 1)
    c, s = np.cos(way.turned), np.sin(way.turned)
    through = way.speed * vectors @ np.array([[c, -s], [s, c]])
    rates = through + np.array(way.flow)
    x = np.vstack([np.zeros(2), np.cumsum(rates * np.diff(t)[:, None], axis=0)])
    believed = way.own * vectors.mean(axis=0)
    reported = x[-1] / (hours * HOUR) - believed
    begin = start if start is not None else Fix(t0, LAT, LON)
    return Dive(
        glider="unit",
        segment=f"unit-{k}",
        t_dive=t0,
        t_surface=t0 + hours * HOUR,
        start=Fix(t0, begin.lat, begin.lon),
        end=Fix(t0 + hours * HOUR, *from_plane(x[-1], begin.lat, begin.lon)),
        track=Track(readonly(t), readonly(x), readonly(vectors)),
        current=None if way.wrong is None else Current(*(reported + way.wrong).tolist(), final=True),
        reason="",
        n_samples=samples,
        features=replace(FEATURES, duration=hours * HOUR, roll_mean=way.roll, thruster=way.thruster),
    )


def mission(ways: Sequence[Way], hours: float = 3.0, wind: tuple[float, float] = (0.0, 0.0)) -> list[Dive]:
    """Dives one after another, each from where the glider has drifted to with the flow and ``wind`` (m/s)."""
    out: list[Dive] = []
    start = None
    for k, way in enumerate(ways):
        out.append(dive(k, way, hours, start=start))
        end = out[-1].end
        assert end is not None
        drift = SURFACE * (np.array(way.flow) + wind)
        start = Fix(end.t + SURFACE, *from_plane(drift, end.lat, end.lon))
    return out


def wandering(n: int, seed: int, hours: float = 3.0, size: float = 0.06, memory: float = 30.0) -> np.ndarray:
    """A flow (m/s, (n, 2)) from dive to dive: Ornstein-Uhlenbeck of a size (m/s) and memory (h)."""
    rng = np.random.default_rng(seed)
    left = np.exp(-(hours + 1 / 6) / memory)
    flow = [size * rng.standard_normal(2)]
    for _ in range(n - 1):
        flow.append(left * flow[-1] + size * np.sqrt(1 - left**2) * rng.standard_normal(2))
    return np.array(flow)


def ways(n: int, seed: int, heading: Callable[[int], float], **more: object) -> list[Way]:
    """Ways through a wandering flow."""
    flow = wandering(n, seed)
    return [Way(heading=heading(k), flow=tuple(flow[k].tolist()), **more) for k in range(n)]  # type: ignore[arg-type]
