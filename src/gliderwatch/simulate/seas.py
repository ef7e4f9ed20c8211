"""Kinds of sea, and one glider's mission in each for every seed. Pure.

What makes a kind is the range that each of its numbers is drawn from; they are those of real seas, and
know nothing of what will be estimated. Each seed draws: the place and the date; strength, shape,
inclination and phases of the tides; the wandering part, the front; where the waypoints are, how often
the glider comes up, how deep it goes, how fast it flies, which sensors it sends at what cadence.

Ranges: M2 of shelf seas up to 0.7 m/s, S2 a quarter to a half of it and N2 a fifth (Pugh and Woodworth
2014, Sea-Level Science); K1 and O1 of 0.3 to 0.4 m/s on shelves whose tide is diurnal; near-inertial
motion of 0.1 to 0.3 m/s after storms (Alford et al. 2016, Annu. Rev. Mar. Sci. 8, 95-123); the wandering
part of depth-averaged currents 4 to 8 cm/s a component in the open sea, more on shelves under wind.
Water that is denser or lighter makes the speed of healthy gliders wander by 1 to 4 % (on real missions it
changes by 0.3 to 1.5 cm/s from dive to dive).
No two gliders are alike: drag and lift of the airframe differ by 10 and 5 %, and on board nothing to half of
the loss by the angle of attack is allowed for: a depth-averaged current is 5 to 10 % of the speed off.
Inertial motion has the period of M2 at 74.5 degrees of latitude, of K1 at 30.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import cos, pi, sin, sqrt

import numpy as np

from gliderwatch.simulate.flight import Airframe, Point, Vector, offset
from gliderwatch.simulate.ocean import Bottom, Constituent, Ellipse, Front, Sea, Water
from gliderwatch.simulate.scenario import Fault, FixIn, Scenario
from gliderwatch.simulate.telemetry import CADENCE
from gliderwatch.slocum.sensors import model_declination

Range = tuple[float, float]
_NOTHING: Range = (0.0, 0.0)
_HOUR, _DAY = 3600.0, 86400.0
_USUAL_HOURS = 3.0
_FIRST_START, _LAST_START = 1514764800.0, 1735689600.0
"""2018 to 2025: what the World Magnetic Model holds."""
_OCEANS: tuple[Range, ...] = ((-60.0, -15.0), (-170.0, -120.0))
"""Longitudes (degrees) of open water."""
_DEEP = 250.0
_GRAVITY = 9.81


@dataclass(frozen=True, slots=True)
class SeaKind:
    """Ranges that the numbers of a sea, and of the mission in it, are drawn from.

    ``m2``, ``k1`` (m/s) are major axes, ``m2_ratio``, ``k1_ratio`` minor by major axis; ``mean`` and
    ``sigma`` (m/s) the lasting and the wandering current, ``memory`` (h) and ``size`` (km) of the latter;
    ``inertial`` and ``front`` (m/s); ``latitude`` (degrees), of either hemisphere if ``both``; ``depth`` (m)
    of the lower turn, ``hours`` from surfacing to surfacing; on a ``shelf`` the bottom is within reach.
    """

    about: str
    m2: Range = _NOTHING
    m2_ratio: Range = _NOTHING
    k1: Range = _NOTHING
    k1_ratio: Range = (0.1, 0.7)
    mean: Range = (0.0, 0.06)
    sigma: Range = (0.03, 0.06)
    memory: Range = (25.0, 60.0)
    size: Range = (25.0, 60.0)
    inertial: Range = _NOTHING
    front: Range = _NOTHING
    latitude: Range = (35.0, 60.0)
    both: bool = False
    depth: Range = (40.0, 200.0)
    hours: Range = (1.0, 12.0)
    shelf: bool = False


SEAS: Mapping[str, SeaKind] = {
    "slack": SeaKind(
        "the open ocean: hardly a tide, eddies that wander",
        m2=(0.0, 0.04),
        m2_ratio=(0.2, 0.8),
        k1=(0.0, 0.02),
        sigma=(0.04, 0.08),
        memory=(30.0, 120.0),
        latitude=(15.0, 45.0),
        both=True,
        depth=(100.0, 1000.0),
    ),
    "front": SeaKind(
        "a boundary current with a front that meanders",
        m2=(0.02, 0.08),
        m2_ratio=(0.2, 0.8),
        sigma=(0.06, 0.10),
        size=(40.0, 80.0),
        inertial=(0.03, 0.08),
        front=(0.4, 1.2),
        latitude=(25.0, 40.0),
        both=True,
        depth=(150.0, 800.0),
    ),
    "rectilinear": SeaKind("a shelf sea whose tide goes to and fro", m2=(0.3, 0.7), m2_ratio=(0.0, 0.12)),
    "elliptic": SeaKind("a shelf sea with tides on ellipses", m2=(0.3, 0.7), m2_ratio=(0.25, 0.6)),
    "rotary": SeaKind("a shelf sea whose tide turns", m2=(0.3, 0.55), m2_ratio=(0.65, 1.0)),
    "diurnal": SeaKind(
        "a shelf sea whose tides are of a day",
        m2=(0.02, 0.08),
        m2_ratio=(0.0, 0.8),
        k1=(0.3, 0.4),
        latitude=(15.0, 55.0),
    ),
    "mixed": SeaKind(
        "tides of half a day and of a day",
        m2=(0.15, 0.4),
        m2_ratio=(0.0, 0.8),
        k1=(0.12, 0.3),
        latitude=(20.0, 55.0),
        both=True,
    ),
    "deep-inertial": SeaKind(
        "dives to 1000 m, with inertial motion above",
        m2=(0.01, 0.05),
        m2_ratio=(0.2, 0.8),
        k1=(0.01, 0.03),
        sigma=(0.05, 0.10),
        memory=(50.0, 150.0),
        inertial=(0.10, 0.30),
        latitude=(20.0, 60.0),
        both=True,
        depth=(950.0, 1000.0),
        hours=(3.0, 12.0),
    ),
    "critical-30": SeaKind(
        "30 N, where inertial motion has the period of the tide of a day",
        m2=(0.02, 0.10),
        m2_ratio=(0.0, 0.8),
        k1=(0.06, 0.20),
        inertial=(0.10, 0.25),
        latitude=(29.5, 30.5),
        depth=(60.0, 300.0),
    ),
    "critical-74": SeaKind(
        "74.5 N, where inertial motion has the period of the tide of half a day",
        m2=(0.10, 0.35),
        m2_ratio=(0.0, 0.9),
        k1=(0.02, 0.06),
        inertial=(0.08, 0.20),
        latitude=(74.0, 75.0),
        depth=(60.0, 300.0),
    ),
    "shallow": SeaKind(
        "a shelf of 20 to 50 m under wind and tide, short dives",
        m2=(0.15, 0.5),
        m2_ratio=(0.0, 0.6),
        k1=(0.02, 0.08),
        sigma=(0.06, 0.12),
        memory=(15.0, 40.0),
        inertial=(0.02, 0.08),
        depth=(20.0, 50.0),
        hours=(1.0, 3.0),
        shelf=True,
    ),
}
"""The kinds of sea, by name."""


def sea_mission(name: str, seed: int, *, days: float = 30.0) -> Scenario:
    """A healthy glider's mission of some days in a sea of a kind of `SEAS`; gliders of even seeds come up
    every three hours, as most do. Raises KeyError for a kind that is none."""
    kind = SEAS[name]
    chance = zlib.crc32(f"{name}/{seed}".encode())
    rng = np.random.default_rng(np.random.SeedSequence(chance))
    place, start = _place(kind, rng), float(rng.uniform(_FIRST_START, _LAST_START))
    depth, hours = _log_uniform(kind.depth, rng), _log_uniform(kind.hours, rng)
    is_deep = depth > _DEEP
    own = np.random.default_rng(np.random.SeedSequence(chance, spawn_key=(1,)))
    return Scenario(
        seed=chance,
        glider="sea",
        start=round(start),
        days=days,
        place=place,
        waypoints=_waypoints(place, rng),
        variation=-model_declination(place.lat, place.lon, start)[0],
        sea=_sea(kind, depth, rng),
        airframe=_airframe(own),
        allowed=float(own.uniform(0.0, 0.5)),
        pitch=float(rng.uniform(0.42, 0.48)),
        drive=float(rng.uniform(200e-6, 270e-6) if is_deep else rng.uniform(100e-6, 150e-6)),
        drive_sigma=float(rng.uniform(0.02, 0.08)),
        depths=(float(rng.uniform(3.0, 10.0)), depth),
        interval=_HOUR * (hours if seed % 2 else _USUAL_HOURS),
        communications=(float(rng.uniform(240.0, 420.0)), float(rng.uniform(600.0, 1800.0))),
        wind_drift=Vector(*_turned(rng.uniform(0.0, 0.1), rng)),
        heading_sigma=float(rng.uniform(0.04, 0.12)),
        fix_in=FixIn.OWN if rng.random() < 0.5 else FixIn.NEXT,
        surface_segments=bool(rng.random() < 0.5),
        cadence=_SENT[int(rng.integers(len(_SENT)))],
        bottom=Bottom(depth + 5.0, hills=1.5) if kind.shelf else None,
        water=Water(layers=()),
    )


def with_fault(scenario: Scenario, fault: Fault) -> Scenario:
    """The same mission with a fault; all is the same until the fault begins."""
    return replace(scenario, faults=(fault,))


# --------------------------------------------------------------------------- what is drawn


def _draw(bounds: Range, rng: np.random.Generator) -> float:
    return float(rng.uniform(*bounds))


def _log_uniform(bounds: Range, rng: np.random.Generator) -> float:
    return float(np.exp(rng.uniform(*np.log(bounds))))


def _turned(length: float, rng: np.random.Generator) -> tuple[float, float]:
    """A vector of a length in any direction."""
    angle = rng.uniform(0.0, 2 * pi)
    return float(length * cos(angle)), float(length * sin(angle))


def _place(kind: SeaKind, rng: np.random.Generator) -> Point:
    lat = _draw(kind.latitude, rng)
    south = kind.both and rng.random() < 0.5
    return Point(-lat if south else lat, _draw(_OCEANS[int(rng.integers(len(_OCEANS)))], rng))


def _airframe(rng: np.random.Generator) -> Airframe:
    usual, (drag, lift) = Airframe(), np.clip(rng.standard_normal(2), -1.5, 1.5)
    return Airframe(
        parasite_drag=float(usual.parasite_drag * np.exp(0.1 * drag)),
        lift_slope=float(usual.lift_slope * np.exp(0.05 * lift)),
    )


def _waypoints(place: Point, rng: np.random.Generator) -> tuple[Point, ...]:
    """Two (a section, gone to and fro) to four (a box) within some tens of kilometres."""
    radius, first = rng.uniform(8e3, 40e3), rng.uniform(0.0, 2 * pi)
    n = int(rng.integers(2, 5))
    angles = first + 2 * pi * np.arange(n) / n + rng.uniform(-0.3, 0.3, n)
    lat, lon = offset(place, radius * np.sin(angles), radius * np.cos(angles))
    return tuple(Point(float(a), float(b)) for a, b in zip(lat, lon, strict=True))


def _sea(kind: SeaKind, depth: float, rng: np.random.Generator) -> Sea:
    front = None
    if kind.front != _NOTHING:
        front = Front(
            speed=_draw(kind.front, rng),
            width=float(rng.uniform(20e3, 40e3)),
            direction=float(rng.uniform(0.0, 2 * pi)),
            distance=float(rng.uniform(-50e3, 50e3)),
            amplitude=float(rng.uniform(5e3, 20e3)),
            wavelength=float(rng.uniform(100e3, 300e3)),
            phase_speed=float(rng.uniform(0.05, 0.2)),
        )
    return Sea(
        residual=_turned(_draw(kind.mean, rng), rng),
        sigma=_draw(kind.sigma, rng),
        tau=_HOUR * _draw(kind.memory, rng),
        scale=1e3 * _draw(kind.size, rng),
        tides=_tides(kind, depth, rng),
        shear=float(rng.uniform(0.2, 0.7)) if depth > _DEEP else float(rng.uniform(0.0, 0.3)),
        shear_depth=float(rng.uniform(100.0, 500.0)) if depth > _DEEP else float(rng.uniform(10.0, 40.0)),
        inertial=_draw(kind.inertial, rng),
        inertial_depth=float(rng.uniform(40.0, 200.0)),
        front=front,
    )


def _tides(kind: SeaKind, depth: float, rng: np.random.Generator) -> tuple[Ellipse, ...]:
    """Tides that are long waves: all of a species alike in shape and in the way they go."""
    celerity = sqrt(_GRAVITY * max(1.2 * depth, 30.0))
    way, growth = _turned(1.0, rng), _turned(float(rng.uniform(0.0, 1.0)) / 150e3, rng)
    m2, k1 = _draw(kind.m2, rng), _draw(kind.k1, rng)
    s2, n2, o1 = rng.uniform(0.25, 0.5), rng.uniform(0.15, 0.22), rng.uniform(0.75, 1.1)
    m4 = rng.uniform(0.02, 0.10) if kind.shelf else 0.0
    semidiurnal = (_draw(kind.m2_ratio, rng) * rng.choice([-1, 1]), rng.uniform(0.0, pi))
    diurnal = (_draw(kind.k1_ratio, rng) * rng.choice([-1, 1]), rng.uniform(0.0, pi))
    table = (
        (Constituent.M2, m2, semidiurnal),
        (Constituent.S2, s2 * m2, semidiurnal),
        (Constituent.N2, n2 * m2, semidiurnal),
        (Constituent.K1, k1, diurnal),
        (Constituent.O1, o1 * k1, diurnal),
        (Constituent.M4, m4 * m2, semidiurnal),
    )
    found = []
    for constituent, major, (ratio, inclination) in table:
        like = np.clip(ratio + rng.normal(0.0, 0.03), -1.0, 1.0)
        turn, phase = rng.normal(0.0, 0.08), rng.uniform(0.0, 2 * pi)
        slow = constituent.frequency / celerity
        if major > 0:
            found.append(
                Ellipse(
                    constituent,
                    major=float(major),
                    minor=float(like * major),
                    inclination=float(inclination + turn),
                    phase=float(phase),
                    lag=(slow * way[0], slow * way[1]),
                    growth=growth,
                )
            )
    return tuple(found)


_SPARSE: Mapping[str, float] = {
    "c_heading": 1800,
    "m_avg_speed": 1800,
    "m_de_oil_vol": 360,
    "m_depth": 120,
    "m_gps_lat": 4,
    "m_gps_lon": 4,
    "m_gps_mag_var": 60,
    "m_heading": 720,
    "m_lat": 1800,
    "m_lon": 1800,
    "m_pitch": 120,
    "m_roll": 360,
    "m_water_vx": 4,
    "m_water_vy": 4,
}
"""What a deep glider with a full list sends (as electa, 2022)."""
_RICH: Mapping[str, float] = {
    **CADENCE,
    "m_avg_speed": 60,
    "m_fin": 64,
    "m_heading": 32,
    "m_pitch": 32,
    "c_thruster_on": 300,
}
_OLD: Mapping[str, float] = {
    name: period
    for name, period in ({**CADENCE} | {"m_heading": 256, "m_pitch": 256, "m_depth": 64}).items()
    if name not in {"m_gps_mag_var", "m_roll", "m_final_water_vx", "m_final_water_vy"}
}
"""No variation, no roll, and the current in its one sensor alone."""
_SENT: tuple[Mapping[str, float], ...] = (CADENCE, _SPARSE, _RICH, _OLD)
"""Lists of sensors as real gliders send them: cadences (s)."""
