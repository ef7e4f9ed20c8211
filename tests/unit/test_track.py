"""The track of a dive and the numbers made of it."""

import numpy as np
import pytest

from gliderwatch.model import Current, Fix, Track
from gliderwatch.navigation.features import evidence, flight_features, track_features
from gliderwatch.navigation.flight import Flight
from gliderwatch.navigation.geodesy import from_plane, to_plane
from gliderwatch.navigation.track import build_track, closure, mean_heading
from missions import LAT, LON, series

H = 3600.0
START = Fix(0.0, LAT, LON)
FLIGHT = Flight(300.0, 300.0 + 2 * H, "depth")


def end_at(x: float, y: float, t: float = 600.0 + 2 * H) -> Fix:
    return Fix(t, *from_plane((x, y), LAT, LON))


def heading(*pairs: tuple[float, float]) -> dict:
    """Headings (degrees, true) at times."""
    rad = [(t, np.radians(h)) for t, h in pairs]
    return {
        "heading_e": series([(t, np.sin(h)) for t, h in rad]),
        "heading_n": series([(t, np.cos(h)) for t, h in rad]),
    }


def steady(degrees: float) -> dict:
    return heading(*[(t, degrees) for t in np.arange(FLIGHT.start, FLIGHT.end + 1, 300.0)])


def reckoned(times, velocity) -> dict:
    places = [from_plane(np.array(velocity) * (t - FLIGHT.start), LAT, LON) for t in times]
    return {
        "dr_lat": series([(t, p[0]) for t, p in zip(times, places, strict=True)]),
        "dr_lon": series([(t, p[1]) for t, p in zip(times, places, strict=True)]),
    }


def check(track: Track) -> None:
    n = len(track.t)
    assert track.x.shape == (n, 2) and track.heading.shape == (n - 1, 2)
    assert (np.diff(track.t) > 0).all() and np.isfinite(track.x).all()
    length = np.hypot(*track.heading.T)
    assert np.isclose(length, 1.0).all() or np.isclose(length * (1 - length), 0.0).all()
    assert not track.x.flags.writeable


def test_it_goes_from_fix_to_fix():
    end = end_at(1500.0, -400.0)
    track = build_track(steady(90.0), FLIGHT, START, end)
    check(track)
    assert track.x[0].tolist() == [0.0, 0.0]
    assert track.x[-1] == pytest.approx([1500.0, -400.0], abs=0.01)
    assert (track.t[0], track.t[-1]) == (START.t, end.t)


def test_no_heading_at_the_surface():
    track = build_track(steady(90.0), FLIGHT, START, end_at(1500.0, 0.0))
    flying = (track.t[:-1] >= FLIGHT.start) & (track.t[1:] <= FLIGHT.end)
    assert track.heading[flying] == pytest.approx(np.tile([1.0, 0.0], (flying.sum(), 1)))
    assert (track.heading[~flying] == 0.0).all() and (~flying).sum() == 2


def test_at_the_surface_it_drifts_with_the_misfit():
    """Current 0.2 m/s to the north, flight 0.3 m/s to the east as reported."""
    speed = {"speed_onboard": series([(t, 0.3) for t in (400.0, 4000.0)])}
    end = end_at(0.3 * 2 * H, 0.2 * (600 + 2 * H))
    track = build_track(steady(90.0) | speed, FLIGHT, START, end)
    v = np.diff(track.x, axis=0) / np.diff(track.t)[:, None]
    assert v[0] == pytest.approx([0.0, 0.2], abs=1e-3) and v[-1] == pytest.approx([0.0, 0.2], abs=1e-3)
    assert v[len(v) // 2] == pytest.approx([0.3, 0.2], abs=1e-3)


@pytest.mark.parametrize("first, last", [(300.0, 7500.0), (700.0, 7000.0)])
def test_the_gliders_own_reckoning_shapes_it(first, last):
    """It reckoned to the north-east, though its few headings say east; also where positions end early."""
    own = reckoned(np.arange(first, last + 1, 450.0), (0.2, 0.2))
    track = build_track(steady(90.0) | own, FLIGHT, START, end_at(0.2 * 2 * H, 0.2 * 2 * H))
    check(track)
    middle = to_plane(*from_plane((0.2 * H, 0.2 * H), LAT, LON), LAT, LON)
    at = int(np.argmin(np.abs(track.t - 300.0 - H)))
    assert track.x[at] == pytest.approx(middle, abs=15.0)
    v = np.diff(track.x, axis=0) / np.diff(track.t)[:, None]
    assert v[1:-1] == pytest.approx(np.tile([0.2, 0.2], (len(v) - 2, 1)), abs=0.01)


def test_reckoning_that_jumps_to_a_fix_is_not_used():
    own = reckoned(np.arange(300.0, 7500.0, 60.0), (0.2, 0.2))
    jumped = {
        k: series([(t, v + (0.05 if t > 5000 else 0)) for t, v in zip(s.t, s.v, strict=True)])
        for k, s in own.items()
    }
    with_jump = build_track(steady(90.0) | jumped, FLIGHT, START, end_at(2000.0, 0.0))
    without = build_track(steady(90.0), FLIGHT, START, end_at(2000.0, 0.0))
    assert with_jump.x.tolist() == without.x.tolist()


def test_headings_are_interpolated_as_vectors():
    """From 350 to 10 degrees by way of north."""
    track = build_track(heading((300.0, 350.0), (7500.0, 10.0)), FLIGHT, START, end_at(0.0, 2000.0))
    assert track.heading[1] == pytest.approx([0.0, 1.0], abs=1e-9)


SPEED, CURRENT = 0.3, (0.15, -0.1)


def closing(course: float, compass: float, speed: float = SPEED, current=CURRENT):
    """Closure of a dive that flew `course` while its compass said `compass` (degrees)."""
    direction = np.array([np.sin(np.radians(course)), np.cos(np.radians(course))])
    ground = speed * direction * 2 * H + np.array(CURRENT) * (2 * H + 600)
    track = build_track(steady(compass), FLIGHT, START, end_at(*ground))
    return closure(track, Current(*current, final=True))


@pytest.mark.parametrize("course", range(0, 360, 30))
def test_the_triangle_closes(course):
    out = closing(course, course)
    assert out.along_speed == pytest.approx(SPEED, abs=1e-3)
    assert out.across_misfit == pytest.approx(0.0, abs=1e-4)
    assert out.across_sigma == pytest.approx(0.0, abs=1e-4)


def test_a_slow_glider_shows_along_and_not_across():
    out = closing(60, 60, speed=0.1)
    assert out.along_speed == pytest.approx(0.1, abs=1e-3)
    assert abs(out.across_misfit) < 1e-4


def test_a_wrong_compass_shows_across():
    out = closing(60, 76.3)
    assert abs(out.across_misfit) == pytest.approx(SPEED * np.sin(np.radians(16.3)), rel=0.1)


def test_a_wrong_current_shows_across_unless_it_lies_along():
    aside = closing(0, 0, current=(CURRENT[0] + 0.2, CURRENT[1]))
    assert aside.across_misfit == pytest.approx(0.2, rel=0.01)  # counter-clockwise positive
    along = closing(0, 0, current=(CURRENT[0], CURRENT[1] + 0.2))
    assert along.along_speed == pytest.approx(SPEED - 0.2 * (2 * H + 600) / (2 * H), rel=0.02)


def test_few_scattered_headings_leave_the_misfit_open():
    """Eleven headings that scatter by 20 degrees around the true one: the misfit is what chance makes it."""
    rng, sigmas, misfits = np.random.default_rng(7), [], []
    for _ in range(40):
        scattered = heading(*[(t, rng.normal(90, 20)) for t in np.arange(300, 7501, 720.0)])
        track = build_track(scattered, FLIGHT, START, end_at(SPEED * 2 * H, 0.0))
        out = closure(track, Current(0.0, 0.0, True))
        sigmas.append(out.across_sigma)
        misfits.append(out.across_misfit)
    assert np.median(sigmas) == pytest.approx(np.std(misfits), rel=0.3)


def test_a_circling_glider_has_no_direction():
    circles = heading(*[(t, 360.0 * k / 8) for k, t in enumerate(np.arange(300, 7501, 450.0))])
    track = build_track(circles, FLIGHT, START, end_at(300.0, 0.0))
    assert closure(track, Current(0.0, 0.0, True)) is None


def test_evidence_of_a_dive():
    half = FLIGHT.start + H
    times = np.arange(FLIGHT.start, FLIGHT.end + 1, 60.0)
    depth = [(t, 5 + 0.1 * (H - abs(t - half))) for t in times]
    extra = {
        "depth": series(depth),
        "pitch": series([(t, -0.4 if t < half else 0.5) for t in times]),
        "roll": series([(t, 0.1) for t in times]),
        "speed_onboard": series([(t, 0.33) for t in times]),
    }
    samples = steady(60.0) | extra
    out = track_features(samples, FLIGHT, build_track(samples, FLIGHT, START, end_at(2000.0, 0.0)))
    assert out.duration == pytest.approx(2 * H) and out.drift == pytest.approx(600)
    assert out.ground_speed == pytest.approx(2000 / (2 * H + 600), rel=1e-3)
    assert out.heading_mean == pytest.approx(np.radians(60.0)) and out.heading_steadiness == pytest.approx(
        1.0
    )
    assert out.depth_max == pytest.approx(365.0, abs=7)
    assert (out.pitch_dive, out.pitch_climb) == pytest.approx((-0.4, 0.5))
    assert (out.roll_mean, out.roll_std) == pytest.approx((0.1, 0.0))
    assert (out.depth_rate_dive, out.depth_rate_climb) == pytest.approx((0.1, -0.1))
    assert out.onboard_speed == pytest.approx(0.33)
    assert np.isfinite(list(evidence(out).values())).all()


def test_the_pitch_is_that_of_the_glide_and_not_of_its_turns():
    """On short yos a third of the samples is of turns: their mean pitch would be that of a flatter glide."""
    yo = [-0.45] * 6 + [-0.3, -0.21, 0.0, 0.21, 0.3] + [0.4] * 6 + [0.25, 0.0, -0.25]
    times = np.linspace(FLIGHT.start, FLIGHT.end, 10 * len(yo))
    samples = steady(60.0) | {"pitch": series([(t, yo[k % len(yo)]) for k, t in enumerate(times)])}
    found = flight_features(samples, FLIGHT)
    assert (found.pitch_dive, found.pitch_climb) == pytest.approx((-0.45, 0.4))


def test_depth_near_the_surface_alone_is_no_depth_of_the_dive():
    samples = steady(60.0) | {
        "depth": series([(310, 4.0), (340, 6.0), (7400, 5.0), (7430, 3.5), (7460, 1.0)])
    }
    out = track_features(samples, FLIGHT, build_track(samples, FLIGHT, START, end_at(2000.0, 0.0)))
    assert out.depth_max is None


def test_mean_heading_counts_the_surface_as_nothing():
    track = build_track(steady(0.0), FLIGHT, START, end_at(0.0, 2000.0))
    mean, flown = mean_heading(track)
    assert flown == pytest.approx(2 * H)
    assert mean == pytest.approx([0.0, 2 * H / (2 * H + 600)], abs=1e-9)
