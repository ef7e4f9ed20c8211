"""A glider beside its neighbours: who is wrong is found on steady headings, and a healthy fleet is not called
so."""

from dataclasses import replace

import numpy as np
import pytest

from gliderwatch.fleet import flow
from gliderwatch.fleet.cross_check import Check, cross_check, current_of
from gliderwatch.fleet.flow import DiveCurrent, Fault, FlowCovariance, Sea, dives_between
from gliderwatch.fleet.reference import fleet_reference
from gliderwatch.messages.samples import SAMPLES
from gliderwatch.model import Fix, Flag
from gliderwatch.navigation.geodesy import from_plane

T0, HOUR, W = 1.7e9, 3600.0, 0.3
SEA = Sea(eddy=0.05, reach=20e3, gradient=0.05, inertial=0.05, noise=0.02)


def fleet(n: int, seed: int, hours: float = 60.0) -> list[DiveCurrent]:
    """Some days of gliders on steady headings within 50 km, in a sea with tides."""
    rng, out = np.random.default_rng(seed), []
    for g in range(n):
        at, t, angle = rng.uniform(-20e3, 20e3, 2), rng.uniform(0, 3 * HOUR), rng.uniform(0, 2 * np.pi)
        course = np.array([np.sin(angle), np.cos(angle)])
        while t < hours * HOUR:
            start, end = (
                Fix(T0 + t + 3 * HOUR * k, *from_plane(at + 900 * k * course, 50.0, 0.0)) for k in (0, 1)
            )
            out.append(DiveCurrent(f"g{g}", start, end, 0.0, 0.0, course=tuple(course), speed=W))
            at, t = at + 900 * course, t + 3.2 * HOUR
    dives = dives_between([(each.start, each.end) for each in out], out[0].start)
    cov = FlowCovariance(dives, dives, 50.0).of(SEA) + flow.noise(out, SEA)
    drawn = (np.linalg.cholesky(cov) @ rng.normal(size=len(cov))).reshape(-1, 2)
    return [replace(each, u=float(u), v=float(v)) for each, (u, v) in zip(out, drawn, strict=True)]


def wrong(
    currents: list[DiveCurrent], fault: Fault, size: float, gliders: str, hours: float = 24.0
) -> list[DiveCurrent]:
    def with_fault(each: DiveCurrent) -> DiveCurrent:
        if each.glider not in gliders.split() or each.start.t < T0 + hours * HOUR:
            return each
        east, north = size * W * np.array(each.course)
        du, dv = (-east, -north) if fault is Fault.LOSS else (-north, east)
        return replace(each, u=each.u + du, v=each.v + dv)

    return [with_fault(each) for each in currents]


@pytest.mark.parametrize(("fault", "size"), [(Fault.LOSS, 0.4), (Fault.TURN, -0.4)])
def test_who_is_wrong_among_six_and_by_how_much(fault: Fault, size: float) -> None:
    currents = wrong(fleet(6, 4, 96.0), fault, size, "g2", 66.0)
    found = cross_check(currents, "g2").sure
    assert found is not None
    assert (found.glider, found.fault) == ("g2", fault)
    assert found.size == pytest.approx(size, abs=3 * found.sigma)
    assert abs(found.since - (T0 + 66 * HOUR)) < 10 * HOUR
    assert all(cross_check(currents, f"g{k}").sure is None for k in (0, 1, 3, 4, 5))


def test_healthy_fleets_are_not_called_faulty() -> None:
    for seed in range(2):
        currents = fleet(4, seed)
        assert [cross_check(currents, f"g{k}").sure for k in range(4)] == [None] * 4


def test_an_error_that_all_share_is_one() -> None:
    currents = wrong(fleet(6, 4), Fault.TURN, 0.5, "g0 g1 g2 g3 g4 g5", hours=0.0)
    found = [cross_check(currents, f"g{k}").sure for k in range(6)]
    assert any(each is not None and each.glider == "" and each.fault is Fault.TURN for each in found)
    assert all(each is None or each.glider == "" for each in found)


def test_the_order_of_currents_does_not_matter() -> None:
    currents = wrong(fleet(3, 1), Fault.LOSS, 0.4, "g0")
    assert cross_check(currents, "g0") == cross_check(currents[::-1], "g0")


def test_nobody_near_nothing_to_compare() -> None:
    alone = [each for each in fleet(2, 0) if each.glider == "g0"]
    assert cross_check(alone, "g0") is None
    away = [replace(each, glider="far", end=replace(each.end, lat=52.0)) for each in alone]
    assert cross_check([*alone, *away], "g0") is None
    assert cross_check([], "g0") is None


def test_what_is_small_or_short_is_not_sure() -> None:
    found = cross_check(wrong(fleet(6, 4, 96.0), Fault.LOSS, 0.4, "g2", 66.0), "g2")
    assert found.found is not None
    for weaker in ({"size": 0.1}, {"ratio": 11.0}, {"dives": 3}):
        assert Check(found.neighbours, 1e3, replace(found.found, **weaker), None).sure is None
    assert Check(found.neighbours, 1e3, found.found, replace(found.found, glider="g1")).sure is None


def test_the_current_of_an_assessed_dive(a_dive) -> None:
    found = current_of(a_dive, replace(a_dive, t_surface=a_dive.t_dive - 600, lat=a_dive.lat + 0.01))
    assert (found.u, found.v) == (a_dive.reference_u, a_dive.reference_v)
    assert found.course == pytest.approx((0.9, 0.0), abs=1e-9)
    assert found.speed == 0.31
    assert found.start == Fix(a_dive.t_dive, a_dive.lat + 0.01, a_dive.lon)
    assert current_of(replace(a_dive, flag=int(Flag.FALSE_ALARM)), None) is None
    assert current_of(replace(a_dive, lat=None), None) is None
    slow = current_of(replace(a_dive, flag=int(Flag.ANOMALY)), None)
    assert slow.doubt > 0.1
    assert slow.start.lat == a_dive.lat


@pytest.fixture
def a_dive():
    from gliderwatch.messages.samples import _HEALTHY, _at

    assert SAMPLES
    numbers = {"heading_mean": 90.0, "heading_steadiness": 0.9, "own_speed": 0.31}
    return replace(_at(_HEALTHY, T0), lat=50.0, lon=1.0, reference_u=0.1, reference_v=0.2, evidence=numbers)


def test_a_sure_fault_comes_with_what_the_others_measured() -> None:
    currents = wrong(healthy := fleet(6, 4, 96.0), Fault.LOSS, 0.4, "g2", 66.0)
    found = fleet_reference(currents, "g2")
    assert found is not None and found.fault is not None
    last = [k for k, each in enumerate(currents) if each.glider == "g2"][-1]
    assert found.last == currents[last]
    off, error = np.subtract(found.fused[0], (healthy[last].u, healthy[last].v)), found.fused[1]
    assert off @ np.linalg.solve(error + 0.02**2 * np.eye(2), off) < 12
    assert np.sqrt(np.trace(error)) < 0.1
    well = fleet_reference(healthy, "g2")
    assert well is not None and well.fault is None


def test_a_front_is_no_fault() -> None:
    """A jet of 0.8 m/s and 25 km that one of six meets: with eddies of 9 km alone it is taken for a fault."""

    def in_front(each: DiveCurrent) -> DiveCurrent:
        lat = (each.start.lat + each.end.lat) / 2
        return replace(each, u=each.u + 0.8 / np.cosh((lat - 50.25) / 0.15) ** 2)

    currents = [in_front(each) for each in fleet(6, 7)]
    assert [cross_check(currents, f"g{k}").sure for k in range(6)] == [None] * 6
