"""When a glider is overdue, where it may be, and what is told of it."""

from dataclasses import replace
from itertools import pairwise
from math import hypot

import pytest

from alert_support import incident
from gliderwatch.incidents.notices import Fleet
from gliderwatch.incidents.overdue import (
    FRESH,
    GONE,
    ExpectedCall,
    Sign,
    expected_call,
    first_call,
    fleet,
    guess,
    is_at_sea,
    margin,
)
from gliderwatch.incidents.whereabouts import drift
from gliderwatch.model import Severity
from gliderwatch.navigation.geodesy import to_plane
from silent import CALL, DAY, HOUR, INTERVAL, MARGIN, T0, Clock, Sea, expected

DUE = T0 + INTERVAL + MARGIN
ALONE = Fleet()


class TestMargin:
    def test_one_missed_surfacing_and_its_call(self):
        assert margin(expected(t=T0 + 6 * HOUR), (), T0, None) == 6 * HOUR + 2400

    def test_never_below_three_hours_and_a_call(self):
        assert margin(expected(t=T0 + 0.5 * HOUR), (), T0, None) == 3 * HOUR + 2400

    def test_three_standard_errors_where_the_time_is_unsure(self):
        assert margin(expected(t_sigma=2 * HOUR), (), T0, None) == 6 * HOUR + 2400

    def test_from_file_to_file_where_that_is_more(self):
        """The time at the surface, and each second file lost; but not a long silence."""
        for gap, told in ((6.5, 6.5), (13.0, 13.0), (40.0, 6.0)):
            signs = [Sign(T0 - k * gap * HOUR, T0, T0) for k in range(5)]
            assert margin(expected(t=T0 + 6 * HOUR), signs, T0, None) == told * HOUR + 2400
        assert margin(expected(t=T0 + 6 * HOUR), signs[:2], T0, None) == 6 * HOUR + 2400

    def test_as_configured_and_nothing_else(self):
        assert margin(expected(t_sigma=2 * HOUR), (), T0, 0.5) == 0.5 * HOUR


class TestSignOfLife:
    def test_a_whole_file_is_as_old_as_its_last_sample(self):
        assert Sign(0.0, 11000.0, 99999.0).sent_at(INTERVAL) == 11000.0

    def test_a_file_that_is_not_read_was_sent_an_interval_after_its_opening(self):
        assert Sign(0.0, None, 99999.0).sent_at(INTERVAL) == INTERVAL

    def test_so_was_one_that_breaks_off(self):
        assert Sign(0.0, 60.0, 99999.0).sent_at(INTERVAL) == INTERVAL

    @pytest.mark.parametrize("last_t", [None, 60.0, 1e12])
    def test_never_after_it_came(self, last_t):
        """Also if the glider's clock is years ahead."""
        assert Sign(0.0, last_t, 500.0).sent_at(INTERVAL) == 500.0


class TestAwaited:
    def test_the_call_expected(self):
        assert expected_call(expected(), [], T0, None) == ExpectedCall(T0, T0 + INTERVAL, DUE, INTERVAL)

    def test_the_end_of_the_last_call_does_not_put_the_next_off(self):
        call = expected_call(expected(), [Sign(T0 - INTERVAL, T0 + CALL, T0 + CALL)], DUE, None)
        assert (call.last_sign, call.due) == (T0 + CALL, DUE)

    def test_a_file_that_waits_for_its_cache_does(self):
        call = expected_call(expected(), [Sign(T0 + CALL, None, DUE - 1)], DUE, None)
        assert call.last_sign == T0 + CALL + INTERVAL and call.due == DUE + CALL + INTERVAL

    def test_a_file_of_later_is_not_known_yet(self):
        call = expected_call(
            expected(), [Sign(T0 + 4 * HOUR, T0 + 7 * HOUR, T0 + 7 * HOUR)], T0 + 5 * HOUR, None
        )
        assert call.last_sign == T0

    def test_old_files_that_come_late_are_no_sign_of_life(self):
        call = expected_call(
            expected(), [Sign(T0 - 5 * DAY, None, DUE), Sign(T0 - DAY, T0 - DAY, DUE)], DUE, None
        )
        assert (call.last_sign, call.due) == (T0, DUE)

    def test_it_becomes_overdue_at_growing_intervals(self):
        call = ExpectedCall(T0, T0, T0 + 10, INTERVAL)
        assert [call.stage(k) - T0 for k in range(4)] == [10, 20, 40, 80]
        assert [call.stages(T0 + s) for s in (9.9, 10, 19, 20, 79, 80)] == [0, 1, 1, 2, 3, 4]


class TestGuess:
    """A glider none of whose dives can be used."""

    FILES = tuple(Sign(T0 + k * INTERVAL, T0 + (k + 1) * INTERVAL, T0 + (k + 1) * INTERVAL) for k in range(9))

    def test_as_far_apart_as_its_files_were_opened(self):
        found = guess(self.FILES, T0 + 10 * INTERVAL)
        assert found is not None and (found.after, found.t) == (T0 + 9 * INTERVAL, T0 + 10 * INTERVAL)
        assert found.lat is None and found.t_sigma > 0

    def test_short_files_at_the_surface_do_not_count(self):
        short = [Sign(s.opened_at - 600.0, s.opened_at, s.opened_at) for s in self.FILES]
        found = guess((*self.FILES, *short), T0 + 10 * INTERVAL)
        assert found is not None and found.t - found.after == pytest.approx(INTERVAL - 600)

    def test_as_known_at_a_time(self):
        found = guess(self.FILES, T0 + 5.5 * INTERVAL)
        assert found is not None and found.after == T0 + 5 * INTERVAL

    def test_too_few_say_nothing(self):
        assert guess(self.FILES[:2], T0 + 10 * INTERVAL) is None

    def test_it_is_missed_all_the_same(self):
        clock = Clock(Sea(files=list(self.FILES)))
        assert clock.at(T0 + 10 * INTERVAL + INTERVAL) == []
        assert clock.at(T0 + 10 * INTERVAL + 1.5 * INTERVAL + 2400) == ["overdue"]
        assert "Where it is, is not known" in clock.alerts[0].body

    def test_not_before_it_was_launched(self):
        """Files of the deck and of the dock, all read, and not a dive in them."""
        sea = Sea(files=list(self.FILES), dived=False)
        assert Clock(sea).at(T0 + 20 * INTERVAL) == []
        sea.call(T0 + 9 * INTERVAL, read=False)
        assert Clock(sea).at(T0 + 20 * INTERVAL) == ["overdue"]


class TestFirstCall:
    CALL = ExpectedCall(T0 + CALL, T0 + INTERVAL, DUE, INTERVAL)

    def test_none(self):
        assert first_call(self.CALL, [Sign(T0 - INTERVAL, T0, T0)], None, DUE) is None

    def test_the_first_of_all(self):
        files = [Sign(T0 + 7 * HOUR, T0 + 9 * HOUR, T0 + 9 * HOUR), Sign(T0 + HOUR, None, T0 + 5 * HOUR)]
        assert first_call(self.CALL, files, T0 + 8 * HOUR, T0 + DAY) == T0 + 4 * HOUR

    def test_a_surfacing_sooner_than_usual_is_one(self):
        assert first_call(self.CALL, [], T0 + CALL + 60, T0 + DAY) == T0 + CALL + 60

    def test_what_the_last_call_left_is_none(self):
        """A short file of the stay at the surface, sent a little later."""
        assert first_call(self.CALL, [Sign(T0, T0 + 1.5 * CALL, T0 + 1.5 * CALL)], None, DUE) is None

    def test_not_of_the_future(self):
        assert first_call(self.CALL, [], DUE + 60, DUE) is None


class TestAtSea:
    def test_while_files_come_as_they_are_sent(self):
        assert is_at_sea([Sign(T0, T0 + HOUR, T0 + 2 * HOUR)], INTERVAL, T0 + 20 * DAY)

    def test_not_after_a_month(self):
        assert not is_at_sea([Sign(T0, T0, T0)], INTERVAL, T0 + GONE)

    def test_not_with_an_archive(self):
        assert not is_at_sea([Sign(T0, T0 + HOUR, T0 + 20 * DAY)], INTERVAL, T0 + 20 * DAY)

    def test_not_with_files_that_are_days_old_when_they_come(self):
        t = T0 + HOUR
        assert is_at_sea([Sign(T0, t, t + FRESH - 1)], 0.0, t + FRESH)
        assert not is_at_sea([Sign(T0, t, t + FRESH)], 0.0, t + FRESH)


class TestFleet:
    def others(self, *late: bool):
        then = {True: T0, False: T0 + 6 * HOUR}
        return [(expected(then[x]), (Sign(then[x] - HOUR, then[x], then[x]),)) for x in late]

    def test_who_is_late(self):
        found = fleet(self.others(True, False, True), T0 + 7 * HOUR)
        assert found == Fleet(3, 2, T0 + 6 * HOUR) and not found.is_silent

    def test_all_of_them(self):
        assert fleet(self.others(True, True), T0 + 7 * HOUR).is_silent

    def test_a_fleet_of_one_says_nothing(self):
        assert fleet([], T0) == Fleet() and not Fleet().is_silent

    def test_who_is_ashore_does_not_count(self):
        assert fleet(self.others(True, True), T0 + GONE + DAY) == Fleet()


class TestDrift:
    FLOW = (0.3, -0.4)
    HOME = (30.0, -80.05)

    def area(self, hours: float, flow=FLOW, **changes):
        e = expected(**changes)
        found = drift(e, self.HOME, flow, e.t + hours * HOUR)
        assert found is not None
        return found

    def test_the_middle_goes_with_the_current_from_where_it_was_expected(self):
        area = self.area(2.0)
        x = to_plane(area.lat, area.lon, 30.0, -80.0)
        assert x == pytest.approx([0.3 * 7200, -0.4 * 7200], abs=1.0)

    def test_it_grows(self):
        sizes = [self.area(h) for h in (0.0, 1.0, 6.0, 24.0, 72.0)]
        for a, b in pairwise(sizes):
            assert a.major < b.major and a.minor < b.minor

    def test_its_growth_is_that_of_a_current_which_changes(self):
        """Far from the start: like 0.15 m/s times the time while that is short; slower than it later."""
        point = {"east": 0.0, "cross": 0.0, "north": 0.0}
        home = drift(expected(**point), None, self.FLOW, T0 + INTERVAL + HOUR)
        assert home is not None
        assert home.minor == pytest.approx(2.448 * 0.15 * HOUR, rel=0.02)
        later = drift(expected(**point), None, self.FLOW, T0 + INTERVAL + 300 * HOUR)
        assert later is not None and later.minor < 0.5 * 2.448 * 0.15 * 300 * HOUR

    def test_at_first_it_is_that_of_the_expected_place(self):
        area = drift(expected(east=9e6, north=1e6), None, None, T0 + INTERVAL)
        assert area is not None
        assert (area.major, area.minor) == pytest.approx((2448 * 3, 2448), rel=1e-3)
        assert area.bearing == pytest.approx(90.0)

    def test_the_bearing_is_clockwise_from_north(self):
        area = drift(expected(east=4e6, north=4e6, cross=3e6), None, None, T0 + INTERVAL)
        assert area is not None and area.bearing == pytest.approx(45.0)

    def test_it_reaches_to_where_the_glider_would_be_had_it_never_dived(self):
        area = self.area(0.0, flow=(0.0, 0.0), east=1.0, north=1.0)
        away = hypot(*to_plane(*self.HOME, 30.0, -80.0))
        assert area.major == pytest.approx(away, rel=0.01) and area.bearing == pytest.approx(90.0, abs=1.0)

    def test_without_a_current_it_is_larger(self):
        assert self.area(6.0, flow=None).minor > 1.5 * self.area(6.0, flow=(0.0, 0.0)).minor

    def test_without_an_expected_place_it_drifts_from_the_last_fix(self):
        area = drift(expected(lat=None, lon=None), self.HOME, (0.1, 0.0), T0 + 10 * HOUR)
        assert area is not None
        assert to_plane(area.lat, area.lon, *self.HOME) == pytest.approx([3600, 0], abs=1.0)

    def test_without_any_position_there_is_none(self):
        assert drift(expected(lat=None, lon=None), None, (0.1, 0.0), T0) is None


class TestSilence:
    def clock(self, **changes) -> Clock:
        return Clock(Sea(**changes).call(T0 - INTERVAL).call(T0))

    def test_quiet_until_it_is_due(self):
        assert [self.clock().at(DUE - 1), self.clock().at(DUE)] == [[], ["overdue"]]

    def test_it_grows_louder_and_rarer(self):
        clock = self.clock()
        hours = [h / 4 for h in range(12 * 24) if clock.at(T0 + h * HOUR / 4)]
        assert hours == [6.75, 10.5, 17.75, 32.5, 61.75]
        assert [a.severity for a in clock.alerts] == [Severity.WARNING] + [Severity.CRITICAL] * 4
        assert [str(a.kind) for a in clock.alerts] == ["overdue"] + ["reminder"] * 4
        assert [a.time for a in clock.alerts[:2]] == [DUE, T0 + INTERVAL + 2 * MARGIN]
        assert len({a.id for a in clock.alerts}) == 5 and len({a.incident for a in clock.alerts}) == 1

    def test_it_clears_when_the_glider_calls(self):
        clock = self.clock()
        clock.at(DUE)
        clock.at(T0 + INTERVAL + 2 * MARGIN)
        clock.sea.call(T0 + 13 * HOUR)
        assert clock.at(T0 + 14 * HOUR) == ["all_clear"]
        assert clock.at(T0 + 14 * HOUR) == []
        told = clock.alerts[-1]
        assert (told.time, told.severity, told.audience) == (
            T0 + 13 * HOUR,
            Severity.INFO,
            Severity.CRITICAL,
        )
        assert "after 12.8 h" in told.title and told.incident == clock.alerts[0].incident

    def test_who_only_got_the_warning_gets_the_end(self):
        clock = self.clock()
        clock.at(DUE)
        clock.sea.call(DUE + 60)
        clock.at(DUE + HOUR)
        assert clock.alerts[-1].audience == Severity.WARNING

    def test_a_file_that_cannot_be_read_clears_it(self):
        clock = self.clock()
        clock.at(DUE)
        clock.sea.call(DUE + HOUR, read=False)
        assert clock.at(DUE + 2 * HOUR) == ["all_clear"]

    def test_files_of_before_do_not(self):
        clock = self.clock()
        clock.at(DUE)
        clock.sea.call(T0 - 5 * INTERVAL, at=DUE + 60).call(T0 - INTERVAL, at=DUE + 60, read=False)
        assert clock.at(DUE + HOUR) == []

    def test_a_call_in_time_whose_files_came_late_is_a_correction(self):
        clock = self.clock()
        clock.at(DUE)
        clock.sea.call(T0 + INTERVAL, at=DUE + HOUR)
        assert clock.at(DUE + HOUR) == ["correction"]
        assert "in time" in clock.alerts[-1].title and clock.alerts[-1].time == DUE + HOUR

    def test_a_file_that_comes_as_the_call_ends_did_not_come_late(self):
        """It surfaced 2 min before it was overdue, its file came 5 min later: it was late itself."""
        clock = self.clock()
        clock.at(DUE)
        clock.sea.call(DUE - 120, at=DUE + 180)
        clock.sea.files[-1] = replace(clock.sea.files[-1], last_t=DUE - 120)
        assert clock.at(DUE + 180) == ["all_clear"]
        assert "came late" not in clock.alerts[-1].body
        assert clock.at(DUE + 2 * HOUR) == []

    def test_what_has_called_by_then_is_not_still_overdue(self):
        clock = self.clock()
        clock.at(DUE)
        second = T0 + INTERVAL + 2 * MARGIN
        clock.sea.call(second - HOUR)
        assert clock.at(second) == ["all_clear"]
        assert clock.alerts[-1].time == second - HOUR

    def test_its_all_clear_says_what_is_still_open(self):
        clock = self.clock()
        clock.at(DUE)
        clock.sea.open = (incident(),)
        clock.sea.call(DUE + HOUR)
        assert clock.at(DUE + 2 * HOUR) == ["all_clear"]
        assert "But not all is well: the anomaly since 2022" in " ".join(clock.alerts[-1].body.split())

    def test_newest_first(self):
        """The newest file says that it is over, the older ones that it never was."""
        clock = self.clock()
        clock.at(DUE)
        said = []
        for k in (4, 3, 2, 1):
            clock.sea.call(T0 + k * INTERVAL, at=T0 + 13 * HOUR)
            said += clock.at(T0 + 13 * HOUR)
        assert said == ["all_clear", "correction"]

    def test_silent_again_is_another_silence(self):
        clock = self.clock()
        clock.at(DUE)
        clock.sea.call(DUE + HOUR)
        clock.at(DUE + 2 * HOUR)
        assert clock.at(DUE + HOUR + INTERVAL + MARGIN + CALL) == ["overdue"]
        assert len({a.incident for a in clock.alerts}) == 2

    def test_told_once_after_a_week_off(self):
        clock = self.clock()
        assert clock.at(T0 + 7 * DAY) == ["overdue"]
        assert clock.at(T0 + 7 * DAY + 60) == []
        assert clock.alerts[0].severity == Severity.CRITICAL and "silent for 7.0 days" in clock.alerts[0].body
        assert clock.alerts[0].time == T0 + 7 * DAY

    def test_not_for_a_deployment_that_is_over(self):
        assert self.clock().at(T0 + 31 * DAY) == []
        clock = self.clock()
        clock.at(T0 + 29 * DAY)
        assert clock.at(T0 + 60 * DAY) == []

    def test_not_for_an_archive(self):
        sea = Sea()
        for k in range(10):
            sea.call(T0 - k * INTERVAL, at=T0 + 10 * DAY)
        assert [Clock(sea).at(T0 + d * DAY) for d in (10, 11, 20)] == [[], [], []]

    def test_ended_silences_are_let_go_of(self):
        clock = self.clock()
        for _ in range(6):
            t = clock.sea.surfacings[-1]
            clock.at(t + INTERVAL + MARGIN + CALL)
            clock.sea.call(t + 14 * DAY)
        assert len(clock.alerts) > 9 and len(clock.silences) < 5


class TestMessage:
    def told(self, fleet: Fleet = ALONE, **changes):
        clock = Clock(Sea(**changes).call(T0 - INTERVAL).call(T0))
        clock.at(DUE, fleet)
        return clock.alerts[0]

    def test_it_says_since_when_where_and_where_to_look(self):
        body = self.told().body
        for words in (
            "silent for 6.4 h",
            "Silent since: 2023-11-14 22:28 UTC",
            "Expected: 2023-11-15 01:13 UTC at 30° 00.000' N",
            "Last position: 30° 00.000' N, 080° 03.000' W",
            "Search here: ",
            "Map: https://www.openstreetmap.org/",
            "95 % within ",
            "drifts 0.23 m/s towards 041° true",
            "no incident was open before",
        ):
            assert words in body, words

    def test_an_open_incident_speaks_for_trouble(self):
        body = self.told(open=(incident(),)).body
        assert "anomaly open since" in body and "no incident was open" not in body

    def test_one_that_was_cleared_does_not(self):
        assert "anomaly open" not in self.told(open=(incident(cleared_at=T0),)).body

    def test_gliders_that_call_speak_for_trouble(self):
        body = self.told(Fleet(3, 1, T0)).body
        trouble, harmless = (
            body.index("2 of 3 other gliders call as expected"),
            body.index("1 of 3 other gliders are late"),
        )
        assert trouble < body.index("Against") < harmless
        assert "dockserver and modem first" not in body

    def test_a_silent_fleet_is_the_shore_side(self):
        told = self.told(Fleet(2, 2, T0))
        first = "Look at dockserver and modem first: all 2 other gliders are silent as well"
        assert first in told.body
        assert "no file of any of them since 2023-11-14 22:13 UTC" in told.body
        assert told.title == "electa OVERDUE 3.7 h, all 3 silent: dockserver?"

    def test_a_hostile_name_is_text(self):
        told = self.told(glider="<b>x</b>\r\nBcc: y")
        assert "<b>x" not in told.html and "\n" not in told.title and "\r" not in told.body

    def test_nothing_known_of_the_place(self):
        class Nowhere(Sea):
            def expected(self, until):
                e = super().expected(until)
                return e and replace(e, lat=None, lon=None)

            def last_surfacing(self, until):
                return None

        clock = Clock(Nowhere().call(T0 - INTERVAL).call(T0))
        clock.at(DUE)
        assert "Where it is, is not known" in clock.alerts[0].body and "Map" not in clock.alerts[0].body
