"""The heuristics of the rules do what their page says: each case lies just on one side of a bound."""

from dataclasses import replace

import pytest

from alert_support import DISAGREE, SLOW, incident
from dives_by_letters import Talk as Announcer
from dives_by_letters import World, dive
from gliderwatch.incidents import aborts, calls
from gliderwatch.incidents.acknowledgement import acknowledge
from gliderwatch.incidents.constants import PLACES
from gliderwatch.incidents.facts import situation
from gliderwatch.incidents.irregularities import irregularities
from gliderwatch.incidents.notices import Unjudged
from gliderwatch.incidents.overdue import (
    ExpectedCall,
    Sign,
    expected_call,
    first_call,
    guess,
    is_at_sea,
    margin,
    outlook,
    rhythm,
)
from gliderwatch.incidents.send_schedule import next_reminder
from gliderwatch.incidents.state_machine import is_severe
from gliderwatch.incidents.unjudged import blindness
from gliderwatch.incidents.whereabouts import drift
from gliderwatch.model import Call, Fix, Happened, Happening, Kind, NextSurfacing, Severity, Unusable
from gliderwatch.navigation.clock import ClockStep
from gliderwatch.params import Attention
from gliderwatch.pipeline import GliderState, Outcome
from gliderwatch.store.state_file import Store
from silent import DAY, HOUR, INTERVAL, MARGIN, T0, Clock, Sea, expected

DUE = T0 + INTERVAL + MARGIN


def files(n: int, apart: float, first: float = T0) -> list[Sign]:
    """Files that come one after another, each open until the next."""
    return [Sign(first + k * apart, first + (k + 1) * apart, first + (k + 1) * apart) for k in range(n)]


class TestIncidents:
    def test_less_than_two_thirds_of_the_lower_bound_is_severe(self):
        low = SLOW.speed_min
        assert not is_severe(replace(SLOW, speed=0.70 * low))
        assert is_severe(replace(SLOW, speed=0.63 * low))

    def test_one_dive_is_severe_two_standard_errors_below_the_range(self):
        slow = replace(SLOW, speed=0.11, speed_min=0.2)
        assert is_severe(replace(slow, evidence={**SLOW.evidence, "speed_sigma": 0.04}))
        assert not is_severe(replace(slow, evidence={**SLOW.evidence, "speed_sigma": 0.05}))

    @pytest.mark.parametrize("speed, cleared", [(0.245, False), (0.255, True)])
    def test_an_anomaly_is_over_half_way_back_to_the_usual_speed(self, speed, cleared):
        again = {"speed": speed, "speed_min": 0.2, "evidence": {**SLOW.evidence, "usual_speed": 0.3}}
        made = [dive(k, "1") for k in range(3)] + [dive(k, "0", **again) for k in range(3, 8)]
        (found,) = World({one.t_dive: one for one in made}).incidents()
        assert (found.cleared_at is not None) == cleared

    @pytest.mark.parametrize(
        "speed, sigma, cleared", [(0.26, 0.055, True), (0.26, 0.065, False), (0.301, 0.5, True)]
    )
    def test_it_is_over_by_a_standard_error_or_at_the_usual_speed(self, speed, sigma, cleared):
        numbers = {**SLOW.evidence, "usual_speed": 0.3, "speed_sigma": sigma}
        again = {"speed": speed, "speed_min": 0.2, "evidence": numbers}
        made = [dive(k, "1") for k in range(3)] + [dive(k, "0", **again) for k in range(3, 8)]
        (found,) = World({one.t_dive: one for one in made}).incidents()
        assert (found.cleared_at is not None) == cleared

    @pytest.mark.parametrize(
        "across, sigma, cleared",
        [(-0.033, 0.01, False), (0.027, 0.01, True), (0.033, 0.018, True), (0.033, 0.0155, False)],
    )
    def test_measurements_disagree_until_half_of_the_misfit_is_gone(self, across, sigma, cleared):
        was = {**DISAGREE.evidence, "across_misfit": 0.06}
        now = {**DISAGREE.evidence, "across_misfit": across, "across_sigma": sigma}
        made = [dive(k, "2", evidence=was) for k in range(3)]
        made += [dive(k, "0", evidence=now) for k in range(3, 8)]
        (found,) = World({one.t_dive: one for one in made}).incidents()
        assert (found.cleared_at is not None) == cleared

    @pytest.mark.parametrize(
        ("was", "now", "sigma", "cleared"),
        [
            (0.2, 0.11, 0.02, False),
            (0.2, 0.09, 0.02, True),
            (0.2, 0.11, 0.06, True),
            (0.14, 0.13, 0.02, True),
        ],
    )
    def test_a_compass_is_off_until_half_of_that_is_gone(self, was, now, sigma, cleared):
        """One of 0.18 rad, and three standard errors of as much, was told and taken back by turns."""
        calm = {"across_misfit": 0.0, "across_sigma": 0.01}
        before = {**DISAGREE.evidence, **calm, "side": -was}
        after = {**DISAGREE.evidence, **calm, "side": -now, "side_sigma": sigma}
        made = [dive(k, "2", evidence=before) for k in range(3)]
        made += [dive(k, "0", evidence=after) for k in range(3, 8)]
        (found,) = World({one.t_dive: one for one in made}).incidents()
        assert (found.cleared_at is not None) == cleared

    @pytest.mark.parametrize(("letter", "why"), [("1", "were near the usual speed"), ("2", "agreed")])
    @pytest.mark.parametrize(("normal", "is_back"), [(4, True), (22, True), (30, False)])
    def test_what_is_back_within_three_days_is_called_that(self, letter, why, normal, is_back):
        talk, letters = Announcer(), letter * 4 + "0" * normal + letter * 4
        for k in range(1, len(letters) + 1):
            talk.update(letters[:k])
        first, second = (a for a in talk.alerts if a.kind in (Kind.ANOMALY, Kind.FALSE_ALARM))
        assert "is back" not in first.body
        assert ("is back: dives until 1970-01-0" in second.body and why in second.body) == is_back

    @pytest.mark.parametrize("slower, holds", [(0.04, True), (0.055, False)])
    def test_an_anomaly_has_grown_worse_by_5_cm_s(self, slower, holds):
        ack = acknowledge(incident(replace(SLOW, speed=0.19, speed_min=0.2)), "ann", "", T0)
        worse = incident(replace(SLOW, speed=0.19 - slower, speed_min=0.2))
        assert ack.holds(worse) == holds

    @pytest.mark.parametrize("more, holds", [(0.08, True), (0.12, False)])
    def test_measurements_disagree_worse_by_a_tenth(self, more, holds):
        ack = acknowledge(incident(replace(DISAGREE, p_e=0.5), kind=Kind.FALSE_ALARM), "ann", "", T0)
        assert ack.holds(incident(replace(DISAGREE, p_e=0.5 + more), kind=Kind.FALSE_ALARM)) == holds


class TestAnnouncements:
    @pytest.mark.parametrize("hours, count", [(22, 1), (26, 0)])
    def test_an_incident_that_was_over_for_a_day_is_history(self, hours, count):
        world = World.of("01100")
        last = dive(5, "0", t_dive=dive(4, "0").t_surface, t_surface=dive(4, "0").t_surface + hours * HOUR)
        cleared = next(i.cleared_at for i in world.incidents())
        last = replace(last, t_surface=cleared + hours * HOUR)
        assert len(Announcer().update(World({**world.dives, last.t_dive: last}))) == count

    @pytest.mark.parametrize("back, kinds", [(7, ["regime"]), (8, ["regime"]), (9, [])])
    def test_a_new_way_of_flying_is_news_eight_dives_later(self, back, kinds):
        """Of dives of an hour, which all came together."""
        made = [dive(k, "0", t_dive=k * HOUR, t_surface=k * HOUR + 3000.0) for k in range(12)]
        made[11 - back] = replace(made[11 - back], evidence={**made[11 - back].evidence, "usual_before": 0.3})
        assert Announcer().update(World({one.t_dive: one for one in made})) == kinds

    @pytest.mark.parametrize("age, following", [(0.15, 1.0), (0.25, 2.0)])
    def test_a_reminder_comes_a_fifth_of_a_day_sooner_at_most(self, age, following):
        assert next_reminder(age) == following

    def test_a_reminder_comes_each_week_in_the_end(self):
        assert [next_reminder(days) for days in (7.0, 14.0)] == [14.0, 21.0]

    def test_a_message_names_the_speeds_of_five_dives(self):
        assert len(situation(World.of("0" * 12)).speeds) == 5

    def corrections(self, **changes) -> list[str]:
        """What is said when the last dive of an open incident is known better."""
        talk, world = Announcer(), World.of("011")
        assert talk.update(world) == ["anomaly"]
        last = max(world.dives)
        return talk.update(World({**world.dives, last: replace(world.dives[last], **changes)}))

    def test_a_speed_is_corrected_by_5_cm_s(self):
        assert self.corrections(speed=0.15 - 0.04) == []
        assert self.corrections(speed=0.15 - 0.06) == ["correction"]

    def test_so_is_a_reference_flow(self):
        u = dive(0, "1").reference_u
        assert self.corrections(reference_u=u + 0.04) == []
        assert self.corrections(reference_u=u + 0.06) == ["correction"]

    @pytest.mark.parametrize("late, of_its_time", [(800.0, True), (1000.0, False)])
    def test_a_message_a_quarter_of_an_hour_late_speaks_of_now(self, late, of_its_time):
        clock = Clock(Sea().call(T0 - INTERVAL).call(T0))
        assert clock.at(DUE + late) == ["overdue"]
        assert clock.alerts[0].time == (DUE if of_its_time else DUE + late)


class TestOverdue:
    def test_a_healthy_glider_is_three_hours_late_with_a_call_of_forty_minutes(self):
        assert margin(expected(t=T0 + HOUR), (), T0, None) == 3 * HOUR + 2400.0

    def test_three_standard_errors_are_waited(self):
        assert margin(expected(t=T0 + HOUR, t_sigma=2 * HOUR), (), T0, None) == 6 * HOUR + 2400.0

    def test_a_second_message_comes_after_two_margins(self):
        assert ExpectedCall(0.0, 0.0, 10.0, 5.0).stage(2) == 40.0

    @pytest.mark.parametrize("minutes, found", [(18, False), (22, True)])
    def test_files_within_twenty_minutes_are_of_one_call(self, minutes, found):
        assert (rhythm(files(6, 60.0 * minutes), T0 + DAY) is not None) == found

    def test_the_last_eight_files_tell_the_rhythm(self):
        """Of seven intervals four decide, which are those between five files."""
        signs = [*files(20, HOUR, T0 - 20 * HOUR), *files(5, 3 * HOUR)]
        assert rhythm(signs, T0 + 5 * DAY) == 3 * HOUR
        assert rhythm([*files(20, HOUR, T0 - 20 * HOUR), *files(4, 3 * HOUR)], T0 + 5 * DAY) == HOUR

    @pytest.mark.parametrize("times, counts", [(2.8, True), (3.2, False)])
    def test_three_intervals_from_file_to_file_were_a_silence(self, times, counts):
        e = expected(t=T0 + 6 * HOUR)
        apart = times * 6 * HOUR
        found = margin(e, files(5, apart, T0 - 5 * apart), T0, None)
        assert found == pytest.approx((apart if counts else 6 * HOUR) + 2400.0)

    def test_a_guess_is_half_an_interval_unsure(self):
        found = guess(files(6, 2 * HOUR), T0 + DAY)
        assert found.t_sigma == HOUR

    def test_what_comes_a_quarter_of_an_interval_later_is_another_call(self):
        call = ExpectedCall(T0, T0 + 4 * HOUR, DUE, 4 * HOUR)
        for minutes, heard in ((55, False), (65, True)):
            t = T0 + 60.0 * minutes
            sign = Sign(t - 4 * HOUR, t, t)
            assert (first_call(call, [sign], None, T0 + DAY) is not None) == heard

    def test_a_sign_half_an_interval_after_the_surfacing_puts_the_next_call_off(self):
        e = expected(t=T0 + 4 * HOUR)
        for minutes, put_off in ((110, False), (130, True)):
            t = T0 + 60.0 * minutes
            call = expected_call(e, [Sign(t - 4 * HOUR, t, t)], T0 + 3 * HOUR, None)
            assert call.t == (t + 4 * HOUR if put_off else e.t)


class TestDeployment:
    @pytest.mark.parametrize("days, at_sea", [(1.9, True), (2.1, False)])
    def test_a_file_that_is_two_days_old_when_it_comes_is_no_news(self, days, at_sea):
        assert is_at_sea([Sign(T0, T0 + HOUR, T0 + HOUR + days * DAY)], 0.0, T0 + 3 * DAY) == at_sea

    @pytest.mark.parametrize("days, at_sea", [(29, True), (31, False)])
    def test_after_a_month_of_silence_it_is_over(self, days, at_sea):
        assert is_at_sea([Sign(T0, T0, T0)], INTERVAL, T0 + days * DAY) == at_sea

    def test_files_opened_32_days_ago_are_looked_at(self):
        """One may be open for two days, and so be a sign of the last thirty."""
        sea = Sea().call(T0)
        opened = [T0 - days * DAY for days in (31.5, 32.5)]
        sea.files = [Sign(t, t, t) for t in opened] + sea.files
        found = outlook(sea, T0)
        assert found is not None and [s.opened_at in opened for s in found[1]] == [True, False]


class TestDrift:
    def minor(self, flow, hours: float = 1.0) -> float:
        point = expected(east=0.0, cross=0.0, north=0.0)
        return drift(point, None, flow, point.t + hours * HOUR).minor

    def test_at_first_the_current_is_unsure_by_15_cm_s(self):
        assert self.minor((0.0, 0.0)) == pytest.approx(2.4477 * 0.15 * HOUR, rel=0.02)

    def test_a_current_that_is_not_known_by_twice_as_much(self):
        assert self.minor(None) == pytest.approx(2 * self.minor((0.0, 0.0)))


class Unseen(Sea):
    """A glider none of whose dives are judged."""

    lost: tuple[Unjudged, ...] = ()
    apart = 6 * HOUR

    def expected(self, until: float) -> NextSurfacing | None:
        return NextSurfacing(T0, T0 + self.apart, 60.0, None, None, 0.0, 0.0, 0.0, "")

    def judged(self, until: float) -> float | None:
        return None

    def unjudged(self, since: float) -> tuple[Unjudged, ...]:
        return self.lost


class TestUnknown:
    def blind(self, spans, interval: float, attention: Attention) -> bool:
        """Whether it is said that these times (h) cannot be judged."""
        sea = Unseen()
        sea.apart = interval
        sea.lost = tuple(
            Unjudged(T0 + a * HOUR, T0 + b * HOUR, Unusable.NO_HEADING, "no heading") for a, b in spans
        )
        end = T0 + spans[-1][1] * HOUR
        sea.files = [Sign(end - HOUR, end, end)]
        return blindness(sea, attention, end) is not None

    @pytest.mark.parametrize("hours, said", [(19.0, False), (21.0, True)])
    def test_two_intervals_between_surfacings_are_waited(self, hours, said):
        """Ten hours each: the fix that ends a dive comes with the file after it."""
        attention = Attention(unknown_hours=6.0, unknown_dives=None)
        assert self.blind([(0.0, hours)], 10 * HOUR, attention) == said

    @pytest.mark.parametrize("pause, said", [(22.0, True), (26.0, False)])
    def test_a_day_without_anything_separates_deployments(self, pause, said):
        attention = Attention(unknown_hours=None, unknown_dives=2)
        assert self.blind([(0.0, 3.0), (3.0 + pause, 6.0 + pause)], HOUR, attention) == said

    @pytest.mark.parametrize("minutes, said", [(14, False), (16, True)])
    def test_less_than_a_quarter_of_an_hour_is_no_dive(self, minutes, said):
        attention = Attention(unknown_hours=None, unknown_dives=1)
        assert self.blind([(0.0, minutes / 60)], HOUR, attention) == said


class TestCalls:
    def call(self, began: float, lasts: float = 600.0, **more) -> Call:
        return Call("unit", "log", began, began + lasts, over=True, mission="m.mi", mission_t=began, **more)

    @pytest.mark.parametrize(("apart", "reports"), [(0.45 * HOUR, 1), (0.55 * HOUR, 2)])
    def test_two_lines_within_half_an_hour_are_of_one_abort(self, apart, reports):
        twice = tuple(Happened(Happening.ABORTING, T0 + t, "LEAK") for t in (0.0, apart))
        assert len(aborts.reports_in_calls([self.call(T0, happened=twice)])) == reports

    @pytest.mark.parametrize(("pause", "count"), [(5.8 * HOUR, 1), (6.2 * HOUR, 2)])
    def test_calls_of_one_fix_are_of_one_surfacing_for_six_hours(self, pause, count):
        fix = Fix(T0, 24.0, -83.0)
        both = [self.call(T0, fix=fix), self.call(T0 + 600.0 + pause, fix=fix)]
        assert len(calls.surfacings(both)) == count

    def test_one_call_without_a_file_is_news_and_the_second_a_warning(self):
        one, other = self.call(T0), self.call(T0 + 3 * HOUR)
        state, (first,) = calls.announce("unit", None, (one,), (), T0 + 2 * HOUR)
        state, (second,) = calls.announce("unit", state, (one, other), (), T0 + 5 * HOUR)
        assert [first.severity, second.severity] == [Severity.INFO, Severity.WARNING]
        third = self.call(T0 + 6 * HOUR)
        assert calls.announce("unit", state, (one, other, third), (), T0 + 8 * HOUR)[1] == []


class TestFiles:
    def places(self, *norths: float) -> list[Fix]:
        """Places that follow each other in no time, by their metres to the north."""
        return [Fix(T0 + k, 24.0 + north / 111e3, -83.0) for k, north in enumerate(norths)]

    def found(self, *norths: float) -> int:
        return len(irregularities("unit", [], self.places(*norths)))

    def test_three_times_there_and_back_are_two_gliders(self):
        assert (self.found(0, 9e3, 0, 9e3), self.found(0, 9e3, 0, 9e3, 0)) == (0, 1)

    def test_places_nearer_than_5_km_are_of_one_glider(self):
        assert (self.found(*[0, 4.7e3] * 4), self.found(*[0, 5.3e3] * 4)) == (0, 1)

    @pytest.mark.parametrize(("step", "count"), [(2.9 * HOUR, 0), (3.1 * HOUR, 1)])
    def test_a_clock_that_was_set_by_three_hours_is_reported(self, step, count):
        assert len(irregularities("unit", [ClockStep("unit", "u-2023-1-1-1", T0, step, step)], [])) == count

    def test_two_gliders_are_looked_for_among_the_last_twelve_surfacings(self):
        store = Store.open(":memory:")
        dives = tuple(replace(SLOW, t_dive=T0 + k * HOUR, t_surface=T0 + (k + 1) * HOUR) for k in range(20))
        store.apply("electa", Outcome(GliderState(), T0, dives, (), None))
        assert len(store.facts("electa").places(PLACES)) == 12

    @pytest.mark.parametrize(("later", "missing"), [(0.9 * HOUR, []), (1.1 * HOUR, ["01030033.scd"])])
    def test_a_file_that_was_announced_has_come_an_hour_later_or_does_not(self, later, missing):
        store, call = Store.open(":memory:"), Call("unit", "log", T0, T0 + 60.0, announced=("01030033.scd",))
        with store.transaction():
            store.calls.keep("/logs/log", call, "", T0)
        assert [name for _, name in store.facts("unit").not_come(T0 - 1.0, T0 + 60.0 + later)] == missing

    @pytest.mark.parametrize(("later", "reason"), [(0.45 * HOUR, "behavior surface_2"), (0.55 * HOUR, "")])
    def test_a_call_within_half_an_hour_says_why_a_glider_came_up(self, later, reason):
        store, began = Store.open(":memory:"), T0 + later
        with store.transaction():
            store.calls.keep(
                "/logs/log", Call("unit", "log", began, began, reason="behavior surface_2"), "", T0
            )
        assert store.facts("unit").came_up(T0) == reason
