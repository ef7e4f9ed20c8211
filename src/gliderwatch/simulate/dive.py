"""One dive: the sawtooth, the way steered, the current, and what is true of it."""

from __future__ import annotations

from math import hypot

import numpy as np

from gliderwatch.simulate.instruments import Reckoning, Way, log_dive, log_science
from gliderwatch.simulate.motion import Motion, fly
from gliderwatch.simulate.onboard import Vector, along_heading, displacement, own_speed
from gliderwatch.simulate.scenario import DiveTruth
from gliderwatch.simulate.steering import steer
from gliderwatch.simulate.telemetry import CYCLE
from gliderwatch.simulate.vehicle import NODE, Flown, Glider

_DEPTH_NOISE, _PITCH_NOISE, _COMPASS_NOISE = 0.04, 0.005, 0.01


def dive(glider: Glider, segment: str) -> Flown:
    """Dive, and be at the surface again; ``segment`` names the file that logs it."""
    scenario, rng, start = glider.scenario, glider.rng, glider.cycle
    _face_the_stream(glider)
    glider.trim_anew()
    motion = fly(glider)
    n = len(motion.depth)
    t = glider.times(start + np.arange(n))
    depth = np.clip(motion.depth + _DEPTH_NOISE * rng.standard_normal(n), 0.0, None)
    pitch = motion.pitch + _PITCH_NOISE * rng.standard_normal(n)
    believed = own_speed(depth, pitch, CYCLE)
    course = steer(glider, believed)
    kept = np.interp(np.arange(n), NODE * np.arange(len(course.kept)), np.unwrap(course.kept))
    compass = kept + scenario.variation + _COMPASS_NOISE * rng.standard_normal(n)
    reckoning = Reckoning(depth, pitch, compass, believed, *along_heading(believed, compass, CYCLE))
    log_dive(glider, motion, course, reckoning)
    east, north = along_heading(motion.speed, kept - glider.health.compass(t), CYCLE)
    at = np.unique(np.append(np.arange(0, n, NODE), n - 1))
    far_east, far_north = glider.carried(t[at], east[at], north[at], motion.depth[at])
    log_science(glider, motion, Way(t[at], glider.east + east[at] + far_east))
    end, duration = start + n - 1, CYCLE * (n - 1)
    through = Vector(float(east[-1]) / duration, float(north[-1]) / duration)
    current = Vector(float(far_east[-1]) / duration, float(far_north[-1]) / duration)
    glider.move(end, float(east[-1] + far_east[-1]), float(north[-1] + far_north[-1]))
    truth = _truth(glider, segment, (start, end), motion, float(believed.mean()), through, current)
    return Flown(start, end, Vector(float(reckoning.east[-1]), float(reckoning.north[-1])), truth)


def _truth(
    glider: Glider,
    segment: str,
    cycles: tuple[int, int],
    motion: Motion,
    believed: float,
    through: Vector,
    current: Vector,
) -> DiveTruth:
    start, end = (glider.time(cycle) for cycle in cycles)
    return DiveTruth(
        segment=segment,
        t_dive=start,
        t_surface=end,
        speed=float(motion.speed.mean()),
        believed_speed=believed,
        through_water=through,
        current=current,
        faults=glider.health.named(end),
        depth_rate=float(np.abs(np.diff(motion.depth)).mean() / CYCLE),
        deepest=float(motion.depth.max()),
        end=glider.place,
    )


def _face_the_stream(glider: Glider) -> None:
    """A strong current sets against the way to the waypoint that the glider had when it began."""
    goal = displacement(glider.place, glider.scenario.waypoints[glider.waypoint])
    away = hypot(goal.east, goal.north)
    began = float(glider.health.stream(np.array(glider.time(glider.cycle)))) > 0
    if away and not (began and any(glider.against)):
        glider.against = Vector(-goal.east / away, -goal.north / away)
