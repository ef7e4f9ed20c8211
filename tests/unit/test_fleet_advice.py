"""Where to look next: the gradient is that of the mean variance, and advice keeps to its bounds."""

import numpy as np
import pytest

from gliderwatch.fleet import advice
from gliderwatch.fleet import scalar_field as sf
from gliderwatch.fleet.advice import Bounds, Box, Leg, advise, gains, gradient, mean_variance
from gliderwatch.fleet.scalar_field import FieldParams
from gliderwatch.model import readonly
from gliderwatch.navigation.geodesy import to_plane

PARAMS = FieldParams()
BOX = Box(49.73, 179.6, 50.27, -179.5, 0.0, 100.0)  # 60 km, across the antimeridian
LEG = Leg(50.0, -179.95, 0.3, 4 * 3600.0)


@pytest.fixture(scope="module")
def known() -> sf.Information:
    """The west of the box is known, the east is not."""
    rng = np.random.default_rng(0)
    place = rng.uniform(0, 1, (1500, 3)) * [0.5, 1, 1]
    phi = sf.rows(place, PARAMS)
    return sf.update(sf.prior(PARAMS), phi, np.zeros(1500), sf.sample_variance(np.full(1500, 60.0), PARAMS))


def test_the_box_measures_what_it_should():
    assert BOX.sides == pytest.approx([64.5e3, 60.1e3], rel=0.01)
    assert BOX.place(np.array([50.0]), np.array([-179.95]), np.array([25.0])) == pytest.approx(
        np.array([[0.5, 0.5, 0.25]])
    )


def test_gradient_is_the_slope_of_the_mean_variance(known):
    cov, place, d = sf.inverse(known.d), np.array([0.42, 0.6]), 1e-4
    depths = (np.arange(12) + 0.5) / 12
    r = sf.sample_variance(np.ones(1), PARAMS)

    def lowered(x, y):
        before, out = mean_variance(known, PARAMS), []
        for z in depths:
            phi = sf.rows(np.array([[x, y, z]]), PARAMS)
            out.append(before - mean_variance(sf.update(known, phi, np.zeros(1), r), PARAMS))
        return np.mean(out)

    x, y = place
    slope = [lowered(x + d, y) - lowered(x - d, y), lowered(x, y + d) - lowered(x, y - d)]
    assert gradient(cov, place, PARAMS) == pytest.approx(np.array(slope) / (2 * d), rel=1e-3)


def test_gain_of_a_leg_is_what_its_samples_take_away(known):
    after = advice.with_planned(known, [(LEG, 1.0)], BOX, PARAMS)
    fallen = mean_variance(known, PARAMS) - mean_variance(after, PARAMS)
    assert gains(sf.inverse(known.d), LEG, [0.0, 1.0], BOX, PARAMS)[1] == pytest.approx(fallen)


@pytest.mark.parametrize("way", ["gradient", "look_ahead"])
def test_advice_leads_to_what_is_not_known(known, way):
    found = advise(known, LEG, BOX, Bounds(), PARAMS, way)
    assert np.sin(found.heading) > 0.4  # east
    east, north = to_plane(found.lat, found.lon, LEG.lat, LEG.lon)
    assert np.hypot(east, north) == pytest.approx(0.3 * 4 * 3600, rel=1e-3)
    assert 0 < found.variance < 0.2


def test_the_waypoint_goes_with_the_water(known):
    still, drifting = (
        advise(known, Leg(50.0, -179.95, 0.3, 4 * 3600.0, flow), BOX, Bounds(), PARAMS)
        for flow in ((0.0, 0.0), (0.0, -0.2))
    )
    assert drifting.lat < still.lat - 0.01


def test_the_look_ahead_takes_the_best_of_its_legs(known):
    found = advise(known, LEG, BOX, Bounds(), PARAMS)
    cov = sf.inverse(known.d)
    lowered = gains(cov, LEG, [k * np.pi / 6 for k in range(12)], BOX, PARAMS)
    assert found.heading == pytest.approx(np.argmax(lowered) * np.pi / 6)
    assert found.variance == pytest.approx(max(lowered) / mean_variance(known, PARAMS))


def test_away_from_others(known):
    free = advise(known, LEG, BOX, Bounds(), PARAMS)
    taken = advise(known, LEG, BOX, Bounds(others=((free.lat, free.lon),), apart=3e3), PARAMS)
    assert np.hypot(*to_plane(taken.lat, taken.lon, free.lat, free.lon)) >= 3e3
    assert taken.apart >= 3e3


def test_what_others_will_measure_is_not_looked_for_again(known):
    free = advise(known, LEG, BOX, Bounds(), PARAMS)
    planned = advice.with_planned(known, [(LEG, free.heading)] * 30, BOX, PARAMS)
    assert advise(planned, LEG, BOX, Bounds(), PARAMS).heading != free.heading


def test_inside_the_polygon_and_deep_enough(known):
    west = ((49.8, 179.7), (50.2, 179.7), (50.2, -179.94), (49.8, -179.94))
    kept = advise(known, LEG, BOX, Bounds(polygon=west), PARAMS)
    assert kept.lon > 0 or kept.lon < -179.94
    shoal = readonly([[50.0, -179.85, 20.0], [50.0, -179.95, 80.0], [50.05, -179.95, 80.0]])
    deep = advise(known, LEG, BOX, Bounds(shallowest=30.0, soundings=shoal), PARAMS)
    assert -180 < deep.lon < -179.9


def test_no_leg_is_allowed_no_advice(known):
    far = ((10.0, 10.0), (11.0, 10.0), (11.0, 11.0))
    assert advise(known, LEG, BOX, Bounds(polygon=far), PARAMS) is None


def test_not_out_of_the_box(known):
    edge = Leg(50.0, -179.51, 0.3, 4 * 3600.0)
    found = advise(known, edge, BOX, Bounds(), PARAMS)
    assert (BOX.place(np.array([found.lat]), np.array([found.lon]), np.array([0.0]))[0, :2] <= 1).all()
