"""The sea that gliders are simulated in: each part of the current, the water, the bottom."""

from dataclasses import replace

import gsw
import numpy as np
import pytest

from gliderwatch.simulate.flight import Point, offset
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.ocean import (
    Bottom,
    Constituent,
    Ellipse,
    Front,
    Layer,
    Ocean,
    Sea,
    Water,
    make_ocean,
)
from gliderwatch.simulate.scenario import Mission, Scenario
from gliderwatch.simulate.telemetry import CADENCE, SCIENCE_CADENCE
from simulated import samples

DAY = 86400.0
STILL = Sea(residual=(0.0, 0.0), sigma=0.0, tides=())


def ocean(sea: Sea, *, days: float = 30.0, lat: float = 45.0, seed: int = 3) -> Ocean:
    return make_ocean(sea, 0.0, days * DAY, np.random.default_rng(seed), lat=lat)


def uniform(sea: Ocean, t: np.ndarray, depth: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    return sea.current(t, np.zeros_like(t), np.zeros_like(t), np.full_like(t, depth))


@pytest.mark.parametrize(
    ("constituent", "hours"),
    [("M2", 12.4206), ("S2", 12.0), ("N2", 12.6583), ("K1", 23.9345), ("O1", 25.8193), ("M4", 6.2103)],
)
def test_each_tide_has_its_period(constituent: str, hours: float) -> None:
    tide = Ellipse(Constituent(constituent), major=0.3)
    sea = replace(STILL, tides=(tide,))
    t = np.arange(0.0, 20 * DAY, 60.0)
    u, _ = uniform(ocean(sea), t)
    rises = t[1:][(u[:-1] < 0) & (u[1:] >= 0)]
    assert np.diff(rises).mean() / 3600 == pytest.approx(hours, abs=0.02)
    assert u.max() == pytest.approx(0.3, abs=1e-3)


def test_a_tide_comes_later_and_stronger_along_its_way() -> None:
    tide = Ellipse(Constituent.M2, major=0.3, minor=0.1, lag=(1e-5, 0.0), growth=(0.0, 1e-6))
    t, zero = np.arange(0.0, 2 * DAY, 60.0), np.zeros(2880)
    here, east, north = (tide.current(t, zero + e, zero + n) for e, n in ((0, 0), (20e3, 0), (0, 100e3)))
    late = round(0.2 / Constituent.M2.frequency / 60)  # 20 km of 1e-5 rad/m, in minutes
    assert np.abs(east[0][late:] - here[0][:-late]).max() < 0.003
    assert np.hypot(*north) == pytest.approx(np.exp(np.tanh(0.1)) * np.hypot(*here))


def test_shear_takes_the_slow_current_away_with_depth_and_leaves_the_tide() -> None:
    tide = Ellipse(Constituent.M2, major=0.1)
    sea = ocean(Sea(residual=(0.2, 0.0), sigma=0.0, tides=(tide,), shear=0.8, shear_depth=50.0))
    t = np.zeros(1)
    at = [float(uniform(sea, t, depth)[0][0]) for depth in (0.0, 50.0, 5000.0)]
    assert at == pytest.approx([0.3, 0.1 + 0.2 * (1 - 0.8 * (1 - np.exp(-1))), 0.1 + 0.04])


def test_near_inertial_motion_turns_clockwise_with_its_period_and_fades_with_depth() -> None:
    """At 45 degrees north the inertial period is 16.93 h."""
    sea = ocean(replace(STILL, inertial=0.1, inertial_depth=40.0), days=60)
    t = np.arange(0.0, 60 * DAY, 600.0)
    u, v = uniform(sea, t)
    angle = np.unwrap(np.angle(u + 1j * v))
    period = -2 * np.pi * (t[-1] - t[0]) / (angle[-1] - angle[0]) / 3600
    assert period == pytest.approx(16.93, rel=0.03)
    assert np.sqrt(np.mean(u**2 + v**2)) == pytest.approx(0.1, rel=0.35)
    deep = np.hypot(*uniform(sea, t, 80.0))
    np.testing.assert_allclose(deep, np.exp(-2) * np.hypot(u, v))
    south = ocean(replace(STILL, inertial=0.1), lat=-45.0)
    u, v = uniform(south, t[: 10 * 144])
    assert np.unwrap(np.angle(u + 1j * v))[-1] > 0


def test_a_front_is_a_jet_of_its_speed_and_width() -> None:
    front = Front(speed=1.5, width=20e3, direction=np.pi / 2, distance=10e3, amplitude=0.0)
    sea = ocean(replace(STILL, front=front))
    east = np.array([-10e3, -30e3, 10e3, 200e3])
    u, v = sea.current(np.zeros(4), east, np.zeros(4))
    np.testing.assert_allclose(u, 0.0, atol=1e-12)
    np.testing.assert_allclose(v, [1.5, 1.5 * 0.42, 1.5 * 0.42, 0.0], atol=2e-3)


def test_a_front_meanders_and_the_flow_follows_it() -> None:
    front = Front(
        speed=1.0, width=10e3, direction=0.0, distance=0.0, amplitude=8e3, wavelength=100e3, phase_speed=0.2
    )
    east = np.linspace(0, 100e3, 400)
    middle = 8e3 * np.sin(2 * np.pi * east / 100e3)
    u, v = front.current(np.zeros(400), east, middle)
    np.testing.assert_allclose(np.hypot(u, v), 1.0)
    np.testing.assert_allclose(v / u, np.gradient(middle, east), atol=2e-3)
    later = front.current(np.full(400, 5 * DAY), east + 0.2 * 5 * DAY, middle)
    np.testing.assert_allclose(later, (u, v), atol=1e-9)


@pytest.mark.parametrize(
    ("what", "word"),
    [
        (lambda: Sea(shear=1.2), "shear"),
        (lambda: Sea(tau=0.0), "tau"),
        (lambda: Front(1.0, width=0.0), "width"),
        (lambda: Layer(10.0, period=0.0), "period"),
        (lambda: Bottom(5.0), "15 m"),
    ],
)
def test_what_cannot_be_is_refused(what: object, word: str) -> None:
    with pytest.raises(ValueError, match=word):
        what()  # type: ignore[operator]


# --------------------------------------------------------------------------- water


def test_a_layer_moves_up_and_down_with_its_wave() -> None:
    layer = Layer(
        30.0, thickness=1.0, temperature=-8.0, salinity=1.0, amplitude=6.0, period=40e3, wavelength=20e3
    )
    water = Water(20.0, 35.0, (layer,))
    depth = np.linspace(0, 60, 601)
    for t, expected in ((0.0, 30.0), (10e3, 36.0), (20e3, 30.0), (30e3, 24.0)):
        temperature, salinity = water.properties(np.full(601, t), np.zeros(601), np.zeros(601), depth)
        assert depth[np.argmin(np.abs(temperature - 16.0))] == pytest.approx(expected, abs=0.06)
        assert (temperature[0], temperature[-1]) == pytest.approx((20.0, 12.0), abs=1e-3)
        assert salinity[-1] - salinity[0] == pytest.approx(1.0, abs=1e-3)
    assert layer.place(np.array([0.0]), np.array([15e3]))[0] == pytest.approx(36.0)


def science(mission: Mission, name: str) -> np.ndarray:
    columns = [sensor.name for sensor in mission.science[0].sensors.columns]
    j = columns.index(name)
    return np.concatenate([segment.values[1:, j][segment.updated[1:, j]] for segment in mission.science])


def test_the_layers_that_a_glider_measures_move() -> None:
    """Depth of the 20 degree isotherm on each crossing, from the tbd alone: it follows the wave."""
    layer = Layer(30.0, thickness=3.0, temperature=-8.0, amplitude=8.0, period=12.42 * 3600, wavelength=1e9)
    scenario = Scenario(days=2.0, sea=STILL, water=Water(24.0, 35.0, (layer,)), science=SCIENCE_CADENCE)
    mission = simulate(scenario)
    t, pressure, temperature = (
        science(mission, name) for name in ("sci_m_present_time", "sci_water_pressure", "sci_water_temp")
    )
    crossing = np.flatnonzero((temperature[1:] < 20) != (temperature[:-1] < 20))
    when, found = t[crossing], pressure[crossing] * 10 / 1.006
    assert len(found) > 100
    expected = 30 + 8 * np.sin(2 * np.pi * when / layer.period)
    assert np.corrcoef(found, expected)[0, 1] > 0.98
    assert np.std(found) == pytest.approx(8 / np.sqrt(2), rel=0.15)


def test_what_the_ctd_measures_gives_the_salinity_back() -> None:
    water = Water(20.0, 35.0, ())
    mission = simulate(Scenario(days=0.3, water=water, science=SCIENCE_CADENCE))
    measured, temperature, pressure = (
        science(mission, f"sci_water_{name}") for name in ("cond", "temp", "pressure")
    )
    n = len(measured)
    for salinity, sign in ((35.02, 1), (34.98, -1)):
        bound = 0.1 * gsw.C_from_SP(np.full(n, salinity), temperature, 10 * pressure)
        assert np.mean(sign * (bound - measured) > 0) > 0.9


# --------------------------------------------------------------------------- bottom


def test_the_bottom_slopes_and_has_hills() -> None:
    bottom = Bottom(50.0, slope=(1e-3, 0.0), hills=3.0, wavelength=2e3)
    east = np.linspace(-20e3, 20e3, 4001)
    depth = bottom.water_depth(east, np.zeros(4001))
    assert np.polyfit(east, depth, 1) == pytest.approx([1e-3, 50.0], rel=0.02)
    assert depth.std() > 10
    assert bottom.water_depth(np.array([-60e3]), np.zeros(1))[0] == 15.0


def test_a_glider_turns_above_the_bottom_that_its_altimeter_hears() -> None:
    sent = {**CADENCE, "m_altitude": 4.0, "m_water_depth": 4.0, "m_depth": 4.0}
    scenario = Scenario(days=1.0, bottom=Bottom(40.0, hills=0.0), altitude=6.0, cadence=sent)
    mission = simulate(scenario)
    assert all(32.5 < dive.deepest < 34.1 for dive in mission.truth)
    _, altitude = samples(mission, "m_altitude")
    _, water = samples(mission, "m_water_depth")
    heard = water[water > 0]
    assert heard.mean() == pytest.approx(40.0, abs=0.05)
    assert heard.std() < 0.3
    assert altitude.min() > 5.0
    assert len(altitude) > 100
    deep = simulate(replace(scenario, bottom=Bottom(900.0)))
    assert len(samples(deep, "m_altitude")[0]) == 0
    assert set(samples(deep, "m_water_depth")[1]) == {-1.0}
    assert max(dive.deepest for dive in deep.truth) > 55


def test_tides_and_shear_reach_the_glider() -> None:
    """The true current of a dive is that along its way: with shear it lies below that of the surface."""
    sea = Sea(residual=(0.2, 0.0), sigma=0.0, tides=(), shear=1.0, shear_depth=20.0)
    mission = simulate(Scenario(days=1.0, sea=sea))
    z = np.linspace(4, 60, 500)
    expected = 0.2 * np.exp(-z / 20).mean()
    for dive in mission.truth:
        assert dive.current.east == pytest.approx(expected, abs=0.006)
        assert dive.current.north == pytest.approx(0.0, abs=1e-9)


def test_a_fleet_feels_one_sea() -> None:
    """Gliders a stone's throw apart that fly alike see the same current, wherever the sea has its origin."""
    place = Point(27.5, -84.0)
    lat, lon = offset(place, np.array(5000.0), np.array(0.0))
    moved = Point(float(lat), float(lon))
    sea = Sea(sigma=0.1, scale=1e6, tides=())
    first = Scenario(days=1.0, sea=sea)
    second = replace(first, place=moved, origin=place, member=1)
    one, two = simulate(first), simulate(second)
    currents = [np.array([dive.current for dive in mission.truth[:5]]) for mission in (one, two)]
    np.testing.assert_allclose(*currents, atol=0.02)
    assert one.truth[0].speed != two.truth[0].speed
