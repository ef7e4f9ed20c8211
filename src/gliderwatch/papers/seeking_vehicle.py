"""The water, the CTD and the vehicle of paper 004, and a run of its loop on them (Figs. 5 to 10). Pure."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np

from gliderwatch.model import Array, readonly
from gliderwatch.papers.extremum_seeking import Cost, Loop, Mode, SeekingParams, drive


@dataclass(frozen=True, slots=True)
class Water:
    """A profile: ``value`` at ``depth`` (m, increasing), straight between, the same above and below; the
    ``layers`` in it, (top, bottom) in m, and the depth of the ``bottom`` (m)."""

    depth: tuple[float, ...]
    value: tuple[float, ...]
    layers: tuple[tuple[float, float], ...]
    bottom: float

    def at(self, z: float) -> float:
        """The value at depth `z` (m)."""
        return float(np.interp(z, self.depth, self.value))


class Cast(StrEnum):
    """States of the CTD, 004 Fig. 6."""

    DOWN = "downcast"
    TO_UP = "transient down-up"
    UP = "upcast"
    TO_DOWN = "transient up-down"


_TURNING, _WITHIN = 0.1, 0.05
"""m/s: about to turn where the mean speed is this far from 0, give or take (004, "Emulation")."""


@dataclass(slots=True)
class Ctd:
    """A CTD that measures another profile on the way up than on the way down (004 eq. 9, Fig. 6).

    On the way up the profile is `shift` m nearer to the surface; after a turn the two are blended over
    `transient` s. A turn begins where the speed, averaged over `n` steps, is slow and falls.
    """

    n: int
    dt: float
    shift: float = 1.0
    transient: float = 15.0
    _cast: Cast = field(init=False, default=Cast.DOWN)
    _since: float = field(init=False, default=0.0)
    _speeds: deque[float] = field(init=False)
    _mean: float = field(init=False, default=0.0)

    def __post_init__(self) -> None:
        self._speeds = deque(maxlen=self.n)

    def measure(self, t: float, z: float, speed: float, at: Callable[[float], float]) -> float:
        """What it says at `t` (s) and depth `z` (m), sinking at `speed` (m/s), in water `at(z)`."""
        self._speeds.append(speed)
        mean = sum(self._speeds) / len(self._speeds)
        self._change(t, mean, mean - self._mean)
        self._mean = mean
        down, up = at(z), at(z + self.shift)
        part = min((t - self._since) / self.transient, 1.0)
        match self._cast:
            case Cast.DOWN:
                return down
            case Cast.UP:
                return up
            case Cast.TO_UP:
                return (1 - part) * down + part * up
            case Cast.TO_DOWN:
                return part * down + (1 - part) * up

    def _change(self, t: float, mean: float, change: float) -> None:
        sign = 1.0 if self._cast is Cast.DOWN else -1.0
        turning = abs(sign * mean - _TURNING) < _WITHIN and sign * change < 0
        done = t - self._since > self.transient
        match self._cast:
            case Cast.DOWN if turning:
                self._cast, self._since = Cast.TO_UP, t
            case Cast.UP if turning:
                self._cast, self._since = Cast.TO_DOWN, t
            case Cast.TO_UP if done:
                self._cast = Cast.UP
            case Cast.TO_DOWN if done:
                self._cast = Cast.DOWN


@dataclass(frozen=True, slots=True)
class Vehicle:
    """Depth ``z`` (m) and sinking ``speed`` (m/s) of a vehicle that follows a desired depth as a second-order
    system, critically damped: 004 names a PID controller on eq. (7) and gives no numbers of it."""

    z: float = 0.0
    speed: float = 0.0

    def follow(self, u: float, dt: float, bandwidth: float = 1.0) -> Vehicle:
        """The vehicle `dt` s later, on its way to `u` (m); `bandwidth` in rad/s."""
        speed = self.speed + dt * (bandwidth**2 * (u - self.z) - 2 * bandwidth * self.speed)
        return Vehicle(self.z + dt * speed, speed)


@dataclass(frozen=True, slots=True)
class Run:
    """What happened at each control step: ``t`` (s), ``depth`` (m), what the CTD ``measured``, the ``cost``
    (1, of the largest) and the ``mode``; ``resets`` is how often the layer was lost."""

    t: Array
    depth: Array
    measured: Array
    cost: Array
    mode: tuple[Mode, ...]
    resets: int

    @property
    def tracking(self) -> Array:
        """1 where the loop tracks a layer, else 0."""
        return np.array([mode is Mode.TRACK for mode in self.mode], dtype=float)

    def until(self, t: float) -> Run:
        """Its steps before `t` (s)."""
        n = int(np.searchsorted(self.t, t))
        return replace(
            self,
            t=self.t[:n],
            depth=self.depth[:n],
            measured=self.measured[:n],
            cost=self.cost[:n],
            mode=self.mode[:n],
        )


def fly(
    params: SeekingParams, water: Water, noise: Array, shift: Callable[[float], float] = lambda t: 0.0
) -> Run:
    """A run of the loop, in water whose layers lie `shift(t)` m deeper at `t` s.

    `noise` ((n,), unit of the value) is what the CTD adds at each of the n control steps (xi of eq. 9).
    """
    n = len(noise)
    window = max(round(params.window / params.dt), 1)
    vehicle, loop = Vehicle(), Loop()
    ctd, cost = Ctd(max(round(1.0 / params.dt), 1), params.dt), Cost(window, params.z_min)
    depth, measured, costs = np.empty(n), np.empty(n), np.empty(n)
    modes = list[Mode]()
    for i in range(n):
        t = i * params.dt
        deeper = shift(t)
        value = ctd.measure(t, vehicle.z, vehicle.speed, lambda z: water.at(z - deeper))  # noqa: B023
        value += float(noise[i])
        raw = cost.add(vehicle.z, value)
        loop = drive(loop, t, raw, water.bottom, params)
        depth[i], measured[i] = vehicle.z, value
        costs[i] = raw / loop.largest if loop.largest > 0 else 0.0
        modes.append(loop.mode)
        vehicle = vehicle.follow(loop.u, params.dt)
    times = readonly(np.arange(n) * params.dt)
    return Run(times, readonly(depth), readonly(measured), readonly(costs), tuple(modes), loop.resets)


def legs(run: Run, start: float = 0.0) -> list[tuple[int, int]]:
    """First and last step of each whole leg, from turn to turn, after `start` (s)."""
    sign = np.sign(np.diff(run.depth))
    turns = np.flatnonzero(sign[1:] * sign[:-1] < 0) + 1
    turns = turns[run.t[turns] >= start]
    return list(zip(turns[:-1].tolist(), turns[1:].tolist(), strict=True))


def coverage(run: Run, layers: tuple[tuple[float, float], ...], start: float = 0.0) -> list[float]:
    """The part of the height of the `layers` (m) that each whole leg after `start` (s) went through."""
    height = sum(bottom - top for top, bottom in layers)
    out = []
    for i, j in legs(run, start):
        low, high = sorted((float(run.depth[i]), float(run.depth[j])))
        seen = sum(max(min(bottom, high) - max(top, low), 0.0) for top, bottom in layers)
        out.append(seen / height)
    return out


def outside(run: Run, layers: tuple[tuple[float, float], ...], start: float = 0.0) -> float:
    """The part of the way up and down after `start` (s) that is outside the `layers` (m)."""
    keep = run.t[1:] >= start
    way = np.abs(np.diff(run.depth))[keep]
    middle = ((run.depth[1:] + run.depth[:-1]) / 2)[keep]
    inside = np.zeros(len(middle), dtype=bool)
    for top, bottom in layers:
        inside |= (middle >= top) & (middle <= bottom)
    return float(way[~inside].sum() / way.sum()) if way.sum() > 0 else 0.0


# --------------------------------------------------------------------------- presets


@dataclass(frozen=True, slots=True)
class Preset:
    """A run of the paper: its parameters, its water, and how long (s)."""

    params: SeekingParams
    water: Water
    seconds: float


PRESETS = {
    # Fig. 5 as read from the figure; Table 1.
    "simulation": Preset(
        SeekingParams(),
        Water(
            (0, 7, 8, 9.5, 13, 15.5, 20),
            (10, 10, 11.5, 11.5, 8.5, 8.5, 7.8),
            ((7.0, 8.0), (9.5, 13.0)),
            20.0,
        ),
        1000.0,
    ),
    # Table 2 and Fig. 10 (down in 100 s, the loop begins at 5.5 m). Of the profile of Fig. 9 the text
    # gives depths only; the temperatures are ours, with a lower layer a little more than half as steep as
    # the upper: so the loop sinks as in Fig. 10. A steeper one it meets first.
    "field": Preset(
        SeekingParams(
            period=111.0,
            amplitude=0.032,
            gain=8e-4,
            r=5e-6,
            q=5e-5,
            z_min=0.2,
            threshold=0.6,
            dt=1 / 9,
            speed=0.2,
        ),
        Water(
            (0, 3, 6.5, 7.5, 13.5, 15.5, 20),
            (13.4, 13.0, 10.7, 9.4, 8.8, 7.4, 7.1),
            ((3.0, 7.5), (13.5, 15.5)),
            20.0,
        ),
        1500.0,
    ),
}
"""The runs of Figs. 7 and 8, and of Figs. 9 and 10."""
