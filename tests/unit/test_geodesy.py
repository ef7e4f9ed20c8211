"""The local plane against a geodesic of its own, and which way declination turns."""

from math import atan, atan2, cos, degrees, hypot, pi, radians, sin, sqrt, tan

import numpy as np
import pytest

from gliderwatch.navigation.geodesy import from_plane, heading_vectors, magnetic_to_true, to_plane

A, F = 6378137.0, 1 / 298.257223563


def vincenty(lat1: float, lon1: float, lat2: float, lon2: float) -> tuple[float, float]:
    """Length (m) and azimuth at the first point (rad) of the geodesic on WGS 84 (Vincenty 1975)."""
    b = A * (1 - F)
    u1, u2 = atan((1 - F) * tan(radians(lat1))), atan((1 - F) * tan(radians(lat2)))
    difference = radians((lon2 - lon1 + 180) % 360 - 180)
    lam = difference
    for _ in range(100):
        s = hypot(cos(u2) * sin(lam), cos(u1) * sin(u2) - sin(u1) * cos(u2) * cos(lam))
        c = sin(u1) * sin(u2) + cos(u1) * cos(u2) * cos(lam)
        sigma = atan2(s, c)
        alpha = cos(u1) * cos(u2) * sin(lam) / s
        cos2 = 1 - alpha**2
        mid = c - 2 * sin(u1) * sin(u2) / cos2 if cos2 > 1e-15 else 0.0
        cc = F / 16 * cos2 * (4 + F * (4 - 3 * cos2))
        before = lam
        lam = difference + (1 - cc) * F * alpha * (sigma + cc * s * (mid + cc * c * (2 * mid**2 - 1)))
        if abs(lam - before) < 1e-13:
            break
    uu = cos2 * (A**2 - b**2) / b**2
    k = (sqrt(1 + uu) - 1) / (sqrt(1 + uu) + 1)
    aa, bb = (1 + k * k / 4) / (1 - k), k * (1 - 3 * k * k / 8)
    delta = bb * s * (mid + bb / 4 * (c * (2 * mid**2 - 1)))
    azimuth = atan2(cos(u2) * sin(lam), cos(u1) * sin(u2) - sin(u1) * cos(u2) * cos(lam))
    return b * aa * (sigma - delta), azimuth


def test_the_yardstick_itself():
    length, azimuth = vincenty(0.0, 0.0, 0.0, 1.0)
    assert length == pytest.approx(A * pi / 180, rel=1e-9)  # the equator is a circle of radius a
    assert degrees(azimuth) == pytest.approx(90.0)
    length, _ = vincenty(45.0, 0.0, 46.0, 0.0)
    assert length == pytest.approx(111_141.55, abs=0.05)  # meridian arc, Snyder 1987


@pytest.mark.parametrize("lat", [0.0, 10.0, 36.0, 55.0, 70.0, 80.0, -43.0])
@pytest.mark.parametrize("lon", [0.0, -70.0, 179.9, -179.9])
@pytest.mark.parametrize("bearing", range(0, 360, 45))
@pytest.mark.parametrize("length", [200.0, 5e3, 50e3])
def test_plane_agrees_with_the_geodesic(lat, lon, bearing, length):
    x = length * np.array([sin(radians(bearing)), cos(radians(bearing))])
    there = from_plane(x, lat, lon)
    true_length, azimuth = vincenty(lat, lon, *there)
    assert abs(true_length - length) < (2e-4 if length > 10e3 else 1e-5) * length
    # a plane turns against the meridian of its origin by the convergence over half the way
    convergence = abs(x[0]) / 6371e3 * abs(tan(radians((lat + there[0]) / 2))) / 2
    assert abs((azimuth - radians(bearing) + pi) % (2 * pi) - pi) < 1.2 * convergence + 1e-3
    assert to_plane(*there, lat, lon) == pytest.approx(x, abs=1e-6 * length)
    assert -180.0 <= there[1] <= 180.0


def test_the_date_line_is_no_edge():
    east = to_plane(20.0, -179.99, 20.0, 179.99)
    assert east[0] == pytest.approx(vincenty(20.0, 179.99, 20.0, -179.99)[0], rel=1e-6)
    assert to_plane(20.0, 179.99, 20.0, -179.99) == pytest.approx([-east[0], 0.0])


def test_many_points_at_once_are_as_each_alone():
    lat, lon = np.array([36.1, 36.4]), np.array([-70.2, -69.8])
    both = to_plane(lat, lon, 36.0, -70.0)
    assert both.shape == (2, 2)
    for k in range(2):
        assert both[k].tolist() == to_plane(lat[k], lon[k], 36.0, -70.0).tolist()


def test_compass_headings_go_clockwise_from_north():
    north, east, south, west = heading_vectors(np.radians([0.0, 90.0, 180.0, 270.0]))
    assert north == pytest.approx([0, 1]) and east == pytest.approx([1, 0])
    assert south == pytest.approx([0, -1], abs=1e-12) and west == pytest.approx([-1, 0], abs=1e-12)


@pytest.mark.parametrize("declination", np.radians([-16.3, 0.0, 12.7, 170.0]))
@pytest.mark.parametrize("heading", np.radians([0.0, 75.0, 200.0, 359.0]))
def test_a_true_bearing_is_the_magnetic_one_plus_the_declination(heading, declination):
    turned = magnetic_to_true(heading_vectors(heading), declination)
    assert turned == pytest.approx(heading_vectors(heading + declination))


def test_a_magnetic_current_turns_like_a_heading():
    """Magnetic north 16.3 degrees west of true: what flows to it flows to the west of true north."""
    u, v = magnetic_to_true(np.array([0.0, 1.0]), -radians(16.3))
    assert u == pytest.approx(-sin(radians(16.3))) and v == pytest.approx(cos(radians(16.3)))
