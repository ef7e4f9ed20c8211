"""Each heuristic of the fleet at work, just below and just above where it decides, or by what it makes."""

from __future__ import annotations

import math
import time
import zlib
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gliderwatch.fleet import cross_check as cc
from gliderwatch.fleet import flow, reference
from gliderwatch.fleet import scalar_field as sf
from gliderwatch.fleet.advice import Bounds, Box, Leg, advise, is_allowed, leg_samples
from gliderwatch.fleet.batches import batch_of, packed, params_of, unpacked
from gliderwatch.fleet.cross_check import Check, Hypothesis, cross_check, current_of
from gliderwatch.fleet.exchange import Parcel, Sample
from gliderwatch.fleet.flow import DiveCurrent, Dives, Fault, FlowCovariance, Sea, fleet_flow
from gliderwatch.fleet.scalar_field import Batch, FieldParams
from gliderwatch.messages.samples import _HEALTHY, _at
from gliderwatch.model import Assessment, Fix, Flag, Segment, SegmentId, Series, readonly
from gliderwatch.navigation.geodesy import from_plane
from gliderwatch.service import fields as service
from gliderwatch.service.relays import BatchesCame, RelayExchange

T0, HOUR, DAY = 1.7e9, 3600.0, 86400.0
FADING, LITERAL = FieldParams(), FieldParams("literal")

# --------------------------------------------------------------------------- the field


def test_functions_of_depth_alone_are_13_that_meet_at_half_their_height() -> None:
    found = sf.rows(np.array([[0.5, 0.5, 1 / 24]]), FADING)[0, 343:]
    assert len(found) == 13
    assert found[0] == found[1] == pytest.approx(0.84, abs=0.01)
    assert found[0] * found[1] == pytest.approx(0.71, abs=0.01)


def test_a_sample_of_6_s_has_60_squares_of_the_deviation_and_no_more_information_than_of_a_minute() -> None:
    stand = np.array([6.0, 60.0, 600.0])
    assert sf.sample_variance(stand, FADING) == pytest.approx([60.0, 6.0, 6.0])
    assert sf.sample_variance(stand, LITERAL) == pytest.approx([1e-3, 1e-4, 1e-5])


def well_known(params: FieldParams) -> sf.Information:
    d = 1e9 * np.eye(params.size)
    return sf.Information(d, d @ np.ones(params.size))


def test_what_is_known_of_the_field_fades_in_120_hours_that_of_the_profile_wanders_in_30_days() -> None:
    mean, cov = sf.elapse(well_known(FADING), 120 * HOUR, FADING).coefficients()
    assert mean[0] == pytest.approx(math.exp(-1))
    assert cov[0, 0] == pytest.approx(1 - math.exp(-2))
    mean, cov = sf.elapse(well_known(FADING), 30 * DAY, FADING).coefficients()
    assert cov[350, 350] == pytest.approx(2.0, rel=0.02)
    assert mean[350] == pytest.approx(1.0, rel=0.02)


def test_after_15_memories_a_field_is_forgotten() -> None:
    mean, _ = sf.elapse(well_known(FADING), 1e12, FADING).coefficients()
    assert mean[0] == pytest.approx(math.exp(-15), rel=1e-3)


def test_the_paper_adds_2e_3_an_hour() -> None:
    _, cov = sf.elapse(well_known(LITERAL), HOUR, LITERAL).coefficients()
    assert cov[0, 0] == pytest.approx(2e-3, rel=1e-3)


def test_samples_of_an_hour_are_of_one_time() -> None:
    t = np.array([0.0, 3500.0, 3700.0])
    batch = Batch("a", "a", t, np.full((3, 3), 0.5), np.ones(3), np.full(3, 60.0))
    assert [each.bin for each in sf.run(None, [batch], FADING)] == [0, 1]


@pytest.mark.parametrize(
    ("sensor", "expected"),
    [
        ("sci_water_temp", (1.0, 15.0, 10.0)),
        ("salinity", (0.2, 33.0, 10.0)),
        ("density", (0.3, 25.0, 10.0)),
        ("oxygen", (15.0, 250.0, 100.0)),
    ],
)
def test_what_is_usual_of_a_sensor(sensor: str, expected: tuple[float, ...]) -> None:
    found = params_of(sensor, "fading")  # type: ignore[arg-type]
    place = np.array([[0.5, 0.5, 0.5]])
    mean, error = sf.estimate(sf.prior(found), place, found)
    phi = sf.rows(place, found)[0]
    deviation, usual, spread = expected
    assert mean[0] == usual
    expected_error = math.hypot(deviation * np.linalg.norm(phi[:343]), spread * np.linalg.norm(phi[343:]))
    assert error[0] == pytest.approx(expected_error)
    assert sf.seconds_of_information(found) == pytest.approx(360 * deviation**2)


def test_samples_of_a_minute_are_one() -> None:
    t = T0 // 60 * 60 + 10.0 * np.arange(61)  # ten minutes and a sample
    flat = Series(readonly(t), readonly(np.full(61, 20e4)))
    fixes = {
        name: Series(readonly(t[[0, -1]]), readonly([v, v]))
        for name, v in (("fix_lat", 50.0), ("fix_lon", 1.0))
    }
    series = {"temperature": flat, "science_pressure": flat, **fixes}
    segment = Segment(SegmentId(t[0], "g", "g-1"), "m", "sbd", float(t[-1]), (0, 1, ""), series)
    found = batch_of(segment, "sci_water_temp", Box(49.0, 0.0, 51.0, 2.0, 0.0, 100.0))
    assert found is not None
    assert len(found.t) == 11


@pytest.mark.parametrize(("n", "is_batch"), [(15_000, True), (25_000, False)])
def test_a_batch_of_more_than_20_000_samples_is_none(n: int, is_batch: bool) -> None:
    data = packed(Batch("a", "a", T0 + np.arange(n), np.zeros((n, 3)), np.zeros(n), np.ones(n)))
    if is_batch:
        assert len(unpacked(data, "a", "a").t) == n
    else:
        assert len(zlib.decompress(data)) > 20_000 * 16
        with pytest.raises(ValueError, match="no batch"):
            unpacked(data, "a", "a")


@pytest.mark.parametrize(("ahead", "n"), [(20 * HOUR, 1), (30 * HOUR, 0)])
def test_a_batch_of_more_than_a_day_ahead_is_left_alone(ahead: float, n: int) -> None:
    batch = Batch("a", "a", np.array([time.time() + ahead]), np.zeros((1, 3)), np.zeros(1), np.ones(1))
    came = list[BatchesCame]()
    relay = SimpleNamespace(settings=SimpleNamespace(fields={"upper": "key"}), _news=came.append)
    parcel = Parcel(1, "b", "upper", "key", (Sample("a", "a", packed(batch)),))
    RelayExchange._take(relay, parcel)  # type: ignore[arg-type]
    assert len(came) == n


# --------------------------------------------------------------------------- where to look next

BOX = Box(49.73, 0.0, 50.27, 0.84, 0.0, 100.0)
LEG = Leg(50.0, 0.42, 0.3, 4 * HOUR)


def wedge(heading: float) -> tuple[tuple[float, float], ...]:
    """Waters 2 degrees to each side of a heading (degrees), from a little behind the glider on."""
    ways = ((-500.0, heading), (30e3, heading - 2), (30e3, heading + 2))
    plane = [(r * math.sin(math.radians(angle)), r * math.cos(math.radians(angle))) for r, angle in ways]
    return tuple(from_plane(each, LEG.lat, LEG.lon) for each in plane)


@pytest.mark.parametrize(("heading", "is_found"), [(30.0, True), (15.0, False)])
def test_every_30_degrees_are_compared(heading: float, is_found: bool) -> None:
    found = advise(sf.prior(FADING), LEG, BOX, Bounds(polygon=wedge(heading)), FADING)
    assert (found is not None) == is_found


def test_a_leg_is_24_samples() -> None:
    assert len(leg_samples(LEG, 0.0, BOX)) == 24


@pytest.mark.parametrize(("off", "allowed"), [(4e3, False), (6e3, True)])
def test_5_km_from_others(off: float, allowed: bool) -> None:
    other = from_plane((off, 0.0), *LEG.end(0.0))
    assert is_allowed(LEG, 0.0, BOX, Bounds(others=(other,))) == allowed


class _Gliders:
    """A store in which one other glider was last up some time ago, of which no next surfacing is known."""

    def __init__(self, ago: float) -> None:
        self.last = SimpleNamespace(t_surface=T0 - ago, lat=50.0, lon=0.4)

    def gliders(self) -> list[str]:
        return ["a", "b"]

    def facts(self, glider: str) -> SimpleNamespace:
        return SimpleNamespace(last_surfacing=lambda until: self.last, expected=lambda until: None)


@pytest.mark.parametrize(("ago", "n"), [(20 * HOUR, 1), (30 * HOUR, 0)])
def test_who_was_not_up_for_a_day_is_not_at_sea(ago: float, n: int) -> None:
    ends, legs = service._others(_Gliders(ago), "a", T0)  # type: ignore[arg-type]
    assert (len(ends), len(legs)) == (n, 0)


def test_a_leg_takes_3_hours_where_it_is_not_known(monkeypatch: pytest.MonkeyPatch) -> None:
    found = (0.3, 0.0, lambda a, b: (np.zeros(2), None))
    monkeypatch.setattr(service, "look_ahead", lambda estimate, to: found)
    state = SimpleNamespace(memory=SimpleNamespace(estimate=None, expected=None))
    leg = service._leg(_Gliders(0.0), "b", state)  # type: ignore[arg-type]
    assert leg is not None
    assert leg[1].duration == 3 * HOUR


# --------------------------------------------------------------------------- the sea

STILL = Sea(eddy=0.0, gradient=0.0, inertial=0.0)
ALL = Sea(eddy=0.0, gradient=0.06, inertial=0.0)


def covariance(sea: Sea, east: float = 0.0, later: float = 0.0, at: float = 0.0) -> np.ndarray:
    """That of the flow at two moments: the first ``at`` (m) east of the origin, the second ``east`` and
    ``later`` of it."""
    one = Dives(np.array([[at, 0.0]]), np.zeros(1), np.zeros(1))
    two = Dives(np.array([[at + east, 0.0]]), np.array([later]), np.zeros(1))
    return FlowCovariance(one, two, 50.0).of(sea)


def test_mean_flow_tides_and_what_is_small() -> None:
    assert covariance(STILL)[0, 0] == pytest.approx(0.3**2 + 5 * 0.3**2 + 0.015**2, abs=1e-7)
    without = covariance(STILL, east=60e3)[0, 0]
    assert without == pytest.approx(0.3**2 + 5 * 0.3**2, abs=1e-7)
    assert covariance(STILL, east=6e3)[0, 0] - without == pytest.approx(0.015**2 * math.exp(-0.5), rel=1e-6)
    assert covariance(ALL, at=60e3)[0, 0] - covariance(ALL)[0, 0] == pytest.approx(5 * 0.06**2)


def test_eddies_forget_in_48_h_inertial_motion_in_72_h_and_100_km() -> None:
    eddies, inertial = Sea(eddy=1.0, gradient=0.0, inertial=0.0), Sea(eddy=0.0, gradient=0.0, inertial=1.0)

    def alone(sea: Sea, **where: float) -> np.ndarray:
        return covariance(sea, **where) - covariance(STILL, **where)

    assert alone(eddies, later=48 * HOUR)[0, 0] == pytest.approx(math.exp(-1))
    assert np.hypot(*alone(inertial, later=72 * HOUR)[0]) == pytest.approx(math.exp(-1))
    assert alone(inertial, east=100e3)[0, 0] == pytest.approx(math.exp(-0.5))


def current(
    glider: str, east: float = 0.0, t: float = 0.0, u: float = 0.0, course: tuple[float, float] = (0.0, 1.0)
) -> DiveCurrent:
    """One of three hours, that ends ``t`` s after T0."""
    place = from_plane((east, 0.0), 50.0, 0.0)
    return DiveCurrent(
        glider, Fix(T0 + t - 3 * HOUR, *place), Fix(T0 + t, *place), u, 0.0, course=course, speed=0.3
    )


def test_errors_of_healthy_gliders() -> None:
    one = current("a")
    assert flow.healthy_errors([one]) == pytest.approx(np.diag([0.05 * 0.3, 0.08 * 0.3]) ** 2)
    assert flow.noise([one], Sea()) == pytest.approx(0.02**2 * np.eye(2))


@pytest.mark.parametrize(("east", "is_near"), [(50e3, True), (70e3, False)])
def test_neighbours_are_near_within_60_km(east: float, is_near: bool) -> None:
    own = current("a")
    found = fleet_flow([current("b", east, -HOUR)], "a", own.start, own.end, Sea())
    assert (found is not None) == is_near
    assert (cross_check([own, current("b", east, -HOUR)], "a") is not None) == is_near


@pytest.mark.parametrize(("days", "counts"), [(8, True), (12, False)])
def test_the_flow_is_by_currents_of_10_days(days: float, counts: bool) -> None:
    own = current("a")
    found = fleet_flow([current("b", 5e3, -days * DAY)], "a", own.start, own.end, Sea())
    assert (found is not None) == counts


@pytest.mark.parametrize(("days", "counts"), [(3, True), (5, False)])
def test_dives_of_4_days_are_compared(days: float, counts: bool) -> None:
    assert (cross_check([current("a"), current("b", 5e3, -days * DAY)], "a") is not None) == counts


def test_the_nearest_200_currents_count() -> None:
    others = [current("b", 5e3, -HOUR * k / 4) for k in range(420)]
    own = current("a")
    assert len(flow._near(others, "a", own.start, own.end, -math.inf)) == 200


# --------------------------------------------------------------------------- who is wrong


def dive(**changes: object) -> Assessment:
    numbers = {"heading_mean": 90.0, "heading_steadiness": 0.9, "own_speed": 0.31}
    whole = replace(_at(_HEALTHY, T0), lat=50.0, lon=1.0, reference_u=0.1, reference_v=0.2, evidence=numbers)
    return replace(whole, **{"flag": 0, "reference_final": True} | changes)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("changes", "doubt", "along"),
    [
        ({}, 1.0, 0.0),
        ({"reference_final": False}, 2.0, 0.0),
        ({"flag": None}, 3.0, 0.0),
        ({"flag": int(Flag.ANOMALY)}, 1.0, 0.15),
    ],
)
def test_what_a_current_in_doubt_weighs(changes: dict[str, object], doubt: float, along: float) -> None:
    found = current_of(dive(**changes), None)
    assert found is not None
    assert (found.doubt, found.along) == (doubt, along)


@pytest.mark.parametrize(("hours", "goes_on"), [(5, True), (7, False)])
def test_after_6_hours_at_the_surface_a_dive_begins_where_it_is(hours: float, goes_on: bool) -> None:
    one = dive()
    before = replace(one, t_surface=one.t_dive - hours * HOUR, lat=50.1)
    found = current_of(one, before)
    assert found is not None
    assert (found.start.lat == 50.1) == goes_on


LOSS = Hypothesis("a", Fault.LOSS, T0 - DAY, 9, 0.4, 0.05, 100.0)
TURN, SHARED = replace(LOSS, fault=Fault.TURN), replace(LOSS, glider="", fault=Fault.TURN)


def is_sure(found: Hypothesis | None, **more: object) -> bool:
    return Check(("b",), 9e3, found, **{"others": None} | more).sure is not None  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("low", "high"),
    [
        (replace(LOSS, ratio=11.5), replace(LOSS, ratio=12.5)),
        (replace(LOSS, dives=3), replace(LOSS, dives=4)),
        (replace(LOSS, size=0.19), replace(LOSS, size=0.21)),
        (replace(TURN, size=0.19), replace(TURN, size=0.21)),
    ],
)
def test_what_is_sure(low: Hypothesis, high: Hypothesis) -> None:
    assert not is_sure(low)
    assert is_sure(high)


def test_it_is_clearer_than_another_fault_and_than_water_of_its_own() -> None:
    for off, sure in ((5.5, False), (6.5, True)):
        assert is_sure(LOSS, others=replace(LOSS, glider="b", ratio=100.0 - off)) == sure
    for off, sure in ((34.0, False), (36.0, True)):
        assert is_sure(LOSS, own_water=100.0 - off) == sure


def test_what_all_share_has_40_and_is_a_current_where_all_go_one_way() -> None:
    for ratio, sure in ((39.0, False), (41.0, True)):
        assert is_sure(None, common=replace(SHARED, ratio=ratio)) == sure
    for one_way, sure in ((0.45, True), (0.55, False)):
        assert is_sure(None, common=SHARED, one_way=one_way) == sure


def test_the_currents_of_who_likely_has_a_fault_have_ten_times_the_error() -> None:
    check = Check(("b",), 9e3, None, replace(LOSS, glider="b"))
    (found,) = reference._without_faults([current("b")], check)
    assert found.doubt == 10.0


@pytest.mark.parametrize(("shown", "sure"), [([True], False), ([False, True], False), ([True, True], True)])
def test_a_fault_is_shown_at_two_surfacings_in_a_row(
    monkeypatch: pytest.MonkeyPatch, shown: list[bool], sure: bool
) -> None:
    currents = [current("a", t=4 * HOUR * k) for k in range(len(shown))]

    def check(until: list[DiveCurrent], glider: str) -> Check:
        return Check(("b",), 9e3, LOSS if shown[len(until) - 1] else None, None)

    monkeypatch.setattr(reference, "cross_check", check)
    found = reference.standing(currents, "a")
    assert found is not None
    assert (found.fault is not None) == sure


@pytest.mark.parametrize(
    ("number", "least", "most"),
    [
        ("eddy", 0.03, 0.3),
        ("reach", 20e3, 80e3),
        ("gradient", 0.02, 0.2),
        ("inertial", 0.03, 0.15),
        ("noise", 0.008, 0.02),
    ],
)
def test_seas_that_are_tried(number: str, least: float, most: float) -> None:
    small = cc._climb(Sea(**{number: 1e9}), lambda sea: -getattr(sea, number))
    large = cc._climb(Sea(**{number: 0.0}), lambda sea: getattr(sea, number))
    assert (getattr(small, number), getattr(large, number)) == (least, most)


def test_water_of_its_own_is_of_10_cm_s() -> None:
    currents = [current(g, 5e3 * (g == "b"), -4 * HOUR * k, 0.1 * (g == "a")) for g in "ab" for k in range(3)]
    seas = cc._Seas(currents)
    here = np.array([each.glider == "a" for each in currents])
    t = np.array([each.end.t for each in currents])
    water = 0.1**2 * np.exp(-np.abs(t[:, None] - t) / (48 * HOUR)) * np.outer(here, here)
    measured = np.array([[each.u, each.v] for each in currents]).ravel()

    def likelihood(cov: np.ndarray) -> float:
        return -0.5 * float(measured @ np.linalg.solve(cov, measured)) - 0.5 * float(
            np.linalg.slogdet(cov)[1]
        )

    plain = seas._covariance_of(seas.usual)
    expected = 2 * (likelihood(plain + np.kron(water, np.eye(2))) - likelihood(plain))
    assert seas.own_water("a", seas.usual) == pytest.approx(expected)


def test_a_fault_began_within_16_dives() -> None:
    currents = [current("a", t=4 * HOUR * k) for k in range(20)]
    assert max(each.dives for each in cc._candidates(currents) if each.glider) == 16


@pytest.mark.parametrize(("size", "is_loss"), [(1.1, True), (1.3, False)])
def test_who_would_fly_backwards_has_no_loss(size: float, is_loss: bool) -> None:
    currents = [
        replace(current(g, 2e3 * k, -4 * HOUR * n), v=-size * 0.3 * (g == "a" and n < 6))
        for k, g in enumerate("abc")
        for n in range(10)
    ]
    found = cross_check(currents, "a")
    assert found is not None and found.found is not None
    assert (found.found.fault is Fault.LOSS and abs(found.found.size - size) < 0.1) == is_loss
