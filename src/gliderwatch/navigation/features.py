"""What the files say of how a dive was flown: read from the samples, and published as evidence. Pure."""

from __future__ import annotations

from math import atan2, degrees
from statistics import median

import numpy as np

from gliderwatch.model import DiveFeatures, Series, Track, replace
from gliderwatch.navigation.constants import (
    DEPTHS_FOR_DEEPEST,
    DEPTHS_FOR_RATES,
    DIVING_DEPTH,
    FEW_RATES,
    FEW_SAMPLES,
    LEAST_RATE,
    PUMPED,
    RATE_INTERVAL,
    SPARSE,
    STEEP_PITCH,
)
from gliderwatch.navigation.flight import Flight, Samples, get
from gliderwatch.navigation.track import Closure, has_reckoning, mean_heading


def evidence(features: DiveFeatures, closed: Closure | None = None) -> dict[str, float]:
    """The numbers of a dive that are known, as they are published; keys and units: `docs/nomenclature.md`.

    >>> evidence(DiveFeatures(duration=5400.0, thruster=0.0))
    {'duration_h': 1.5, 'thruster': 0.0}
    """
    f, mean = features, features.heading_mean
    numbers = {
        "duration_h": f.duration / 3600,
        "fix_gap_minutes": None if f.fix_gap is None else f.fix_gap / 60,
        "drift_h": None if f.drift is None else f.drift / 3600,
        "ground_speed": f.ground_speed,
        "heading_steadiness": f.heading_steadiness,
        "heading_mean": None if mean is None else degrees(mean) % 360,
        "heading_commanded": f.heading_commanded or None,
        "heading_reckoned": float(f.heading_reckoned) or None,
        "heading_assumed": float(f.heading_assumed) or None,
        "surfacing_unseen": float(f.surfacing_unseen) or None,
        "depth_max": f.depth_max,
        "pitch_dive": f.pitch_dive,
        "pitch_climb": f.pitch_climb,
        "roll_mean": f.roll_mean,
        "roll_std": f.roll_std,
        "onboard_speed": f.onboard_speed,
        "thruster": f.thruster,
        "depth_rate_dive": f.depth_rate_dive,
        "depth_rate_climb": f.depth_rate_climb,
        "yos": None if f.yos is None else float(f.yos),
        "ballast_dive": f.ballast_dive,
        "ballast_climb": f.ballast_climb,
        "vacuum": f.vacuum,
        "heading_gap_h": None if f.heading_gap is None else f.heading_gap / 3600,
        "unobserved_h": f.unobserved / 3600 or None,
        "along_speed": None if closed is None else closed.along_speed,
        "across_misfit": None if closed is None else closed.across_misfit,
        "across_sigma": None if closed is None else closed.across_sigma,
    }
    return {key: value for key, value in numbers.items() if value is not None}


def track_features(samples: Samples, flight: Flight, track: Track) -> DiveFeatures:
    """The features of a dive between two fixes, without its gaps."""
    interval = float(track.t[-1] - track.t[0])
    mean, flown = mean_heading(track)
    commanded = get(samples, "commanded").between(flight.start, flight.end)
    headings = get(samples, "heading_e").between(flight.start, flight.end)
    reckoned = get(samples, "reckoned").between(flight.start, flight.end)
    unmeasured = len(commanded) > 0 or len(reckoned) > 0 or not len(headings)
    shaped = unmeasured and has_reckoning(samples, flight)
    return replace(
        flight_features(samples, flight),
        fix_gap=float(track.t[-1]) - flight.end,
        drift=interval - (flight.end - flight.start),
        ground_speed=float(np.hypot(*track.x[-1])) / interval,
        heading_steadiness=float(np.hypot(*mean)) * interval / max(flown, 1.0),
        heading_mean=atan2(mean[0], mean[1]),
        heading_commanded=len(commanded) / len(headings) if len(commanded) and not shaped else 0.0,
        heading_reckoned=shaped,
        heading_assumed=unmeasured and not shaped and not len(commanded),
    )


def flight_features(samples: Samples, flight: Flight) -> DiveFeatures:
    """What is known of a flight without its fixes: depth, attitude, pump, as far as reported."""
    depth, pitch, roll, speed, thruster, vacuum = (
        get(samples, name).between(flight.start, flight.end)
        for name in ("depth", "pitch", "roll", "speed_onboard", "thruster_on", "vacuum")
    )
    ballast_dive, ballast_climb = _volumes(samples, flight)
    depth_rate_dive, depth_rate_climb = _depth_rates(depth)
    well_sampled = len(depth) >= DEPTHS_FOR_DEEPEST and np.diff(depth.t).max() < SPARSE
    dives, climbs = pitch.v[pitch.v < -STEEP_PITCH], pitch.v[pitch.v > STEEP_PITCH]
    return DiveFeatures(
        duration=flight.end - flight.start,
        depth_max=float(depth.v.max()) if well_sampled else None,
        pitch_dive=_median(dives.tolist(), 1),
        pitch_climb=_median(climbs.tolist(), 1),
        roll_mean=float(np.mean(roll.v)) if len(roll) else None,
        roll_std=float(np.std(roll.v)) if len(roll) else None,
        onboard_speed=float(np.mean(speed.v)) if len(speed) else None,
        thruster=float(np.mean(thruster.v)) if len(thruster) >= FEW_SAMPLES else None,
        depth_rate_dive=depth_rate_dive,
        depth_rate_climb=depth_rate_climb,
        yos=_yos(pitch),
        ballast_dive=ballast_dive,
        ballast_climb=ballast_climb,
        vacuum=median(vacuum.v.tolist()) if len(vacuum) else None,
    )


def _yos(pitch: Series) -> int | None:
    """How often the glider turned from dive to climb."""
    steep = pitch.v[np.abs(pitch.v) > STEEP_PITCH]
    return int(np.sum((steep[:-1] < 0) & (steep[1:] > 0))) or None


def _volumes(samples: Samples, flight: Flight) -> tuple[float | None, float | None]:
    """Volume pumped (m3) while diving and while climbing, of either pump."""
    moved = max((get(samples, name) for name in ("ballast", "oil_volume")), key=len)
    v = moved.between(flight.start, flight.end).v
    # the pump has moved most of the time: what lies between is it moving
    return _median(v[v < -PUMPED].tolist(), FEW_SAMPLES), _median(v[v > PUMPED].tolist(), FEW_SAMPLES)


def _depth_rates(depth: Series) -> tuple[float | None, float | None]:
    """Median rates of descent and climb (m/s) from depths close in time, below the surface."""
    if len(depth) < DEPTHS_FOR_RATES:
        return None, None
    dt = np.diff(depth.t)
    near = (dt > 0) & (dt < RATE_INTERVAL) & (np.minimum(depth.v[1:], depth.v[:-1]) > DIVING_DEPTH)
    rate = np.diff(depth.v)[near] / dt[near]
    return _median(rate[rate > LEAST_RATE].tolist(), FEW_RATES), _median(
        rate[rate < -LEAST_RATE].tolist(), FEW_RATES
    )


def _median(values: list[float], least: int) -> float | None:
    """The median; None of fewer than ``least`` values."""
    return median(values) if len(values) >= least else None
