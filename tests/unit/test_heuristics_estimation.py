"""The heuristics of speed and flow do what their page says: each case lies just on one side of a bound."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gliderwatch.estimation import adaptive, dive_measurement, glider, kalman, modes, verdict
from gliderwatch.estimation.dive_measurement import (
    OWN,
    SIDE,
    SLIP,
    Measured,
    Slipping,
    are_apart,
    drag_slip,
    observe,
    slip_at,
    slip_of,
    with_thrust,
)
from gliderwatch.estimation.glider import speed_params
from gliderwatch.estimation.healthy_baseline import Baseline, compare
from gliderwatch.estimation.healthy_baseline import learn as learn_baseline
from gliderwatch.estimation.kalman import (
    JointParams,
    JointState,
    learn_measurement_scale,
    learn_process_scale,
)
from gliderwatch.estimation.kinematic_speed import KinematicSpeed, Ratios, kinematic_speed, vertical
from gliderwatch.estimation.kinematic_speed import learn as learn_ratios
from gliderwatch.estimation.modes import MODES, Cause, switched
from gliderwatch.estimation.speed_range import Drive, Normal, RangeParams, SpeedRange, speed_range
from gliderwatch.estimation.step_test import Bank, Update, ratio_bound, steps
from gliderwatch.estimation.unassessed import Reference, of_model
from gliderwatch.estimation.verdict import (
    Blame,
    Misfit,
    SpeedParams,
    SpeedState,
    blame,
    slowed,
    step,
)
from gliderwatch.model import Current, Dive, DiveFeatures, Fix, Flag, readonly
from gliderwatch.navigation.geodesy import from_plane
from gliderwatch.papers.learner import init
from gliderwatch.params import GliderParams
from gliderwatch.sea.ocean_field import Field
from gliderwatch.simulate.flight import Airframe, steady_glide
from joint_support import HOUR, Way, dive, mission

EAST = dive(0, Way(heading=0.0, speed=0.25))
CIRCLE = dive(0, Way(heading=tuple(np.linspace(0, 2 * math.pi, 24, endpoint=False))))


def heading_sigmas(of: Dive) -> list[float]:
    """Standard errors of the mean heading vector, the smaller one first."""
    return np.sqrt(np.linalg.eigvalsh(observe(of).heading_cov)).tolist()


def known_by(of: Dive, **features: object) -> Dive:
    return replace(of, features=replace(of.features, **features))


class TestMeasurement:
    def test_a_fix_is_5_m_off(self):
        """Two fixes over 12 min: 7 m of 720 s; and the difference of two such ways in the current."""
        seen = observe(dive(0, Way(), hours=0.2))
        assert math.sqrt(seen.ground_cov[0, 0]) == pytest.approx(math.sqrt(2) * 5.0 / 720)
        assert seen.current_sigma == pytest.approx(math.hypot(0.006, 10.0 / 720))

    def test_a_provisional_current_is_2_cm_s_off(self):
        assert observe(EAST).current_sigma == pytest.approx(0.006, rel=0.02)
        provisional = replace(EAST, current=replace(EAST.current, final=False))
        assert observe(provisional).current_sigma == pytest.approx(0.02, rel=0.02)

    def test_the_drift_at_the_surface_is_another_flow(self):
        vectors = EAST.track.heading.copy()
        vectors[12:] = 0.0
        seen = observe(replace(EAST, track=replace(EAST.track, heading=readonly(vectors))))
        assert math.sqrt(seen.ground_cov[0, 0]) == pytest.approx(0.5 * 0.15, rel=0.01)

    def test_swing_and_compass_of_a_straight_dive(self):
        """24 samples, each 0.1 rad off its course: 0.006 of the length; the compass turns all by 0.02."""
        along, aside = heading_sigmas(EAST)
        assert along == pytest.approx(math.sqrt(2 / 24) * 0.1 / math.sqrt(24), rel=0.01)
        assert aside == pytest.approx(math.hypot(along, 0.02), rel=0.01)

    def test_dives_and_climbs_differ_by_a_twentieth(self):
        """It matters where they head elsewhere: here east and north in turn, so that swings are equal."""
        there = observe(dive(0, Way(heading=(0.0, math.pi / 2)), samples=960)).heading_cov
        part = 0.05**2 * (1 - 0.5) / 2
        aside = np.array([-1.0, 1.0]) / math.sqrt(2)
        assert aside @ there @ aside == pytest.approx(part + 0.02**2 / 2, rel=0.1)

    def test_hours_without_data_may_have_been_half_a_turn(self):
        """A fifth of the dive: its mean vector is known to 0.5 of it."""
        holed = known_by(EAST, unobserved=0.6 * HOUR)
        assert heading_sigmas(holed)[0] == pytest.approx(0.1, rel=0.01)

    @pytest.mark.parametrize(
        ("known", "along", "length"),
        [
            ({"heading_reckoned": True}, 0.03, 1.0),
            ({"heading_commanded": 3 * HOUR}, 0.03, 1.0),
            ({"heading_assumed": True}, 0.2, 0.92),
        ],
    )
    def test_a_length_that_no_compass_measured(self, known, along, length):
        seen = known_by(EAST, **known)
        assert heading_sigmas(seen)[1] == pytest.approx(math.hypot(along, 0.02), rel=0.01)
        assert observe(seen).steadiness == pytest.approx(length)

    @pytest.mark.parametrize(
        ("known", "error"), [({"heading_reckoned": True}, 0.3), ({"heading_commanded": 3 * HOUR}, 0.08)]
    )
    def test_a_course_that_no_current_corrects(self, known, error):
        assert heading_sigmas(replace(known_by(EAST, **known), current=None))[0] == pytest.approx(
            error, rel=0.02
        )

    @pytest.mark.parametrize(("apart", "error"), [(0.8, 0.03), (1.1, 0.5)])
    def test_few_commanded_headings_that_differ_tell_of_turns(self, apart, error):
        """Mean of two headings 0.8 rad apart: 0.92 long, straight; of 1.1 rad: 0.85, it turned."""
        turned = known_by(dive(0, Way(heading=(0.0, apart))), heading_commanded=3 * HOUR)
        assert heading_sigmas(turned)[1] == pytest.approx(math.hypot(error, 0.02), rel=0.05)

    @pytest.mark.parametrize(
        ("known", "chance"),
        [
            ({}, 0.0),
            ({"heading_commanded": 1.0}, 0.1),
            ({"heading_reckoned": True}, 0.0),
            ({"heading_assumed": True}, 0.0),
        ],
    )
    def test_a_glider_may_turn_where_commanded_headings_alone_are_sent(self, known, chance):
        assert observe(known_by(EAST, **known)).turning == chance
        assert observe(replace(known_by(EAST, **known), current=None)).turning == 0.0

    @pytest.mark.parametrize("pitch", [0.3, 0.45, 0.6, 1.0])
    def test_slip_is_that_of_the_flight_model(self, pitch):
        """Merckelbach et al. (2010, 2019): C_D0 0.15, C_D1 10.5 1/rad2, a 7.5 1/rad; 17 to 57 degrees."""
        path = pitch + steady_glide(pitch, 150e-6, Airframe()).attack
        assert slip_at(pitch) == pytest.approx(1 - math.tan(pitch) / math.tan(path), rel=1e-4)

    def test_slip_outside_of_the_model(self):
        assert slip_at(0.2) == slip_at(0.3) > slip_at(0.31)
        assert slip_at(1.2) == slip_at(1.0) < slip_at(0.99)
        assert observe(known_by(EAST, pitch_dive=None, pitch_climb=None)).slip == slip_at(0.45)

    @pytest.mark.parametrize(("gap", "unseen"), [(9, 0), (11, 1)])
    def test_a_gap_between_headings_is_longer_than_10_min(self, gap, unseen):
        """Headings come every minute but once."""
        assert (observe(_with_gap(60.0, 60.0 * gap)).unseen > 0) == bool(unseen)

    @pytest.mark.parametrize(("cadences", "unseen"), [(2.4, 0), (2.6, 1)])
    def test_a_gap_is_longer_than_2_5_spacings(self, cadences, unseen):
        assert (observe(_with_gap(900.0, 900.0 * cadences)).unseen > 0) == bool(unseen)

    def test_half_the_speed_by_drag_takes_a_quarter_of_90_percent(self):
        assert drag_slip(np.array([0.125]), 0.25) == pytest.approx(0.225)

    @pytest.mark.parametrize(("own", "counts"), [(0.001, 0.02), (5.0, 1.3), (0.3, 0.3)])
    def test_a_speed_counts_as_what_a_glider_can_fly(self, own, counts):
        states = np.array([[0.0, 0.0, own, 0.0, 0.0], [0.0, 0.0, counts, 0.0, 0.0]])
        both, _ = slip_of(states, Slipping(0.1, 0.01, 2.0))
        assert both[0] == both[1]
        between, _ = slip_of(states * 1.2 + [[0, 0, 1e-9, 0, 0]], Slipping(0.1, 0.01, 2.0))
        assert own != counts or between[0] != both[0]


def _with_gap(spacing: float, gap: float) -> Dive:
    """A dive of 40 headings that has one gap (s)."""
    dt = np.full(40, spacing)
    dt[20] = gap
    t = EAST.t_dive + np.concatenate([[0.0], np.cumsum(dt)])
    x = np.column_stack([0.25 * (t - t[0]), np.zeros(41)])
    track = replace(EAST.track, t=readonly(t), x=readonly(x), heading=readonly(np.tile([1.0, 0.0], (40, 1))))
    return replace(EAST, track=track, t_surface=float(t[-1]))


class TestDeployments:
    @pytest.mark.parametrize(("days", "apart"), [(2.9, False), (3.1, True)])
    def test_after_three_days_it_is_another_one(self, days, apart):
        assert are_apart(Fix(0.0, 30.0, -80.0), Fix(days * 86400.0, 30.0, -80.0)) == apart

    @pytest.mark.parametrize(("speed", "apart"), [(2.9, False), (3.1, True)])
    def test_nothing_drifts_at_3_m_s(self, speed, apart):
        north = speed * 36000.0 / 111.2e3
        assert are_apart(Fix(0.0, 30.0, -80.0), Fix(36000.0, 30.0 + north, -80.0)) == apart

    @pytest.mark.parametrize(("metres", "apart"), [(1700.0, False), (1900.0, True)])
    def test_fixes_of_one_surfacing_scatter(self, metres, apart):
        assert are_apart(Fix(0.0, 30.0, -80.0), Fix(10.0, 30.0 + metres / 111.2e3, -80.0)) == apart


class TestPrior:
    def test_before_any_dive(self):
        state = kalman.init(JointParams(), 0.0)
        assert state.x[OWN] == 0.35
        assert np.sqrt(np.diag(state.cov)[[OWN, SLIP, SIDE]]) == pytest.approx([0.2, 0.014, 0.03])

    def after_three_hours(self, slip: float, side: float) -> JointState:
        """What is expected of a state that was known, before a dive is measured."""
        params = JointParams()
        state = kalman.init(params, EAST.t_dive)
        state = replace(state, x=readonly([*state.x[:-2], slip, side]), cov=readonly(1e-12 * state.cov))
        seen = observe(EAST)
        passage = kalman._passage(state, seen.start, seen.end, 27.5, params)
        return kalman._predicted(state, seen.end, tuple(seen.ground), passage, params)

    def test_the_speed_wanders_by_1_5_cm_s_in_3_hours_and_slip_is_forgotten_in_a_month(self):
        after, fades = self.after_three_hours(0.05, 0.11), math.exp(-3 / 24 / 30)
        assert math.sqrt(after.cov[OWN, OWN]) == pytest.approx(0.015, rel=0.01)
        assert after.x[[SLIP, SIDE]] == pytest.approx([0.05 * fades, 0.11 * fades])

    def test_what_no_healthy_glider_has_is_not_forgotten(self):
        """A lost wing, a bent one: from four standard errors on."""
        assert self.after_three_hours(0.06, 0.13).x[[SLIP, SIDE]].tolist() == [0.06, 0.13]

    def test_three_quarters_of_the_physical_slip_are_real(self):
        """On the first dive nothing else is known of it."""
        _, info = kalman.step(None, EAST, JointParams())
        assert info.estimate.slip[0] == pytest.approx(0.75 * slip_at(0.45), abs=0.003)

    def test_a_thruster_takes_from_the_angle_of_attack(self):
        """0.36 of it adds 0.8 * 0.36 to the square of the speed along the path, 0.6 m/s over cos(pitch)."""
        driven = replace(EAST.features, thruster=0.36, pitch_dive=-0.42, pitch_climb=0.42)
        seen = observe(replace(EAST, features=driven))
        left = 1 - 0.8 * 0.36 / (0.6 / math.cos(0.42)) ** 2
        assert with_thrust(seen, 0.6).slip == pytest.approx(left * slip_at(0.42), rel=1e-6)
        assert with_thrust(seen, 0.6).slip_sigma == pytest.approx(0.2 * slip_at(0.42), rel=1e-6)
        assert with_thrust(seen, 0.4).slip == 0.0
        sailing = observe(EAST)
        assert with_thrust(sailing, 0.6) is sailing

    def test_bounds_of_what_is_not_known_on_board(self):
        wild = np.array([0.0, 0.0, 3.0, -2.0, 2.0])
        assert kalman._bounded(wild)[-3:].tolist() == [1.3, -0.1, 0.85]
        assert kalman._bounded(-wild)[-3:].tolist() == [0.0, 0.95, -0.85]


class TestNoise:
    def test_the_first_guess_counts_for_six_dives_and_all_is_forgotten_in_forty(self):
        assert learn_measurement_scale(1.0, 2.0, dives=0) == pytest.approx(1 + 1 / 6)
        assert learn_measurement_scale(1.0, 2.0, dives=500) == pytest.approx(1 + 1 / 40)

    def test_a_fault_does_not_pass_for_noise(self):
        assert learn_measurement_scale(1.0, 1e6, dives=0) == pytest.approx(1 + 3 / 6)

    def test_bounds_of_the_factors(self):
        process, measurement = [1.0, 1.0], [1.0, 1.0]
        for _ in range(2000):
            process = [
                learn_process_scale(process[0], 0.0, 0.5, 9),
                learn_process_scale(process[1], 9.0, 0.5, 9),
            ]
            measurement = [
                learn_measurement_scale(measurement[0], 0.0, 9),
                learn_measurement_scale(measurement[1], 9.0, 9),
            ]
        assert process == [0.1, 40.0]
        assert measurement == [0.02, 9.0]

    def test_good_data_make_no_fault_of_a_usual_dive(self):
        state = replace(kalman.init(JointParams(), 0.0), measurement_scale=0.02)
        assert state.tested == 0.25


class TestModes:
    def test_how_often_and_how_large(self):
        table = {mode.cause: (mode.chance, mode.size) for mode in (*MODES, modes.ROLLED)}
        assert [mode.loss for mode in (*MODES, modes.ROLLED)] == [0.0] * 6
        assert (modes.LOST.chance, modes.LOST.size, modes.LOST.loss) == (9.0, 0.27, 0.36)
        assert sum(mode.chance for mode in MODES) == pytest.approx(1.0)
        assert table == {
            Cause.USUAL: (pytest.approx(0.92), 0.0),
            Cause.SPEED: (0.02, 0.2),
            Cause.FLOW: (0.03, 0.25),
            Cause.CURRENT: (0.02, 0.4),
            Cause.GROUND: (0.01, 0.3),
            Cause.WING: (9.0, 0.45),
        }

    @pytest.mark.parametrize("cause", [Cause.CURRENT, Cause.GROUND, Cause.SPEED])
    def test_what_was_wrong_or_changing_is_so_again_six_times_of_ten(self, cause):
        after = {m.cause: m.chance for m in switched(MODES, {cause: 1.0})}
        assert after[cause] == pytest.approx(0.6)
        assert sum(after.values()) == pytest.approx(1.0)

    def test_another_flow_is_no_likelier_after_one(self):
        assert switched(MODES, {Cause.FLOW: 1.0}) == switched(MODES, {})

    def test_an_unseen_turn_makes_the_ground_velocity_wrong(self):
        chance = {m.cause: m.chance for m in switched(MODES, {Cause.GROUND: 0.1}, turning=0.1)}
        assert chance[Cause.GROUND] == pytest.approx(0.1)
        assert chance[Cause.CURRENT] == 0.02
        assert sum(chance.values()) == pytest.approx(1.0)
        again = {m.cause: m.chance for m in switched(MODES, {Cause.GROUND: 1.0}, turning=0.1)}
        assert again[Cause.GROUND] == pytest.approx(0.6)


class TestSteps:
    def test_the_bound_is_that_which_was_measured(self):
        """The worst seas of `benchmarks/joint.py calibrate`: 0.50 alarms a month above 10, 0.06 above 18."""
        assert ratio_bound(0.5) == 10.0
        assert ratio_bound(0.5 / math.e) == pytest.approx(14.0)
        assert ratio_bound(1.0) == ratio_bound(0.5) < ratio_bound(0.45)

    @pytest.mark.parametrize(("roll", "stays"), [(0.04, True), (-0.04, True), (0.06, False), (None, False)])
    def test_a_roll_within_a_twentieth_of_a_radian_is_as_before(self, roll, stays, monkeypatch):
        asked = []
        monkeypatch.setattr(verdict.kalman, "step", lambda *given: asked.append(given[-1]) or (None, None))
        rolling = replace(EAST, features=replace(EAST.features, roll_mean=roll))
        verdict.step(SpeedState(rolls=(0.0,) * 5), rolling, speed_params(GliderParams()))
        assert asked == [stays]


class TestKinematicSpeed:
    def test_before_a_ratio_is_learnt(self):
        features = DiveFeatures(3 * HOUR, None, pitch_dive=-0.45, pitch_climb=0.45)
        features = replace(features, depth_rate_dive=0.14, depth_rate_climb=-0.14)
        found = kinematic_speed(Ratios(), features)
        assert found.speed == pytest.approx(vertical(features) / 1.17)
        assert found.sigma == pytest.approx(0.15 * found.speed)
        assert found.lies == 0.01
        learnt = kinematic_speed(Ratios(vertical=(1.0, 1.0, 1.0)), features)
        assert learnt.sigma == pytest.approx(0.07 * learnt.speed)

    def test_the_glider_s_own_mean(self):
        features = DiveFeatures(3 * HOUR, onboard_speed=0.25)
        assert kinematic_speed(Ratios(onboard=(1.0, 1.0)), features) is None
        found = kinematic_speed(Ratios(onboard=(1.0, 1.0, 1.0)), features)
        assert (found.sigma, found.lies) == (pytest.approx(0.12 * 0.25), 0.1)

    @pytest.mark.parametrize(("pitch", "tells"), [(0.14, False), (0.16, True)])
    def test_a_flat_glide_tells_nothing(self, pitch, tells):
        features = DiveFeatures(3 * HOUR, pitch_dive=-pitch, pitch_climb=pitch)
        features = replace(features, depth_rate_dive=0.05, depth_rate_climb=-0.05)
        assert (vertical(features) is not None) == tells

    @pytest.mark.parametrize(("minutes", "tells"), [(59, False), (61, True)])
    def test_the_glider_s_own_mean_tells_nothing_below_an_hour(self, minutes, tells):
        features = DiveFeatures(60.0 * minutes, onboard_speed=0.25)
        assert (kinematic_speed(Ratios(onboard=(1.0,) * 3), features) is not None) == tells

    @pytest.mark.parametrize(("minutes", "tells"), [(29, False), (31, True)])
    def test_depth_rate_tells_nothing_below_half_an_hour(self, minutes, tells):
        features = DiveFeatures(60.0 * minutes, pitch_dive=-0.45, pitch_climb=0.45)
        features = replace(features, depth_rate_dive=0.14, depth_rate_climb=-0.14)
        assert (kinematic_speed(Ratios(), features) is not None) == tells

    @pytest.mark.parametrize(("minutes", "teaches"), [(59, False), (61, True)])
    def test_an_hour_teaches_the_ratio(self, minutes, teaches):
        features = DiveFeatures(60.0 * minutes, onboard_speed=0.25)
        assert (learn_ratios(Ratios(), features, 0.25) != Ratios()) == teaches


class TestNormal:
    def range(self, speeds: list[float], settings: list[float], at: float = 0.0) -> SpeedRange | None:
        volumes = readonly(np.zeros((len(speeds), 2)))
        return speed_range(Normal(readonly(speeds), readonly(settings), volumes), Drive(at), RangeParams())

    def test_a_narrow_and_a_wide_range(self):
        narrow = self.range([0.2] * 9, [0.0] * 9)
        assert (narrow.low, narrow.high) == (pytest.approx(0.17), pytest.approx(0.27))
        wide = self.range([0.1, 0.3, 0.2] * 3, [0.0] * 9)
        assert wide.low == pytest.approx(0.15)

    def test_four_robust_standard_deviations(self):
        """Speeds whose median lies 0.006 m/s off the usual: 4 times 1.4826 of that."""
        found = self.range([0.2, 0.206, 0.194] * 5, [0.0] * 15)
        assert found.usual - found.low == pytest.approx(4 * 0.006 / 0.67449, rel=1e-3)

    @pytest.mark.parametrize(("apart", "counts"), [(0.04, True), (0.06, False)])
    def test_settings_of_a_thruster_a_twentieth_apart_are_alike(self, apart, counts):
        speeds, settings = [0.2, 0.2, 0.4], [0.5, 0.5, 0.5 - apart]
        assert (self.range(speeds, settings, 0.5) is not None) == counts

    @pytest.mark.parametrize(
        ("name", "value", "half"),
        [
            ("roll_mean", 0.01, 0.08),
            ("pitch_dive", -0.45, 0.08),
            ("pitch_asymmetry", 0.0, 0.1),
            ("depth_rate_dive", 0.2, 0.15 * 0.2),
            ("ballast_dive", 10e-6, 20e-6),
            ("yos_per_hour", 4 / 3, 0.3 * 4 / 3),
            ("vacuum", 30e3, 4e3),
        ],
    )
    def test_half_of_a_range_at_least(self, name, value, half):
        found = compare(self.taught(), self.FEATURES)[name]
        assert found.usual == pytest.approx(value)
        assert (found.high - found.low) / 2 == pytest.approx(half)

    @pytest.mark.parametrize(("hours", "half"), [(1.0, 0.5), (3.0, 1.2)])
    def test_the_duration_varies_by_half_an_hour_or_a_part(self, hours, half):
        features = replace(self.FEATURES, duration=hours * HOUR)
        found = compare(self.taught(features), features)["duration_h"]
        assert (found.high - found.low) / 2 == pytest.approx(half)

    @pytest.mark.parametrize(("deeper", "same"), [(4.0, True), (6.0, False)])
    def test_yos_are_held_against_dives_of_a_like_depth(self, deeper, same):
        features = replace(self.FEATURES, depth_max=20.0 + deeper)
        known = self.taught(replace(self.FEATURES, depth_max=20.0))
        assert ("yos_per_hour" in compare(known, features)) == same

    @pytest.mark.parametrize(("minutes", "compared"), [(29, False), (31, True)])
    def test_a_dive_below_half_an_hour_is_not_compared(self, minutes, compared):
        assert bool(compare(self.taught(), replace(self.FEATURES, duration=60.0 * minutes))) == compared

    def test_dozens_are_kept(self):
        known = Baseline()
        for k in range(400):
            known = learn_baseline(known, replace(self.FEATURES, thruster=0.12 * (k % 8)))
            if k == 99:
                assert len(known.dives) == 8 * 12 + 4
        assert len(known.dives) == 144
        one = self.taught(n=40)
        assert len(one.dives) == 24

    FEATURES = DiveFeatures(
        3 * HOUR,
        roll_mean=0.01,
        pitch_dive=-0.45,
        pitch_climb=0.45,
        depth_rate_dive=0.2,
        depth_rate_climb=-0.2,
        ballast_dive=10e-6,
        ballast_climb=200e-6,
        yos=4,
        depth_max=20.0,
        vacuum=30e3,
    )

    @pytest.mark.parametrize(("apart", "counts"), [(0.09, True), (0.11, False)])
    def test_settings_of_a_thruster_a_tenth_apart_are_compared(self, apart, counts):
        known = self.taught(replace(self.FEATURES, thruster=0.5))
        found = compare(known, replace(self.FEATURES, thruster=0.5 - apart))
        assert ("roll_mean" in found) == counts

    def taught(self, features: DiveFeatures = FEATURES, n: int = 6) -> Baseline:
        known = Baseline()
        for _ in range(n):
            known = learn_baseline(known, features)
        return known


class TestVerdict:
    def test_what_a_pilot_does_not_set(self):
        params = speed_params(GliderParams())
        assert (params.confidence, params.gate, params.least) == (1.645, 4.0, 0.05)
        assert (params.vague, params.turned) == (0.3, 0.15)

    @pytest.mark.parametrize(("degrees", "blamed"), [(43, Blame.UNCLEAR), (47, Blame.CURRENT)])
    def test_45_degrees_tell_a_current_from_a_compass(self, degrees, blamed):
        row = []
        for angle in np.radians([0.0, degrees, 0.0, degrees]):
            aside = np.array([-math.sin(angle), math.cos(angle)])
            row.append(Misfit(0.25, float(aside @ [-0.25, 0.3]), 0.002, float(angle)))
        assert blame(tuple(row), gate=4.0, least=0.05) is blamed

    @pytest.mark.parametrize(("change", "known"), [(0.07, False), (0.09, True)])
    def test_pitch_is_changed_by_5_degrees(self, change, known):
        for k in (0, 1):
            before = [-0.45, 0.45, None, None]
            now = [p + change * (i == k) if p is not None else None for i, p in enumerate(before)]
            assert slowed(tuple(before), tuple(now)) == known

    @pytest.mark.parametrize(("change", "known"), [(25e-6, False), (35e-6, True)])
    def test_ballast_is_changed_by_30_cm3(self, change, known):
        for k in (2, 3):
            before = (None, None, -2e-4, 2e-4)
            now = tuple(p + change * (i == k) if p is not None else None for i, p in enumerate(before))
            assert slowed(before, now) == known

    @pytest.mark.parametrize(("dive", "climb", "known"), [(25e-6, 31e-6, True), (31e-6, 31e-6, False)])
    def test_30_cm3_more_slow_no_glider(self, dive, climb, known):
        before, now = (-0.45, 0.45, -2e-4, 2e-4), (-0.35, 0.35, -2e-4 - dive, 2e-4 + climb)
        assert slowed(before, now) == known

    @pytest.mark.parametrize(("faster", "n", "new"), [(1.6, 3, True), (1.6, 2, False)])
    def test_three_dives_make_a_new_way_of_flying(self, faster, n, new):
        ways = [Way()] * 12 + [Way(speed=0.23 * faster, own=0.25 * faster)] * n
        flags = self.flown(ways)
        assert (Flag.NORMAL in flags[12:]) == new

    @pytest.mark.parametrize(("apart", "new"), [(1.08, True), (1.16, False)])
    def test_dives_of_a_new_way_agree_to_12_percent(self, apart, new):
        speeds = [1.6, 1.6 * apart, 1.6]
        ways = [Way()] * 12 + [Way(speed=0.23 * f, own=0.25 * f) for f in speeds]
        assert (self.flown(ways)[-1] is Flag.NORMAL) == new

    @pytest.mark.parametrize(("roll", "hints"), [(0.1, 0), (0.14, 1)])
    def test_a_step_of_roll_of_7_degrees(self, roll, hints):
        state = SpeedState()
        for each in mission([Way()] * 8 + [Way(roll=roll)]):
            state, _ = step(state, each, SpeedParams())
        assert state.rolled == hints

    @pytest.mark.parametrize(("roll", "hint"), [(0.18, modes.ROLLED), (0.2, modes.LOST)])
    def test_a_roll_of_11_degrees_is_a_lost_wing(self, roll, hint, monkeypatch):
        hints, real = [], kalman.step
        monkeypatch.setattr(kalman, "step", lambda *a: (hints.append(a[4]), real(*a))[1])
        state = SpeedState()
        for each in mission([Way()] * 8 + [Way(roll=roll)] * 3):
            state, _ = step(state, each, SpeedParams())
        assert hints == [None] * 8 + [hint] * 2 + [None]

    @staticmethod
    def flown(ways: list[Way]) -> list[Flag | None]:
        state, flags = SpeedState(), []
        for each in mission(ways):
            state, found = step(state, each, SpeedParams())
            flags.append(found.flag)
        return flags


class TestReference:
    FIELD = Field(
        readonly([EAST.t_dive - HOUR, EAST.t_surface + HOUR]),
        readonly([0.0, 20.0, 40.0, 80.0]),
        readonly([20.0, 40.0]),
        readonly([-90.0, -70.0]),
        *(np.broadcast_to(np.array([0.0, 0.0, 0.2, 1.0])[:, None, None], (2, 4, 2, 2)) for _ in range(2)),
        "test",
    )

    def test_a_model_is_10_cm_s_off_and_30_m_deep_where_no_depth_is_known(self):
        found = of_model(self.FIELD, known_by(EAST, depth_max=None), EAST.start, EAST.end)
        assert np.sqrt(np.diag(found.cov)) == pytest.approx([0.1, 0.1])
        deep = of_model(self.FIELD, known_by(EAST, depth_max=30.0), EAST.start, EAST.end)
        assert found.current == deep.current
        assert len(found.notes[0]) > len(deep.notes[0])


class TestSeveralDives:
    def test_what_is_remembered_of_forty_dives(self):
        """Steps are looked for over 24 dives, and two older ones; a compass over 8; ranges and ratios rest on
        24 and 12."""
        state = SpeedState()
        for each in mission([Way()] * 40):
            state, _ = step(
                state, known_by(each, depth_rate_dive=0.14, depth_rate_climb=-0.14), SpeedParams()
            )
        assert len(state.filter.bank.score) == 24 + 2
        assert len(state.misfits) == 8
        assert len(state.normal.speeds) == 24
        assert len(state.ratios.vertical) == 12

    def bank(self, innovation: float) -> Bank:
        """After one dive whose four measurements show the four numbers of a step, each to 1 m/s."""
        update = Update(np.eye(4, 6), np.zeros((6, 4)), np.eye(4), np.array([innovation, 0.0, 0.0, 0.0]))
        jump = np.concatenate([np.eye(2), np.zeros((4, 2))])
        return steps(Bank(), np.eye(6), update, jump, JointParams().front, 0.0, 0)[2]

    def test_sizes_of_a_step(self):
        """Slip and side change by 0.5, the flow with them by 0.25 m/s."""
        assert np.linalg.inv(self.unseen().info[0]).diagonal() == pytest.approx([0.25, 0.25, 0.0625, 0.0625])

    def unseen(self) -> Bank:
        update = Update(np.zeros((1, 6)), np.zeros((6, 1)), np.eye(1), np.zeros(1))
        return steps(Bank(), np.eye(6), update, np.zeros((6, 2)), JointParams().front, 0.0, 0)[2]

    def test_no_dive_alone_proves_a_step(self):
        assert np.array_equal(self.bank(4.0).score, self.bank(40.0).score)
        assert not np.array_equal(self.bank(3.9).score, self.bank(40.0).score)

    @pytest.mark.parametrize(("hours", "total"), [(3.0, 0.25), (1.5, 0.125), (6.0, 0.25)])
    def test_an_eighth_of_the_speed_adds_a_quarter(self, hours, total):
        """Healthy gliders vary by 10 %, which does not add; a dive of half the length counts for half."""
        estimate = SimpleNamespace(speed=0.21875, own_sigma=0.001)
        seen = SimpleNamespace(start=0.0, end=hours * HOUR, is_free=False)
        info = SimpleNamespace(seen=seen, estimate=estimate, kinematic_fits=True)
        state, _, _ = verdict._small_losses(SpeedState(), info, SpeedRange(0.2, 0.25, 0.3, 9), SpeedParams())
        assert state.slow == pytest.approx(total)

    @pytest.mark.parametrize(("hidden", "words"), [(0.08, "slower than normal"), (0.12, "wing")])
    def test_a_tenth_of_the_speed_is_hidden_from_the_glider(self, hidden, words):
        info = SimpleNamespace(
            estimate=SimpleNamespace(own_speed=0.25, speed=0.25 * (1 - hidden)),
            seen=SimpleNamespace(slip=0.0),
        )
        assert words in verdict._how_slow(info, SpeedRange(0.2, 0.25, 0.3, 9), SpeedParams())


class TestOpened:
    def explained(self) -> list[modes.Explained]:
        params = JointParams()
        state = kalman.init(params, EAST.t_dive)
        measured = Measured(observe(EAST), None, 1.0, Slipping(0.1, 0.01, None))
        return kalman._explained(state, measured, params, hint=modes.LOST).ways

    def test_a_wrong_measurement_is_left_out(self):
        (wrong,) = (way for way in self.explained() if way.cause is Cause.CURRENT)
        assert wrong.noise[2:, 2:].diagonal().tolist() == [100.0, 100.0]

    def test_a_wing_opens_slip_and_half_of_it_side(self):
        state = kalman.init(JointParams(), 0.0)
        (wing,) = (way for way in self.explained() if way.cause is Cause.WING)
        opened = kalman._cov(state, wing, kalman._jumped(JointParams().flow)) - state.cov
        assert np.sqrt(opened[[SLIP, SIDE], [SLIP, SIDE]]) == pytest.approx([0.27, 0.15])


class TestUpdate:
    """The iterated update of one dive, and the mixture of what it gives under each mode."""

    def measured(self, noise: float = 0.01) -> Measured:
        return Measured(observe(EAST), None, 1.0, Slipping(0.1, noise, None))

    def test_no_glider_flies_below_2_cm_s(self):
        shown = dive_measurement.expected(np.zeros((1, 5)), self.measured())[0][0]
        own = shown[:2] - shown[2:4]  # g - c = W h
        assert np.hypot(*own) == pytest.approx(0.02 * observe(EAST).steadiness)

    def test_a_dive_is_1_percent_off_the_speed(self):
        """With W at 0.3 m/s that is 3 mm/s along the heading, of the current too."""
        x = np.array([[0.0, 0.0, 0.3, 0.0, 0.0]])
        seen = observe(EAST)
        noise = dive_measurement.expected(x, self.measured(JointParams().own_noise))[2][0]
        along = noise[2, 2] - seen.current_sigma**2
        assert math.sqrt(along) == pytest.approx(0.003 * seen.heading[0])

    def test_the_update_is_iterated_twice(self, monkeypatch):
        calls = []

        def counted(*arguments):
            calls.append(arguments)
            return dive_measurement.expected(*arguments)

        monkeypatch.setattr(modes, "expected", counted)
        TestOpened().explained()
        assert len(calls) == 2

    def test_a_speed_that_none_can_fly_speaks_against_a_mode(self, monkeypatch):
        """By the square of what is beyond, in 2 cm/s."""
        odds = []
        for beyond in (modes.BEYOND, 1.0, 1e9):
            monkeypatch.setattr(modes, "BEYOND", beyond)
            weights = {way.cause: way.weight for way in self.backwards()}
            odds.append(math.log(weights[Cause.USUAL] / weights[Cause.GROUND]))
        assert (odds[0] - odds[2]) / (odds[1] - odds[2]) == pytest.approx(1 / 0.02**2, rel=1e-3)
        assert odds[0] < odds[2]

    def backwards(self) -> list[modes.Explained]:
        """A glider whose ground velocity and current have it fly backwards, at 3 cm/s."""
        seen = observe(dive(0, Way(heading=0.0, own=-0.03, speed=-0.03)))
        x, cov = np.array([0.05, 0.02, 0.05, 0.0, 0.0]), np.diag([1e-2, 1e-2, 4e-4, 1e-4, 1e-4])
        steps_of_flow = np.diag([1.0, 1.0, 0.0, 0.0, 0.0])
        measured = Measured(seen, None, 1.0, Slipping(0.0, 0.01, None))
        return modes.explain(x, cov, steps_of_flow, measured, MODES)

    @pytest.mark.parametrize(("weight", "counts"), [(0.007, False), (0.015, True)])
    def test_a_mode_of_less_than_a_percent_is_left_out(self, weight, counts):
        state = kalman.init(JointParams(), 0.0)
        usual, speed, *_ = TestOpened().explained()
        ways = [replace(usual, weight=1 - weight), replace(speed, weight=weight)]
        steps_of_flow = kalman._jump(JointParams().flow)
        alone, _ = kalman._mixed(state, ways[:1], steps_of_flow)
        assert (kalman._mixed(state, ways, steps_of_flow)[0].tolist() != alone.tolist()) is counts


class TestAlgorithmOfThePaper:
    @pytest.mark.parametrize(("hours", "stands_in"), [(11.9, True), (12.1, False)])
    def test_a_current_stands_in_for_12_hours(self, hours, stands_in):
        state = adaptive.Learner(current=EAST.current, current_t=EAST.t_surface - hours * HOUR)
        assert adaptive._reference(state, replace(EAST, current=None))[1] == stands_in

    def test_it_warms_up_for_three_time_constants(self):
        p = adaptive.learner_params(GliderParams())
        assert adaptive.warm_up(GliderParams()) == pytest.approx(3 * p.k / p.rate_of_speed)

    @pytest.mark.parametrize(("sigmas", "apart"), [(3.9, False), (4.1, True)])
    def test_flow_and_reference_are_four_standard_errors_apart(self, sigmas, apart):
        found = SimpleNamespace(flow=np.zeros(2), flow_cov=np.eye(2) * 0.75)
        other = Reference(Current(sigmas, 0.0, final=True), np.eye(2) * 0.25)
        assert glider._apart(found, other) == apart


class TestSureness:
    @pytest.mark.parametrize(("sigma", "blamed"), [(0.0291, Blame.CURRENT), (0.0330, Blame.UNCLEAR)])
    def test_a_current_is_blamed_where_a_turn_of_the_compass_fits_worse_by_six(self, sigma, blamed):
        """Of these two the chi-squares are 9 and 0 with one more number, and 7 and 0."""
        row = []
        for angle in np.radians([0.0, 47.0, 0.0, 47.0]):
            aside = np.array([-math.sin(angle), math.cos(angle)])
            row.append(Misfit(0.25, float(aside @ [-0.25, 0.3]), sigma, float(angle)))
        assert blame(tuple(row), gate=4.0, least=0.05) is blamed

    @pytest.mark.parametrize(("below", "is_slow"), [(0.60, False), (0.75, True)])
    def test_a_second_dive_that_rolls_is_slow_from_two_thirds_of_a_standard_error_on(self, below, is_slow):
        estimate = SimpleNamespace(speed=0.2 - 0.01 * below, own_speed=0.25, own_sigma=0.01, sigma=0.02)
        seen = SimpleNamespace(is_free=False, unseen=0.0, slip=1.0, start=0.0, end=600.0)
        info = SimpleNamespace(
            estimate=estimate, seen=seen, single_sigma=0.01, kinematic_fits=False, proven=None, causes={}
        )
        normal = SpeedRange(0.2, 0.25, 0.3, 20)
        params = speed_params(GliderParams())
        _, flag, _ = verdict._slow_or_fast(SpeedState(rolled=2), info, None, normal, params)
        assert (flag is Flag.ANOMALY) == is_slow

    @pytest.mark.parametrize(("sigma", "by_rates"), [(0.036, False), (0.039, True)])
    def test_where_the_fixes_leave_15_percent_open_depth_rate_and_pitch_tell_a_new_way(self, sigma, by_rates):
        flatter = SimpleNamespace(features=DiveFeatures(duration=3 * HOUR, pitch_dive=-0.3, pitch_climb=0.3))
        info = SimpleNamespace(estimate=SimpleNamespace(speed=0.25, own_sigma=sigma), kinematic_fits=True)
        state = SpeedState(trim=(-0.45, 0.45, None, None))
        rates = KinematicSpeed(0.2, 0.01, 0.01, is_prompt=True)
        params = speed_params(GliderParams())
        after, flag, _, _ = verdict._regime(
            state, flatter, info, rates, SpeedRange(0.2, 0.25, 0.3, 20), Flag.NORMAL, "", params
        )
        assert bool(after.other) == by_rates
        assert flag is Flag.NORMAL

    @pytest.mark.parametrize(("sigma", "learns"), [(0.074, True), (0.076, False)])
    def test_a_dive_whose_own_speed_is_sure_to_30_percent_tells_the_ratio_to_what_is_reported(
        self, sigma, learns
    ):
        flown = SimpleNamespace(
            features=DiveFeatures(duration=3 * HOUR, onboard_speed=0.25, surfacing_unseen=True)
        )
        seen = SimpleNamespace(is_free=False, own_speed=lambda: (0.25, sigma))
        info = SimpleNamespace(seen=seen, proven=None)
        configured = SpeedRange(0.15, 0.45, 0.75, 0)
        after = verdict._learnt(
            SpeedState(), flown, info, Drive(0.0), configured, speed_params(GliderParams())
        )
        assert bool(after.ratios.onboard) == learns

    @pytest.mark.parametrize(
        ("speed", "dives", "teaches"), [(0.21, 5, True), (0.19, 5, False), (0.19, 0, True)]
    )
    def test_a_dive_below_the_learnt_range_does_not_make_its_speed_usual(self, speed, dives, teaches):
        """Though it is not surely below; one below a configured range does."""
        seen = SimpleNamespace(is_free=False, own_speed=lambda: None)
        info = SimpleNamespace(seen=seen, proven=None, estimate=SimpleNamespace(speed=speed))
        flown = SimpleNamespace(features=DiveFeatures(duration=3 * HOUR))
        normal = SpeedRange(0.2, 0.25, 0.33, dives)
        after = verdict._learnt(SpeedState(), flown, info, Drive(0.0), normal, speed_params(GliderParams()))
        assert bool(len(after.normal.speeds)) == teaches


@pytest.mark.parametrize(("widths", "is_kept"), [(5.5, True), (6.5, False)])
def test_a_function_six_widths_behind_is_let_go(widths, is_kept):
    params = GliderParams()
    centre = from_plane((1000.0, widths * params.learner.sigma), 36.0, -70.0)
    state = SimpleNamespace(learner=init(0.3, 1), centres=readonly(np.array([centre])))
    track = SimpleNamespace(x=np.array([[0.0, 0.0], [1000.0, 0.0]]))
    _, centres, _ = adaptive._covering(state, track, Fix(0.0, 36.0, -70.0), params)
    assert bool((np.abs(centres - centre).max(axis=1) < 1e-9).any()) == is_kept
