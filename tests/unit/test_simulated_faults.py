"""Each fault by its signature: what it does to speed, depth rate, closure and instruments, and what not."""

from dataclasses import replace

import numpy as np
import pytest

from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.ocean import Sea
from gliderwatch.simulate.scenario import SIZES, STRIKE, DiveTruth, Fault, FaultKind, Health, Mission
from simulated import DAY, ONSET, STRAIGHT, closures, medians, samples

QUIET = replace(STRAIGHT, sea=Sea(residual=(0.06, 0.0), sigma=0.0, tides=()))


def struck(kind: FaultKind, size: float, *, ramp: float = 0.0, onset: float = ONSET) -> Mission:
    return simulate(replace(QUIET, faults=(Fault(kind, onset, size, ramp),)))


def before_after(mission: Mission, name: str) -> tuple[float, float]:
    """Means of a field of the truth before and after the onset, each of the whole dives there."""

    def value(dive: DiveTruth) -> float:
        return float(getattr(dive, name))

    before = [value(dive) for dive in mission.truth if dive.t_surface < ONSET]
    after = [value(dive) for dive in mission.truth if dive.t_dive > ONSET]
    return float(np.mean(before)), float(np.mean(after))


def instrument(mission: Mission, name: str) -> tuple[float, float]:
    """Means of the magnitude of a sensor before and after the onset."""
    t, v = samples(mission, name)
    return float(np.abs(v[t < ONSET]).mean()), float(np.abs(v[t > ONSET + 4 * 3600]).mean())


def test_a_remora_slows_the_believed_speed_at_once() -> None:
    mission = simulate(replace(STRAIGHT, faults=(Fault(FaultKind.REMORA, ONSET, 2.0),)))
    before, after = medians(mission, "along")
    assert before == pytest.approx(0.253, abs=0.01)
    assert after / before == pytest.approx(0.75, abs=0.02)
    first = next(dive for dive in closures(mission, STRAIGHT.variation) if dive.t_dive > ONSET)
    assert first.along == pytest.approx(after, abs=0.01)
    assert medians(mission, "misfit")[1] < 3e-3
    speeds = [truth.speed for truth in mission.truth]
    assert min(speeds) / max(speeds) == pytest.approx(0.68, abs=0.02)


def test_a_lost_wing_hides_in_the_current() -> None:
    mission = simulate(replace(STRAIGHT, faults=(Fault(FaultKind.WING_LOSS, ONSET, 0.4),)))
    before, after = medians(mission, "along")
    assert after == pytest.approx(before, abs=0.003)
    healthy, hurt = mission.truth[2], mission.truth[-1]
    assert hurt.speed / healthy.speed == pytest.approx(0.6, abs=0.01)
    assert hurt.believed_speed == pytest.approx(healthy.believed_speed, rel=0.01)


def test_a_wrong_current_shows_across_the_way_only() -> None:
    mission = simulate(replace(STRAIGHT, faults=(Fault(FaultKind.DAC_WRONG, ONSET, 0.2),)))
    assert medians(mission, "across") == pytest.approx((0.0, -0.2), abs=0.003)
    before, after = medians(mission, "along")
    assert after == pytest.approx(before, abs=0.003)


def test_faults_are_named_from_their_onset_and_none_does_nothing() -> None:
    faults = (Fault(FaultKind.NONE, STRAIGHT.start, 0.0), Fault(FaultKind.REMORA, ONSET, 1.0))
    mission = simulate(replace(STRAIGHT, faults=faults))
    named = {truth.faults for truth in mission.truth if truth.t_surface < ONSET}
    assert named == {("none",)}
    assert mission.truth[-1].faults == ("none", "remora")
    healthy = simulate(STRAIGHT)
    for segment, other in zip(mission.segments, healthy.segments, strict=True):
        np.testing.assert_array_equal(segment.values, other.values)


@pytest.mark.parametrize(("kind", "size"), [(FaultKind.REMORA, 0.5), (FaultKind.WING_LOSS, 1.0)])
def test_a_fault_of_impossible_size_is_refused(kind: FaultKind, size: float) -> None:
    with pytest.raises(ValueError, match=kind.value):
        Fault(kind, 0.0, size)


# --------------------------------------------------------------------------- whole-body drag


@pytest.mark.parametrize("kind", [FaultKind.REMORA, FaultKind.FOULING])
def test_drag_takes_depth_rate_and_speed_at_once(kind: FaultKind) -> None:
    """Twice the parasite drag at a pitch of 0.45 rad: 0.68 of the speed and 0.75 of the depth rate."""
    mission = struck(kind, 2.0)
    for name, left in (("speed", 0.68), ("depth_rate", 0.75), ("believed_speed", 0.75)):
        before, after = before_after(mission, name)
        assert after / before == pytest.approx(left, abs=0.02)


def test_fouling_grows() -> None:
    mission = struck(FaultKind.FOULING, 3.0, ramp=DAY, onset=QUIET.start)
    speeds = [dive.speed for dive in mission.truth if dive.t_surface < QUIET.start + DAY]
    assert len(speeds) >= 6
    assert np.all(np.diff(speeds) < 0)
    assert speeds[0] > 0.2
    settled = [dive.speed for dive in mission.truth if dive.t_dive > QUIET.start + DAY]
    assert np.ptp(settled) < 0.005


def test_a_fault_is_felt_within_a_leg() -> None:
    """A dive to 900 m takes an hour and a half: a remora on the way down slows the rest of it."""
    deep = replace(QUIET, depths=(10.0, 900.0), drive=250e-6, days=0.3)
    fault = Fault(FaultKind.REMORA, deep.start + 4500.0, 4.0)
    t, depth = samples(simulate(replace(deep, faults=(fault,))), "m_depth")
    rate = np.gradient(depth, t)
    fast, slow = (
        np.median(rate[(t > start) & (t < start + 600)]) for start in (fault.onset - 700, fault.onset + 700)
    )
    assert slow < 0.7 * fast


# --------------------------------------------------------------------------- wings


def test_a_lost_wing_leaves_the_depth_rate_and_rolls_the_glider() -> None:
    mission = struck(FaultKind.WING_LOSS, 0.4)
    assert np.divide(*before_after(mission, "depth_rate")) == pytest.approx(1.0, abs=0.02)
    level, rolled = instrument(mission, "m_roll")
    assert level < np.radians(3)
    assert rolled > np.radians(15)


def test_a_shark_shakes_for_minutes_and_leaves_a_bent_wing() -> None:
    onset = simulate(QUIET).truth[8].t_dive + 3600.0
    mission = struck(FaultKind.SHARK_STRIKE, 0.3, onset=onset)
    for name, still in (("m_roll", 0.1), ("m_pitch", 0.56)):
        t, v = samples(mission, name)
        held = (t >= onset) & (t < onset + STRIKE)
        assert 30 <= held.sum() <= 60
        assert np.ptp(v[held]) > 0.7
        assert np.abs(v[t < onset]).max() < still
    after = samples(mission, "m_roll")
    assert np.median(after[1][after[0] > onset + STRIKE]) == pytest.approx(0.24, abs=0.01)
    last = mission.truth[-1]
    assert last.speed == pytest.approx(0.7 * last.believed_speed * 0.231 / 0.256, rel=0.02)


# --------------------------------------------------------------------------- held, weak


def test_a_net_hardly_lets_it_move() -> None:
    mission = struck(FaultKind.NET, 0.95)
    for name in ("speed", "depth_rate", "believed_speed"):
        before, after = before_after(mission, name)
        assert after < 0.08 * before
    assert all(dive.t_surface - dive.t_dive < 7 * 3600 for dive in mission.truth)
    pitch = samples(mission, "m_pitch")
    assert np.median(np.abs(pitch[1][pitch[0] > ONSET + DAY / 2])) == pytest.approx(0.45, abs=0.03)


def test_a_weak_pump_slows_dives_and_climbs_alike() -> None:
    """Speed goes with the root of the buoyancy: half the volume leaves 0.71 of it."""
    mission = struck(FaultKind.BALLAST, 0.5)
    for name in ("speed", "depth_rate"):
        before, after = before_after(mission, name)
        assert after / before == pytest.approx(np.sqrt(0.5), abs=0.02)
    whole, half = instrument(mission, "m_ballast_pumped")
    assert half == pytest.approx(0.5 * whole, rel=0.05)
    assert down_and_up(mission)[1] == pytest.approx(1.0, abs=0.02)


def test_lost_oil_slows_climbs_only() -> None:
    mission = struck(FaultKind.LEAK_OF_OIL, 0.5)
    assert down_and_up(mission) == pytest.approx((1.0, np.sqrt(0.5)), abs=0.03)
    whole, leaked = instrument(mission, "m_ballast_pumped")
    assert leaked == pytest.approx(whole, rel=0.02)
    assert np.diff(instrument(mission, "m_vacuum"))[0] == pytest.approx(-1.0, abs=0.05)


def down_and_up(mission: Mission) -> tuple[float, float]:
    """Speed of climbs over that of dives (m/s), before and after the onset, from depth alone."""
    t, depth = samples(mission, "m_depth")
    rate = np.gradient(depth, t)
    under = depth > 8
    ratios = []
    for chosen in (under & (t < ONSET), under & (t > ONSET + 4 * 3600)):
        ratios.append(
            float(-np.median(rate[chosen & (rate < -0.02)]) / np.median(rate[chosen & (rate > 0.02)]))
        )
    return ratios[0], ratios[1]


# --------------------------------------------------------------------------- only seeming


def test_a_compass_that_is_off_breaks_the_closure_with_any_current_but_its_own() -> None:
    """0.4 rad of 0.256 m/s are 0.1 m/s across. The glider's own current hides it: it is reckoned with the
    same compass, so that ground = own + current holds whatever the compass shows."""
    mission = struck(FaultKind.COMPASS, 0.4)
    before, after = medians(mission, "across_known")
    assert (before, after) == pytest.approx((0.0, 0.231 * np.sin(0.4)), abs=0.01)
    assert medians(mission, "misfit")[1] < 2e-3
    own_error = [np.hypot(*np.subtract(d.reported, d.current)) for d in mission.truth if d.t_dive > ONSET]
    assert np.median(own_error) == pytest.approx(2 * 0.245 * np.sin(0.2), abs=0.01)
    assert np.divide(*before_after(mission, "speed")) == pytest.approx(1.0, abs=0.01)


def test_a_wrong_current_breaks_the_closure() -> None:
    mission = struck(FaultKind.DAC_WRONG, 0.2)
    before, after = medians(mission, "misfit")
    assert before < 1e-3
    assert after == pytest.approx(0.2, abs=0.003)
    assert np.divide(*before_after(mission, "speed")) == pytest.approx(1.0, abs=0.01)


def test_a_strong_current_stops_a_healthy_glider() -> None:
    """0.06 m/s and 0.2 m/s against it leave nothing of 0.23 m/s over ground, and all of it in the water."""
    mission = struck(FaultKind.STRONG_CURRENT, 0.25)
    for name in ("speed", "depth_rate", "believed_speed"):
        assert np.divide(*before_after(mission, name)) == pytest.approx(1.0, abs=0.02)
    assert medians(mission, "over_ground")[1] < 0.4 * medians(mission, "over_ground")[0]
    before, after = medians(mission, "along")
    assert after == pytest.approx(before, abs=0.003)
    assert medians(mission, "misfit")[1] < 2e-3


# --------------------------------------------------------------------------- parts


def test_a_ramp_is_a_straight_line_from_onset_to_size() -> None:
    t = np.array([0.0, 10.0, 15.0, 20.0, 30.0])
    np.testing.assert_allclose(Fault(FaultKind.FOULING, 10.0, 3.0, 10.0).part(t), [0, 0, 0.5, 1, 1])
    np.testing.assert_allclose(Fault(FaultKind.REMORA, 10.0, 3.0).part(t), [0, 1, 1, 1, 1])
    with pytest.raises(ValueError, match="ramp"):
        Fault(FaultKind.REMORA, 0.0, 2.0, -1.0)


def test_faults_add_up() -> None:
    health = Health(
        (
            Fault(FaultKind.REMORA, 0.0, 2.0),
            Fault(FaultKind.FOULING, 0.0, 3.0, 10.0),
            Fault(FaultKind.WING_LOSS, 0.0, 0.5),
            Fault(FaultKind.SHARK_STRIKE, 5.0, 0.2),
            Fault(FaultKind.COMPASS, 0.0, -0.3),
        )
    )
    assert health.drag(5.0) == pytest.approx(2.0 * 2.0)
    np.testing.assert_allclose(health.gliding(np.array([4.0, 6.0])), [0.5, 0.4])
    np.testing.assert_allclose(health.compass(np.array([-1.0, 1.0])), [0.0, -0.3])


def test_every_fault_has_a_size_and_does_something() -> None:
    assert set(SIZES) == set(FaultKind)
    healthy = struck(FaultKind.NONE, 0.0)
    for kind in FaultKind:
        if kind is FaultKind.NONE:
            continue
        size = 1.5 if SIZES[kind].least == 1 else 0.3
        hurt = struck(kind, size)
        assert hurt.truth[0].speed == healthy.truth[0].speed
        same = [
            np.array_equal(a.values, b.values, equal_nan=True)
            for a, b in zip(hurt.segments, healthy.segments, strict=False)
        ]
        assert not all(same), kind


def test_a_glider_that_cannot_fly_says_so() -> None:
    flat = replace(QUIET, pitch=0.2, pitch_sigma=0.0, faults=(Fault(FaultKind.REMORA, QUIET.start, 12.0),))
    with pytest.raises(ValueError, match="glide steeper"):
        simulate(flat)
