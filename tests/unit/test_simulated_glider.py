"""The simulated glider against what is known of real ones, from what it sends and from its truth."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import find_peaks

from gliderwatch.simulate.flight import (
    Airframe,
    Point,
    Vector,
    displacement,
    nmea,
    offset,
    own_speed,
    steady_glide,
    written,
)
from gliderwatch.simulate.glider import simulate, voyage
from gliderwatch.simulate.ocean import Constituent, Ellipse, Sea, make_ocean
from gliderwatch.simulate.scenario import FixIn, Scenario
from gliderwatch.simulate.vehicle import Yo
from gliderwatch.slocum.sensors import model_declination
from simulated import DAY, EVERY_CYCLE, STRAIGHT, closures, degrees, samples

# --------------------------------------------------------------------------- closure


@pytest.mark.parametrize("fix_in", list(FixIn))
def test_files_close_to_the_noise(fix_in: FixIn) -> None:
    """Fixes err by 3 m a component, two of them by 6 m: 0.6 mm/s over 3 h."""
    scenario = replace(
        STRAIGHT, fix_in=fix_in, cadence=EVERY_CYCLE | {"m_initial_water_vx": 4, "m_initial_water_vy": 4}
    )
    mission = simulate(scenario)
    for kind in ("initial", "final"):
        found = closures(mission, scenario.variation, kind)
        assert len(found) >= 12
        assert np.median([dive.misfit for dive in found]) < 1e-3
        assert max(dive.misfit for dive in found) < 2e-3


@pytest.mark.parametrize("variation", [0.0, 0.28, -0.2])
def test_files_close_with_and_without_variation(variation: float) -> None:
    found = closures(simulate(replace(STRAIGHT, variation=variation)), variation)
    assert np.median([dive.misfit for dive in found]) < 1e-3


def test_the_variation_follows_the_way() -> None:
    """A current of 1.5 m/s carries the glider 500 km in four days, over two degrees of declination."""
    carried = replace(STRAIGHT, days=4.0, sea=Sea(residual=Vector(1.5, 0.0), tides=()))
    mission = simulate(carried)
    _, sent = samples(mission, "m_gps_mag_var")
    end = mission.truth[-2].end  # the last dive was reckoned from there
    there, here = (model_declination(*place, carried.start)[0] for place in (end, carried.place))
    assert abs(there - here) > 0.03
    assert sent[0] == pytest.approx(carried.variation, abs=1e-4)
    assert sent[-1] == pytest.approx(carried.variation - (there - here), abs=1e-3)
    found = closures(mission, float(sent[-1]))
    assert found[-1].misfit < 5e-3 < found[0].misfit


def test_the_noise_of_fixes_goes_into_the_current_and_not_into_the_closure() -> None:
    """Both are reckoned with the same fixes. A fix that is 30 m off a component is 4 mm/s over 3 h."""
    mission = simulate(replace(STRAIGHT, days=4.0, gps_sigma=30.0))
    found = closures(mission, STRAIGHT.variation)
    assert np.median([dive.misfit for dive in found]) < 2e-3
    excess = [
        np.array(truth.through_water) * (truth.believed_speed / truth.speed - 1)
        for truth in mission.truth[:-1]
    ]
    errors = [dive.current - dive.known + more for dive, more in zip(found, excess, strict=True)]
    assert np.std(errors) == pytest.approx(30 * np.sqrt(2) / (3.05 * 3600), rel=0.3)


def test_files_do_not_close_without_variation() -> None:
    """Own speed plus current is the ground velocity turned by 0.28 rad, 0.2 m/s of it."""
    found = closures(simulate(STRAIGHT), 0.0)
    assert np.median([dive.misfit for dive in found]) == pytest.approx(0.28 * 0.2, abs=0.02)


def test_current_is_reported_in_magnetic_axes_and_true_to_the_flight_model() -> None:
    """The reported current is the true one less what the glider overrates its own speed by."""
    mission = simulate(STRAIGHT)
    for dive, truth in zip(closures(mission, STRAIGHT.variation), mission.truth, strict=False):
        excess = np.array(truth.through_water) * (truth.believed_speed / truth.speed - 1)
        np.testing.assert_allclose(dive.current, np.array(truth.current) - excess, atol=2.5e-3)


@pytest.mark.parametrize("allowed", [0.0, 0.5, 1.0])
def test_what_is_allowed_for_on_board_is_not_in_the_current(allowed: float) -> None:
    """The angle of attack takes a tenth of depth rate over tan(pitch)."""
    truth = simulate(replace(STRAIGHT, days=1.0, allowed=allowed)).truth
    over = [dive.believed_speed / dive.speed - 1 for dive in truth]
    assert np.median(over) == pytest.approx((1 - allowed) * 0.115, abs=0.02)


def test_truth_adds_up_to_the_way_over_ground() -> None:
    mission = simulate(STRAIGHT)
    for dive, truth in zip(closures(mission, STRAIGHT.variation), mission.truth, strict=False):
        np.testing.assert_allclose(dive.ground, np.add(truth.through_water, truth.current), atol=6e-3)


# --------------------------------------------------------------------------- how files are split


def test_the_fix_is_in_the_file_that_the_style_says() -> None:
    for fix_in, shift in ((FixIn.OWN, 0), (FixIn.NEXT, 1)):
        mission = simulate(replace(STRAIGHT, days=1.0, fix_in=fix_in))
        t, _ = samples(mission, "m_water_vx")
        for i, truth in enumerate(mission.truth):
            segment = mission.segments[i + shift]
            first = t[np.searchsorted(t, truth.t_surface)]
            assert segment.header.opened <= first <= segment.closed
            assert 40 <= first - truth.t_surface <= 70
            assert mission.segments[i].header.full_name == truth.segment
            assert mission.segments[i].header.opened < truth.t_dive < mission.segments[i].closed


def test_the_final_current_comes_when_communication_is_over() -> None:
    for fix_in in FixIn:
        mission = simulate(replace(STRAIGHT, fix_in=fix_in))
        t, _ = samples(mission, "m_final_water_vx")
        waits = [t[i] - truth.t_surface for truth, i in zip(mission.truth, range(len(t)), strict=False)]
        assert len(t) == len(mission.truth)
        assert 300 < min(waits) < max(waits) < 2700
        assert np.ptp(waits) > 900


def test_an_opened_file_repeats_the_old_fix() -> None:
    mission = simulate(replace(STRAIGHT, days=1.0, fix_in=FixIn.NEXT))
    for before, segment in zip(mission.segments[1:], mission.segments[2:], strict=False):
        names = [sensor.name for sensor in segment.sensors.columns]
        lat = names.index("m_gps_lat")
        old = before.values[before.updated[:, lat], lat][-1]
        assert segment.values[0, lat] == segment.values[1, lat] == old


def test_sensors_keep_their_cadence() -> None:
    scenario = Scenario(
        days=1.0, cadence={"m_depth": 4.0, "m_heading": 720.0, "m_lat": 1800.0, "m_gps_lat": 4.0}
    )
    mission = simulate(scenario)
    for name, least in (("m_heading", 720.0), ("m_lat", 1800.0)):
        t, _ = samples(mission, name)
        truth = mission.truth[2]
        steps = np.diff(t[(t > truth.t_dive + 1) & (t < truth.t_surface)])
        assert set(steps) == {least}
    t, _ = samples(mission, "m_depth")
    assert np.diff(t).min() == 4.0


def test_a_sensor_that_is_not_simulated_is_refused() -> None:
    with pytest.raises(ValueError, match="m_altimeter_voltage is not simulated"):
        simulate(Scenario(cadence={"m_altimeter_voltage": 4.0}))
    with pytest.raises(ValueError, match=r"every 1\.0 s"):
        simulate(Scenario(cadence={"m_depth": 1.0}))


# --------------------------------------------------------------------------- behaviour


def test_dives_stay_between_the_surface_and_the_depth_limit() -> None:
    mission = simulate(replace(STRAIGHT, depths=(4.0, 60.0), bottom_sigma=0.0))
    t, depth = samples(mission, "m_depth")
    for truth in mission.truth:
        under = depth[(t > truth.t_dive + 120) & (t < truth.t_surface - 120)]
        assert under.min() > 2.0
        assert 58.0 < under.max() < 60.3
        assert truth.t_surface - truth.t_dive == pytest.approx(3 * 3600, abs=1000)
    at_surface = depth[(t > mission.truth[0].t_surface) & (t < mission.truth[1].t_dive)]
    assert at_surface.max() < 0.3


def test_it_goes_through_its_waypoints_against_a_current() -> None:
    waypoints = (Point(27.56, -84.0), Point(27.56, -83.93))
    sea = Sea(residual=(0.12, 0.0), sigma=0.0, tides=())
    mission = simulate(replace(STRAIGHT, waypoints=waypoints, sea=sea, days=1.5))
    lat, lon = (degrees(samples(mission, name)[1]) for name in ("m_gps_lat", "m_gps_lon"))
    for place in waypoints:
        ways = np.hypot(
            (lat - place.lat) * 60 * 1852, (lon - place.lon) * 60 * 1852 * np.cos(np.radians(27.5))
        )
        assert ways.min() < 3500
    steered = degrees(samples(mission, "c_wpt_lon")[1])
    assert {round(lon, 2) for lon in steered} == {-84.0, -83.93}


def test_same_seed_same_values_other_seed_other_values() -> None:
    scenario = Scenario(days=1.0)
    one, two, other = simulate(scenario), simulate(scenario), simulate(replace(scenario, seed=2))
    for a, b, c in zip(one.segments, two.segments, other.segments, strict=False):
        np.testing.assert_array_equal(a.values, b.values)
        np.testing.assert_array_equal(a.updated, b.updated)
        assert (a.closed, a.sent) == (b.closed, b.sent)
        assert a.values.shape != c.values.shape or not np.array_equal(a.values, c.values, equal_nan=True)
    assert one.truth == two.truth


# --------------------------------------------------------------------------- parts


def test_flight_is_a_balance_of_forces() -> None:
    """Lift, drag and buoyancy (N) along east and up, for a glider of 1025 kg/m3 water."""
    frame, drive, pitch, drag = Airframe(), 150e-6, 0.42, 1.7
    glide = steady_glide(pitch, drive, frame, drag=drag)
    speed, path = np.hypot(glide.horizontal, glide.vertical), np.arctan2(glide.vertical, glide.horizontal)
    assert path == pytest.approx(pitch + glide.attack)
    pressure = 0.5 * 1025 * frame.area * speed**2
    lift = pressure * frame.lift_slope * glide.attack
    resistance = pressure * (drag * frame.parasite_drag + frame.induced_drag * glide.attack**2)
    assert lift * np.sin(path) == pytest.approx(resistance * np.cos(path))
    assert lift * np.cos(path) + resistance * np.sin(path) == pytest.approx(1025 * 9.81 * drive)


def test_a_glider_cannot_fly_too_flat_or_without_drive() -> None:
    with pytest.raises(ValueError, match="glide steeper"):
        steady_glide(0.02, 150e-6, Airframe(), drag=3.0)
    with pytest.raises(ValueError, match="positive"):
        steady_glide(0.4, 0.0, Airframe())


def test_believed_speed_is_held_over_inflections() -> None:
    turn = np.clip(np.linspace(-8, 8, 400), -1, 1)
    depth = np.cumsum(-0.12 * turn * 4.0)
    speed = own_speed(depth - depth.min(), 0.45 * turn, 4.0)
    np.testing.assert_allclose(speed[5:-5], 0.12 / np.tan(0.45), rtol=0.15)


def test_offset_and_displacement_agree_with_a_known_geodesic() -> None:
    """One minute of latitude on WGS 84 at 45 degrees is 1852.2 m, one of longitude 1314.2 m."""
    start = Point(45.0, -62.0)
    assert displacement(start, Point(45 + 1 / 60, -62.0)).north == pytest.approx(1852.2, abs=0.3)
    assert displacement(start, Point(45.0, -62 + 1 / 60)).east == pytest.approx(1314.2, abs=0.3)
    lat, lon = offset(start, np.array(7000.0), np.array(-9000.0))
    assert displacement(start, Point(float(lat), float(lon))) == pytest.approx((7000.0, -9000.0), abs=1e-6)


def test_nmea_positions() -> None:
    np.testing.assert_allclose(nmea(np.array([38.727, -62.3259, 0.5])), [3843.62, -6219.554, 30.0])


@pytest.mark.parametrize("degrees", [1.99999999999, -1.99999999999, -0.99999999999, 179.9999999999])
def test_a_fix_is_never_written_with_sixty_minutes(degrees: float) -> None:
    """Readers drop it, as they do what is no position."""
    assert float(written(np.array(degrees))) == 100 * round(degrees)


def test_an_ellipse_has_its_axes_and_turns_its_way() -> None:
    tide = Ellipse(Constituent.S2, major=0.2, minor=0.1, inclination=np.pi / 2, phase=0.0)
    u, v = tide.current(np.array([0.0, 3 * 3600.0, 6 * 3600.0]))
    np.testing.assert_allclose(u, [0.0, -0.1, 0.0], atol=1e-12)
    np.testing.assert_allclose(v, [0.2, 0.0, -0.2], atol=1e-12)


def test_the_slow_current_has_its_strength_memory_and_size() -> None:
    sea = Sea(residual=(0.1, -0.05), sigma=0.08, tau=10 * 3600.0, scale=20e3, tides=())
    days = 200
    t = np.arange(0.0, days * DAY, 3600.0)
    zero = np.zeros_like(t)
    here, later, there = [], [], []
    for seed in range(12):
        ocean = make_ocean(sea, 0.0, days * DAY, np.random.default_rng(seed))
        u, v = ocean.current(t, zero, zero)
        far, _ = ocean.current(t, zero + 20e3, zero)
        assert (u.mean(), v.mean()) == pytest.approx((0.1, -0.05), abs=0.03)
        here.append(np.var(u - 0.1))
        later.append(np.mean((u[10:] - 0.1) * (u[:-10] - 0.1)))
        there.append(np.mean((u - 0.1) * (far - 0.1)))
    assert np.sqrt(np.mean(here)) == pytest.approx(0.08, rel=0.05)
    assert np.mean(later) / np.mean(here) == pytest.approx(np.exp(-1), abs=0.05)
    assert np.mean(there) / np.mean(here) == pytest.approx(np.exp(-0.5), abs=0.12)


def test_the_ocean_does_not_go_on_beyond_its_span() -> None:
    ocean = make_ocean(Sea(), 0.0, DAY, np.random.default_rng(0))
    with pytest.raises(ValueError, match="longer mission"):
        ocean.current(np.array([2 * DAY]), np.zeros(1), np.zeros(1))


def test_yos_of_the_pilot_are_flown_from_the_next_dive_on() -> None:
    """Two half cycles from 5 to 40 m, then from 20 to 30 m until it is to surface."""
    going = voyage(replace(STRAIGHT, days=0.3, bottom_sigma=0.0))
    first = next(going)
    mission = going.send((Yo(5.0, 40.0, 2), Yo(20.0, 30.0)))
    t, depth = samples(mission, "m_depth")
    assert depth[t < first.truth[0].t_surface].max() > 55.0
    depth = depth[t > mission.truth[-1].t_dive]
    deep, shallow = (find_peaks(sign * depth, prominence=5.0)[0] for sign in (1, -1))
    assert depth[deep] == pytest.approx([40.0, *[30.0] * (len(deep) - 1)], abs=1.5)
    assert depth[shallow] == pytest.approx([5.0, *[20.0] * (len(shallow) - 1)], abs=1.5)


def test_a_voyage_without_a_pilot_is_the_simulated_mission() -> None:
    scenario = replace(STRAIGHT, days=0.4)
    *_, whole = voyage(scenario)
    assert [s.header for s in whole.segments] == [s.header for s in simulate(scenario).segments]
