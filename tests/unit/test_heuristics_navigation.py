"""The heuristics of navigation do what their page says: each case lies just on one side of a bound."""

from dataclasses import replace

import numpy as np
import pytest

from gliderwatch.model import Call, Current, DiveFeatures, Fix, Segment, SegmentId, Series, Unusable, readonly
from gliderwatch.navigation.call_fixes import missing_in_file
from gliderwatch.navigation.clock import DAY, ROLLOVER, Stamp, corrections, forward_step, is_same
from gliderwatch.navigation.dac import Report, new_reports, pair, updated
from gliderwatch.navigation.dives import Navigation, extend, flight_notes, unsteered, why_unusable
from gliderwatch.navigation.features import flight_features
from gliderwatch.navigation.fixes import new_fixes, zeroed
from gliderwatch.navigation.flight import (
    Flight,
    _dead_reckoned_headings,
    downsample,
    find_flight,
    lengthened,
    prepare,
)
from gliderwatch.navigation.geodesy import from_plane
from gliderwatch.navigation.track import build_track, closure
from missions import LAT, LON, Leg, mission, segment, series

H = 3600.0
FLIGHT = Flight(0.0, 10_000.0, "depth")
START = Fix(0.0, LAT, LON)


def north(t: float, metres: float) -> Fix:
    return Fix(t, *from_plane((0.0, metres), LAT, LON))


def positions(*fixes: Fix) -> dict:
    return {
        "fix_lat": series([(f.t, f.lat) for f in fixes]),
        "fix_lon": series([(f.t, f.lon) for f in fixes]),
    }


def course(times, degrees) -> dict:
    """Headings (degrees, true) at times, one for all or one each."""
    rad = np.radians(np.broadcast_to(degrees, np.shape(times)))
    return {
        "heading_e": series(list(zip(times, np.sin(rad), strict=True))),
        "heading_n": series(list(zip(times, np.cos(rad), strict=True))),
    }


def reckoned(times, speed: float = 0.3) -> dict:
    """Dead-reckoned positions to the north, from the start of the flight."""
    fixes = [north(t, speed * t) for t in times]
    return {
        "dr_lat": series([(f.t, f.lat) for f in fixes]),
        "dr_lon": series([(f.t, f.lon) for f in fixes]),
    }


class TestFixes:
    def test_a_drift_of_five_knots_is_possible_and_one_of_seven_is_not(self):
        """Two fixes five minutes apart; of two that contradict each other the later one counts."""
        for speed, count in ((2.6, 2), (3.6, 1)):
            stay = positions(north(9000.0, 0.0), north(9300.0, 300 * speed))
            assert len(new_fixes(stay, north(0.0, 5000.0))) == count

    def test_fixes_contradict_each_other_within_ten_minutes(self):
        """After that there may have been a dive in between; the wild speed is judged elsewhere."""
        for apart, count in ((500.0, 1), (700.0, 2)):
            far = positions(north(9000.0, 0.0), north(9000.0 + apart, 9000.0))
            assert len(new_fixes(far, north(0.0, 5000.0))) == count

    def test_one_fix_within_errors_of_the_receiver_from_the_last_one_is_suspect(self):
        for metres, count in ((25.0, 0), (35.0, 1)):
            assert len(new_fixes(positions(north(9000.0, metres)), START)) == count


class TestFlight:
    @pytest.mark.parametrize("depth, dives", [(2.5, False), (4.0, True)])
    def test_waves_push_a_glider_two_metres_down_and_not_four(self, depth, dives):
        found = find_flight({"depth": series([(t, depth) for t in range(0, 3600, 60)])}, -1.0, 3600.0)
        assert (found is not None) == dives

    @pytest.mark.parametrize("pitch, dives", [(0.15, False), (0.25, True)])
    def test_a_glider_glides_at_14_degrees_and_lies_at_8(self, pitch, dives):
        found = find_flight({"pitch": series([(t, pitch) for t in range(0, 3600, 60)])}, -1.0, 3600.0)
        assert (found is not None) == dives

    @pytest.mark.parametrize("steep, dives", [(4, False), (7, True)])
    def test_more_than_half_of_the_pitches_of_a_flight_are_steep(self, steep, dives):
        """Four in ten are waves, seven in ten are a dive with its turns."""
        pitch = [0.4 if k % 10 < steep else 0.0 for k in range(100)]
        found = find_flight({"pitch": series(list(enumerate(pitch)))}, -1.0, 100.0)
        assert (found is not None) == dives

    def test_ten_minutes_between_shallow_depths_are_no_dive(self):
        for apart, dives in ((550.0, False), (650.0, True)):
            depth = [(0.0, 0.0), (apart, 0.1), (2 * apart, 0.2)]
            steep = {"depth": series(depth), "pitch": series([(apart / 2, 0.4), (1.5 * apart, -0.4)])}
            assert (find_flight(steep, 0.0, 2 * apart) is not None) == dives

    def test_what_is_not_seen_for_ten_minutes_lengthens_a_flight(self):
        for later, longer in ((550.0, False), (650.0, True)):
            depth = {"depth": series([(FLIGHT.end, 9.0), (FLIGHT.end + later, 0.0)])}
            assert (lengthened(FLIGHT, depth, 2e4, ()) != FLIGHT) == longer

    @pytest.mark.parametrize("rate, dives", [(0.3, False), (0.7, True)])
    def test_the_time_of_dead_reckoning_grows_with_the_clock(self, rate, dives):
        """Not to the second, as both are sampled; at the surface it stands still."""
        found = find_flight({"dr_time": series([(t, rate * t) for t in range(0, 3600, 60)])}, -1.0, 3600.0)
        assert (found is not None) == dives


class TestDives:
    def dive(self, seconds: float):
        return extend(Navigation(), mission([Leg(hours=seconds / H)])[0])

    @pytest.mark.parametrize("seconds, has_current", [(100, False), (150, True)])
    def test_a_dip_of_two_minutes_has_a_current_of_its_own(self, seconds, has_current):
        """It is no dive to judge, but the current that comes after it is not that of the dive before."""
        up = north(140.0 + seconds, 50.0)
        seen = {"depth": [(100.0 + t, 9.0) for t in range(0, seconds + 1, 10)]}
        seen |= {"fix_lat": [(up.t, up.lat)], "fix_lon": [(up.t, up.lon)]}
        state, dives = extend(Navigation(fix=Fix(90.0, LAT, LON), last_t=95.0), segment("b", 95.0, seen))
        assert (state.pending is not None) == has_current and dives == []

    @pytest.mark.parametrize("minutes, count", [(10, 0), (15, 1)])
    def test_a_dive_lasts_a_quarter_of_an_hour(self, minutes, count):
        _, dives = self.dive(60.0 * minutes)
        assert len(dives) == count

    @pytest.mark.parametrize("minutes, holes", [(12, 0), (18, 1)])
    def test_a_quarter_of_an_hour_without_a_file_is_a_hole(self, minutes, holes):
        """Before that the glider calls, or waits for its pilot."""
        state = Navigation(fix=START, last_t=1000.0)
        state, _ = extend(state, segment("b", 1000.0 + 60 * minutes, {}))
        assert len(state.holes) == holes

    @pytest.mark.parametrize("minutes, missing", [(50, False), (70, True)])
    def test_an_hour_without_data_may_hide_a_dive(self, minutes, missing):
        state = Navigation(fix=START, last_t=60.0)
        end = 60.0 + 60 * minutes
        there = {"fix_lat": [(end + 10, north(0.0, 900.0).lat)], "fix_lon": [(end + 10, LON)]}
        _, dives = extend(state, segment("b", end, there))
        assert [d.unusable for d in dives] == [Unusable.DATA_MISSING] * missing

    @pytest.mark.parametrize("beside, withdrawn", [(80.0, False), (150.0, True)])
    def test_a_fix_that_the_next_contradicts_was_old(self, beside, withdrawn):
        """The first fix of the next file, 1 min later, is further away than 3 m/s and 100 m of errors."""
        state, (dive,) = self.dive(2 * H)
        last = state.fix
        fix = Fix(last.t + 60, *from_plane((0.0, 180.0 + beside), last.lat, last.lon))
        late = {"fix_lat": [(fix.t, fix.lat)], "fix_lon": [(fix.t, fix.lon)]}
        assert dive.end is not None
        state = replace(state, dive=replace(dive, end=last))
        _, dives = extend(state, segment("b", fix.t, late))
        assert (Unusable.STALE_FIX in [d.unusable for d in dives]) == withdrawn

    @pytest.mark.parametrize("days, own", [(2.8, True), (3.2, False)])
    def test_the_gliders_declination_holds_for_three_days(self, days, own):
        state = Navigation(declination=0.1, declination_t=0.0)
        state, _ = extend(state, segment("b", days * 86400, {}, declination=0.2, source="WMM"))
        assert (state.declination == 0.1) == own


class TestCurrents:
    def test_a_current_comes_two_minutes_before_the_last_sample_at_most(self):
        reports = [Report(t, 0.1, 0.0, False) for t in (890.0, 870.0)]
        assert pair(reports, [1000.0]) == [0, -1]

    @pytest.mark.parametrize("t, corrected", [(550.0, False), (650.0, True)])
    def test_a_first_value_ten_minutes_after_the_surfacing_is_a_corrected_one(self, t, corrected):
        assert updated(None, Report(t, 0.1, 0.0, False), 0.0) == Current(0.1, 0.0, corrected)

    @pytest.mark.parametrize("more, count", [(0.8e-6, 1), (1.2e-6, 2)])
    def test_a_current_with_other_digits_is_the_same(self, more, count):
        east = [(0.0, 0.1), (10.0, 0.1 + more)]
        reports, _ = new_reports(
            segment("a", 0.0, {"current_x": east, "current_y": [(0.0, 0.0), (10.0, 0.0)]}), 0.0, (None, None)
        )
        assert len(reports) == count


class TestUnusable:
    SAMPLES = course(np.arange(0.0, 10_001.0, 100.0), 0.0)

    def why(self, samples=None, flight=FLIGHT, end=10_000.0, missing=0.0, metres=3000.0):
        samples = self.SAMPLES if samples is None else samples
        return why_unusable(samples, flight, START, north(end, metres), missing)[0]

    def test_a_quarter_of_the_data_may_be_missing(self):
        assert self.why(missing=2400.0) is None
        assert self.why(missing=2600.0) is Unusable.DATA_MISSING

    def test_half_of_the_time_may_be_drift(self):
        assert self.why(end=19_000.0) is None
        assert self.why(end=21_000.0) is Unusable.SURFACE_DRIFT

    def test_faster_than_any_current_over_ground_is_a_wild_fix(self):
        assert self.why(metres=28_000.0) is None
        assert self.why(metres=32_000.0) is Unusable.WILD_FIX

    def test_eight_tenths_of_a_flight_on_a_steady_course_may_lack_headings(self):
        assert unsteered(course([0.0, 50.0, 7900.0, 9000.0], 0.0), FLIGHT)[0] is None
        assert unsteered(course([0.0, 50.0, 8200.0, 9000.0], 0.0), FLIGHT)[0] is Unusable.NO_HEADING

    @pytest.mark.parametrize("gap, usable", [(3500.0, True), (3700.0, False)])
    def test_an_hour_without_a_heading_is_too_long_for_a_glider_that_turns(self, gap, usable):
        times = np.concatenate([np.arange(0.0, 3001.0, 500.0), np.arange(3000.0 + gap, 10_001.0, 500.0)])
        assert (
            unsteered(course(times, np.where(np.arange(len(times)) % 2, 60.0, -60.0)), FLIGHT)[0] is None
        ) == usable

    @pytest.mark.parametrize("turn, steady", [(22.0, True), (30.0, False)])
    def test_a_course_is_steady_within_25_degrees(self, turn, steady):
        times = np.concatenate([np.arange(0.0, 3001.0, 500.0), np.arange(7000.0, 10_001.0, 500.0)])
        aside = np.where(np.arange(len(times)) % 2, turn, -turn)
        assert (unsteered(course(times, aside), FLIGHT)[0] is None) == steady

    @pytest.mark.parametrize("length, noted", [(0.45, True), (0.55, False)])
    def test_a_glider_that_turned_much_is_noted(self, length, noted):
        features = DiveFeatures(duration=H, heading_steadiness=length)
        assert any("turned much" in note for note in flight_notes(FLIGHT, features)) == noted


class TestTrack:
    END = north(10_000.0, 3000.0)
    HEADINGS = course(np.arange(0.0, 10_001.0, 500.0), np.where(np.arange(21) < 10, 90.0, 270.0))

    def uses(self, own: dict) -> bool:
        """Whether positions reckoned to the north shape a track whose headings say east, and then west."""
        track = build_track(self.HEADINGS | own, FLIGHT, START, self.END)
        return bool(np.abs(track.x[:, 0]).max() < 100.0)

    @pytest.mark.parametrize("times, used", [([200, 1900, 3600], False), ([200, 1400, 2500, 3600], True)])
    def test_four_positions_shape_a_track(self, times, used):
        track = build_track(self.HEADINGS | reckoned(times), Flight(0.0, 4000.0, "depth"), START, self.END)
        assert (np.abs(track.x[:, 0]).max() < 100.0) == used

    def test_they_cover_eight_tenths_of_the_flight(self):
        assert self.uses(reckoned(np.arange(0.0, 8300.0, 500.0)))
        assert not self.uses(reckoned(np.arange(0.0, 7700.0, 500.0)))

    def test_they_are_half_an_hour_or_a_fifth_of_the_flight_apart(self):
        """In this flight a fifth is 2000 s."""
        assert self.uses(reckoned([0.0, 1900.0, 3800.0, 5700.0, 7600.0, 9500.0]))
        assert not self.uses(reckoned([0.0, 2200.0, 4400.0, 6600.0, 8800.0]))

    @pytest.mark.parametrize("jump, used", [(80.0, True), (130.0, False)])
    def test_a_jump_beyond_a_drift_of_three_metres_a_second_is_a_fix(self, jump, used):
        """Two positions a second apart: 3 m and 100 m of errors are allowed."""
        times = [*np.arange(0.0, 8501.0, 500.0), 9000.0, 9001.0]
        fixes = [north(t, 0.3 * t) for t in times[:-1]] + [north(9001.0, 2700.0 + jump)]
        own = {
            "dr_lat": series([(f.t, f.lat) for f in fixes]),
            "dr_lon": series([(f.t, f.lon) for f in fixes]),
        }
        assert self.uses(own) == used

    def test_without_a_reported_speed_a_glider_is_taken_to_fly_at_0_3(self):
        """East for the first half, then north: the shape is that of the speed, the end is the fix."""
        times = np.arange(0.0, 10_001.0, 500.0)
        headings = course(times, np.where(times < 5000.0, 90.0, 0.0))
        there = Fix(10_000.0, *from_plane((1500.0, 1500.0), LAT, LON))
        track = build_track(headings, FLIGHT, START, there)
        middle = track.x[int(np.argmin(np.abs(track.t - 5000.0)))]
        assert middle == pytest.approx([1500.0, 0.0], abs=60.0)

    @pytest.mark.parametrize("turns, closes", [(83.0, True), (85.5, False)])
    def test_a_mean_heading_below_a_tenth_is_no_direction(self, turns, closes):
        """Headings to both sides of north by 83 degrees have a mean of 0.12, by 85.5 of 0.08."""
        times = np.arange(0.0, 10_001.0, 10.0)
        aside = np.where(np.arange(len(times)) // 50 % 2, turns, -turns)
        track = build_track(course(times, aside), FLIGHT, START, self.END)
        assert (closure(track, Current(0.0, 0.0, True)) is not None) == closes


class TestFeatures:
    def features(self, **quantities) -> DiveFeatures:
        return flight_features({name: series(list(v)) for name, v in quantities.items()}, FLIGHT)

    def test_a_thruster_that_draws_24_watts_is_fully_on(self):
        for watts, setting in ((24.0, 1.0), (6.0, 0.5), (2.9, 0.35)):
            made = prepare(segment("a", 0.0, {"thruster_power": [(0.0, watts)]}), 0.0)
            assert made["thruster_on"].v[0] == pytest.approx(setting, abs=0.005)

    def test_three_samples_say_how_much_the_thruster_was_on(self):
        two, three = ([(float(t), 0.5) for t in range(n)] for n in (2, 3))
        assert self.features(thruster_on=two).thruster is None
        assert self.features(thruster_on=three).thruster == 0.5

    def test_a_pitch_of_six_degrees_is_a_glide_and_less_a_turn(self):
        made = self.features(pitch=[(0.0, -0.08), (1.0, -0.12), (2.0, 0.12), (3.0, 0.08)])
        assert (made.pitch_dive, made.pitch_climb) == pytest.approx((-0.12, 0.12))

    def test_a_pump_that_moved_less_than_20_cc_is_on_its_way(self):
        moves = [-15e-6, -25e-6, -25e-6, -25e-6, 15e-6, 25e-6, 25e-6, 25e-6]
        made = self.features(ballast=enumerate(moves))
        assert (made.ballast_dive, made.ballast_climb) == (-25e-6, 25e-6)
        slow = self.features(ballast=enumerate([-15e-6] * 5 + [15e-6] * 5))
        assert (slow.ballast_dive, slow.ballast_climb) == (None, None)

    def test_four_depths_half_an_hour_apart_say_how_deep_it_was(self):
        deepest = [self.features(depth=[(1000.0 * k, 10.0 * k) for k in range(n)]).depth_max for n in (3, 4)]
        assert deepest == [None, 30.0]
        gaps = [self.features(depth=[(gap * k, 9.0) for k in range(4)]).depth_max for gap in (1700.0, 1900.0)]
        assert gaps == [9.0, None]

    @staticmethod
    def yo(n: int, step: float, rate: float):
        """`n` depths: down for half of them, and up again."""
        return [(step * k, 10.0 + rate * step * min(k, n - 1 - k)) for k in range(n)]

    def test_six_depths_say_how_fast_it_sank_and_rose(self):
        for n, rates in ((5, None), (6, 0.1)):
            made = self.features(depth=self.yo(n, 200.0, 0.1))
            assert made.depth_rate_dive == (None if rates is None else pytest.approx(rates))

    def test_depths_five_minutes_apart_may_have_a_turn_between_them(self):
        for step, known in ((280.0, True), (320.0, False)):
            assert (self.features(depth=self.yo(8, step, 0.1)).depth_rate_climb is not None) == known

    def test_two_centimetres_a_second_are_no_dive(self):
        for rate, known in ((0.015, False), (0.025, True)):
            assert (self.features(depth=self.yo(8, 200.0, rate)).depth_rate_dive is not None) == known

    def test_two_rates_tell_a_median(self):
        """One descent between two samples, or two, and then a long climb."""
        one = [(0.0, 10.0), (100.0, 30.0), *((100.0 * k, 32.0 - 2.5 * (k - 1)) for k in range(2, 8))]
        two = [(0.0, 10.0), (100.0, 30.0), (200.0, 50.0), *((100.0 * k, 52.0 - 2.5 * k) for k in range(3, 9))]
        assert self.features(depth=one).depth_rate_dive is None
        assert self.features(depth=two).depth_rate_dive == pytest.approx(0.2)


class TestClock:
    def offset(self, gap: float) -> float:
        """The correction (s) of a segment that opens `gap` s after the end of the one before."""
        stamps = [Stamp(0, 0.0, 3 * H), Stamp(1, 3 * H + gap, 6 * H + gap)]
        return corrections(stamps)[1].offset

    def test_a_minute_of_overlap_is_no_step(self):
        assert self.offset(-50.0) == 0.0 and self.offset(-70.0) > 0.0

    def test_a_step_of_no_whole_hours_leaves_a_pause_of_a_minute(self):
        assert self.offset(-2000.0) == 2060.0

    @pytest.mark.parametrize(("pause", "step"), [(850.0, H), (950.0, H - 950.0 + 60.0)])
    def test_a_step_in_hours_leaves_a_pause_of_a_quarter_at_most(self, pause, step):
        assert self.offset(pause - H) == step

    @pytest.mark.parametrize(("pause", "step"), [(3500.0, DAY), (3700.0, 23 * H)])
    def test_a_step_in_days_leaves_one_of_an_hour_at_most(self, pause, step):
        assert self.offset(pause - DAY) == step

    @pytest.mark.parametrize(("silent", "is_rollover"), [(55 * DAY, True), (65 * DAY, False)])
    def test_a_rollover_is_known_over_two_months_of_silence(self, silent, is_rollover):
        assert (self.offset(silent - ROLLOVER) == ROLLOVER) == is_rollover

    @pytest.mark.parametrize(("step", "found"), [(3500.0, 0.0), (3700.0, 3700.0)])
    def test_a_clock_that_is_set_forward_by_less_than_an_hour_looks_like_a_long_call(self, step, found):
        opened = 3 * H + 60.0 + step
        fixes = Fix(3 * H - 10.0, LAT, LON), Fix(opened + 10.0, LAT, LON)
        after = SegmentId(opened, "unit", "unit-2023-318-0-1")
        assert forward_step("unit-2023-318-0-0", 3 * H, fixes[0], after, fixes[1]) == found

    def longer(self, n: int, times: float) -> list[float]:
        """The corrections of `n` segments, the second of which seems to last so many times as long."""
        stamps = [Stamp(k, k * (3 * H + 200.0), k * (3 * H + 200.0) + 3 * H) for k in range(n)]
        stamps[1] = replace(stamps[1], last_t=stamps[1].opened_at + times * 3 * H)
        return [each.offset for each in corrections(stamps)]

    def test_four_segments_say_how_long_one_may_be(self):
        assert any(self.longer(3, 5.0)) and not any(self.longer(4, 5.0))

    def test_one_of_twice_the_length_has_a_wild_end(self):
        assert any(self.longer(5, 1.9)) and not any(self.longer(5, 2.1))

    @pytest.mark.parametrize(("apart", "same"), [(110.0, True), (130.0, False)])
    def test_files_of_one_name_that_open_two_minutes_apart_are_of_two_segments(self, apart, same):
        a, b = (SegmentId(t, "unit", "unit-2023-318-0-1") for t in (0.0, apart))
        assert is_same(a, b) == same


class TestZero:
    def shown(self, *depths: float, after: float = 0.0) -> float:
        """What a depth sensor shows at the surface, by depths each second from so long `after` a fix on."""
        samples = {"depth": series([(after + k, z) for k, z in enumerate(depths)])}
        return zeroed(samples, [START], 0.0)[1]

    def test_depths_within_half_a_minute_of_a_fix_are_of_the_surface(self):
        assert self.shown(5, 5, 5, after=26.0) == 5.0 and self.shown(5, 5, 5, after=32.0) == 0.0

    def test_less_than_2_m_is_the_sea(self):
        assert self.shown(1.9, 1.9, 1.9) == 0.0 and self.shown(2.1, 2.1, 2.1) == pytest.approx(2.1)

    def test_three_depths_say_it(self):
        assert self.shown(5, 5) == 0.0 and self.shown(5, 5, 5) == 5.0

    def test_more_than_15_m_is_an_old_fix(self):
        assert self.shown(14, 14, 14) == 14.0 and self.shown(16, 16, 16) == 0.0

    def test_a_quarter_of_the_depths_is_shallower(self):
        assert self.shown(4, 5, 6, 7, 8) == 5.0


def test_what_the_science_computer_sends_is_kept_each_ten_seconds():
    kept = downsample({"temperature": Series(readonly(np.arange(60.0)), readonly(np.arange(60.0)))})
    assert kept["temperature"].t.tolist() == [4.5, 14.5, 24.5, 34.5, 44.5, 54.5]


@pytest.mark.parametrize(("later", "found"), [(1700.0, True), (1900.0, False)])
def test_a_fix_in_a_call_within_half_an_hour_is_of_the_surfacing_of_the_file(later, found):
    file = Segment(SegmentId(0.0, "sim", "sim-2026-1-1-1"), "m", "sbd", 7200.0, (0, 1, ""), {})
    surfaced = Fix(7200.0 + later, LAT, LON)
    call = Call("sim", "log", surfaced.t, surfaced.t + 60.0, surfaced=surfaced)
    assert missing_in_file(file, [call], np.inf).fix == (surfaced if found else None)


@pytest.mark.parametrize(
    ("dt", "speed", "n"),
    [
        (9.0, 0.3, 0),
        (11.0, 0.3, 1),
        (3500.0, 0.3, 1),
        (3700.0, 0.3, 0),
        (600.0, 0.025, 0),
        (600.0, 0.035, 1),
        (600.0, 1.4, 1),
        (600.0, 1.6, 0),
    ],
)
def test_dead_reckoned_positions_tell_a_heading_ten_seconds_to_an_hour_apart_on_a_flight(dt, speed, n):
    lat, lon = zip((LAT, LON), from_plane((0.0, speed * dt), LAT, LON), strict=True)
    both = {
        "dr_lat": Series(readonly([0.0, dt]), readonly(lat)),
        "dr_lon": Series(readonly([0.0, dt]), readonly(lon)),
    }
    assert len(_dead_reckoned_headings(both)[0]) == n
