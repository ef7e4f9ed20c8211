"""What is due to be said, when, and what is never said twice."""

from dataclasses import replace

import pytest

from dives_by_letters import HOUR, STEP, Talk, World, dive
from gliderwatch.incidents.constants import NEWS, SETTLES
from gliderwatch.incidents.notifications import NotificationState, settled_changes
from gliderwatch.incidents.overdue import ExpectedCall, Silence
from gliderwatch.model import Kind, NextSurfacing, Severity, Unusable


def test_nothing_known_nothing_said():
    talk = Talk(notices=True)
    assert talk.update("") == [] and talk.notified == NotificationState()


def test_an_incident_from_its_opening_to_its_end():
    talk = Talk()
    notified = [talk.update("01100"[:n]) for n in range(1, 6)]
    assert notified == [[], [], ["anomaly"], [], ["all_clear"]]
    assert [a.id for a in talk.alerts] == ["electa/anomaly/10800/0", "electa/anomaly/10800/1"]
    assert {a.incident for a in talk.alerts} == {"electa/anomaly/10800"}


def test_the_same_knowledge_leads_to_nothing_more():
    talk = Talk(notices=True)
    assert talk.update("0110") == ["anomaly", "surfacing"]
    notified = talk.notified
    assert talk.update("0110") == [] and talk.notified == notified


def test_one_fault_whose_interpretation_changes_is_one_thread_that_says_why():
    talk = Talk()
    talk.update("022")
    talk.update("02211")
    assert [(a.kind.value, a.severity, a.audience) for a in talk.alerts] == [
        ("false_alarm", Severity.WARNING, Severity.WARNING),
        ("anomaly", Severity.CRITICAL, Severity.CRITICAL),
    ]
    assert len({a.incident for a in talk.alerts}) == 1
    body = " ".join(talk.alerts[-1].body.split())
    assert (
        "The disagreement of measurements since 1970-01-01 03:00 UTC is now more likely this, because" in body
    )
    assert talk.update("02211") == [] and talk.update("0221100") == ["all_clear"]


def test_what_disagreed_before_an_anomaly_of_which_all_come_at_once_is_no_message_of_its_own():
    assert Talk().update("02211") == ["anomaly"]


def test_whoever_got_the_alarm_gets_its_end():
    talk = Talk()
    for letters in ("011", "01100"):
        talk.update(letters)
    assert [a.audience for a in talk.alerts] == [Severity.CRITICAL, Severity.CRITICAL]


class TestReminders:
    def test_they_come_in_the_time_of_the_data(self):
        talk = Talk(reminder_hours=24.0)
        kinds = {n: talk.update("0" + "1" * n) for n in range(2, 40)}
        reminded = [n for n, notified in kinds.items() if notified == ["reminder"]]
        assert kinds[2] == ["anomaly"] and reminded == [10, 18, 34]  # after 1, 2 and 4 days of 8 dives

    @pytest.mark.parametrize(
        ("messages", "called", "reminded"),
        [
            (3, 6.0 * HOUR, [18, 34]),
            (2, 6.0 * HOUR, [10, 18, 34]),
            (3, None, [10, 18, 34]),
            (3, 1.0 * HOUR, [10, 18, 34]),
        ],
    )
    def test_that_of_a_day_was_the_reminder_of_the_silence_in_which_it_began(
        self, messages, called, reminded
    ):
        """A net holds a glider down for half a day: it is overdue, and slow when it has come up."""
        talk, missed = Talk(reminder_hours=24.0), ExpectedCall(0.0, 2.0 * HOUR, 3.0 * HOUR, STEP)
        silence = Silence("electa/overdue/0", missed, 2, messages, called)
        talk.notified = replace(talk.notified, silences=(silence,))
        kinds = {n: talk.update("0" + "1" * n) for n in range(2, 40)}
        assert [n for n, notified in kinds.items() if notified == ["reminder"]] == reminded

    def test_none_when_switched_off(self):
        talk = Talk(reminder_hours=None)
        assert [talk.update("0" + "1" * n) for n in (2, 60)] == [["anomaly"], []]

    def test_none_for_a_closed_incident(self):
        talk = Talk()
        talk.update("01100")
        assert talk.update("01100" + "0" * 20) == []

    def test_an_incident_first_heard_of_when_old_is_not_reminded_of_at_once(self):
        """The last flagged dive is two days back: dives since then got no flag."""
        talk = Talk(reminder_hours=24.0)
        assert talk.update("011" + "-" * 16) == ["anomaly"]
        assert talk.update("011" + "-" * 16) == []
        assert talk.update("011" + "-" * 31) == []
        assert talk.update("011" + "-" * 32) == ["reminder"]

    def test_a_correction_is_as_good_as_a_reminder(self):
        talk = Talk(reminder_hours=24.0)
        talk.update("011" + "1" * 6)
        assert talk.update("001" + "1" * 7) == ["correction"]
        assert talk.update("001" + "1" * 13) == []
        assert talk.update("001" + "1" * 16) == []
        assert talk.update("001" + "1" * 18) == ["reminder"]


class TestCorrections:
    def opened(self) -> tuple[Talk, World]:
        talk, world = Talk(), World.of("0110")
        assert talk.update(world) == ["anomaly"]
        return talk, world

    def change(self, world: World, k: int, **changes) -> None:
        world.dives[k * STEP] = replace(world.dives[k * STEP], **changes)

    def test_when_the_final_current_changes_the_speed(self):
        talk, world = self.opened()
        self.change(world, 2, speed=0.08, reference_u=0.05)
        assert talk.update(world) == ["correction"]
        assert "depth-averaged current" in talk.alerts[-1].body
        assert talk.update(world) == []

    def test_when_the_final_current_changes_the_reference_alone(self):
        talk, world = self.opened()
        self.change(world, 2, reference_v=0.30)
        assert talk.update(world) == ["correction"]

    def test_when_a_current_comes_where_there_was_none(self):
        talk, world = Talk(), World.of("0110")
        self.change(world, 2, reference_u=None, reference_v=None)
        talk.update(world)
        self.change(world, 2, reference_u=0.0, reference_v=0.0)
        assert talk.update(world) == ["correction"]

    def test_not_for_a_little(self):
        talk, world = self.opened()
        self.change(world, 2, speed=0.12, reference_u=0.16)
        assert talk.update(world) == []

    def test_not_when_the_dive_of_a_reminder_has_no_flag_in_the_end(self):
        """Its final current was right: the incident stands as before, as the reminder says."""
        talk, letters = Talk(reminder_hours=24.0), "011"
        assert talk.update(letters) == ["anomaly"]
        while not (said := talk.update(letters)):
            letters += "1"
        assert said == ["reminder"]
        world = World.of(letters)
        self.change(world, len(letters) - 1, flag=0)
        assert talk.update(world) == []
        self.change(world, len(letters) - 1, speed=0.25)
        assert talk.update(world) == ["correction"]

    def test_when_the_dive_that_opened_it_has_no_flag_and_it_stands(self):
        talk = Talk()
        assert talk.update("0111") == ["anomaly"]
        assert talk.update("0110") == ["correction"]
        assert "stands" in talk.alerts[-1].title

    def test_when_a_missing_segment_takes_the_flag_away(self):
        talk, world = self.opened()
        self.change(world, 1, flag=0, speed=0.25)
        assert talk.update(world) == ["correction"]
        assert "withdrawn" in talk.alerts[-1].title and talk.alerts[-1].severity == Severity.INFO
        assert talk.update(world) == []

    def test_when_a_withdrawn_incident_stands_after_all(self):
        talk, world = self.opened()
        self.change(world, 1, flag=0, speed=0.25)
        talk.update(world)
        self.change(world, 1, flag=1, speed=0.15)
        assert talk.update(world) == ["correction"]
        assert "stands" in talk.alerts[-1].title
        assert len({a.incident for a in talk.alerts}) == 1

    def test_when_it_began_earlier_than_told(self):
        talk, world = self.opened()
        self.change(world, 0, flag=1, speed=0.15)
        assert talk.update(world) == ["correction"]
        assert len(talk.notified.threads) == 1

    def test_when_the_end_was_too_early(self):
        talk = Talk()
        talk.update("01100")
        assert talk.update("0110100") == ["correction"]

    def test_when_the_dive_is_not_the_same_any_more(self):
        """Late data show that the dive began a minute earlier."""
        talk, world = self.opened()
        opened = world.dives.pop(2 * STEP)
        world.dives[2 * STEP - 60] = replace(opened, t_dive=2 * STEP - 60)
        assert talk.update(world) == []

    def test_a_withdrawn_incident_is_no_cover_for_a_new_one(self):
        """What opens days later is news, not a correction of what was withdrawn."""
        talk, world = self.opened()
        self.change(world, 1, flag=0, speed=0.25)
        talk.update(world)
        for k, letter in enumerate("0000000011", start=4):
            world.dives[k * STEP] = dive(k, letter)
        assert talk.update(world) == ["anomaly"]
        assert len(talk.notified.threads) == 2

    def test_one_whose_dives_are_judged_otherwise_as_the_next_one_is_slow_is_the_same(self):
        """A net takes hold in the middle of a dive: the final current says that its track fits nothing."""
        talk, world = Talk(), World.of("0S")
        assert talk.update(world) == ["anomaly"]
        self.change(world, 1, flag=2)
        world.dives[2 * STEP] = dive(2, "S")
        assert talk.update(world) == ["anomaly"]
        said = " ".join(talk.alerts[-1].body.split())
        assert "The anomaly since 1970-01-01 03:00 UTC is this one: its dives are judged otherwise" in said
        assert len(talk.notified.threads) == 1

    def test_two_incidents_that_turn_out_to_be_one(self):
        talk, world = Talk(), World.of("0110011")
        assert talk.update(world) == ["anomaly"]
        assert "is over: this is another" in talk.alerts[-1].body.replace("\n", " ")
        self.change(world, 4, flag=1, speed=0.15)
        assert talk.update(world) == ["correction"] and "stands" in talk.alerts[-1].title


class TestChangesWithinTheHour:
    """A change of mind within the hour after a message waits; an alarm does not."""

    def test_a_dive_that_opens_and_the_next_a_minute_later_that_withdraws_are_one_message(self):
        talk, world = Talk(), World.of("0110")
        assert talk.update(world, minutes=1) == ["anomaly"]
        before = dict(world.dives)
        world.dives[2 * STEP] = dive(2, "0")
        assert talk.update(world, minutes=1) == [] and talk.notified.settles == talk.now - 60 + SETTLES
        world.dives = before
        assert talk.update(world, minutes=1) == [] and talk.notified.settles is None
        assert talk.update(world, minutes=90) == []

    def test_what_is_still_so_after_the_hour_is_reported_without_new_input(self):
        talk, world = Talk(), World.of("0110")
        talk.update(world, minutes=1)
        world.dives[2 * STEP] = dive(2, "0")
        talk.update(world, minutes=20)
        settles = talk.notified.settles
        assert settled_changes(talk.notified, world, {}, settles - 1)[1] == []
        after, (notice,) = settled_changes(talk.notified, world, {}, settles)
        assert notice.kind is Kind.CORRECTION and after.settles is None
        assert settled_changes(after, world, {}, settles + 1)[1] == []

    def test_several_changes_are_one_message_of_the_last(self):
        talk, world = Talk(), World.of("0110")
        talk.update(world, minutes=1)
        for speed in (0.05, 0.10, 0.02, 0.08):
            world.dives[2 * STEP] = dive(2, "1", speed=speed)
            assert talk.update(world, minutes=10) == []
        assert talk.update(world, minutes=20) == ["correction"]
        assert "0.08 m/s" in talk.alerts[-1].title

    def test_an_incident_that_is_open_again_is_reported_at_once(self):
        talk, world = Talk(), World.of("01100")
        talk.update("011")
        assert talk.update(world, minutes=61) == ["all_clear"]
        world.dives[4 * STEP] = dive(4, "1")
        assert talk.update(world, minutes=1) == ["correction"] and "stands" in talk.alerts[-1].title


class TestHistory:
    def test_what_was_over_for_a_day_when_it_became_known_is_silent(self):
        assert Talk().update("01100" + "0" * 9) == []

    def test_what_was_over_when_its_files_came_together_is_one_message_that_says_so(self):
        talk = Talk()
        assert talk.update("01100" + "0" * 5) == ["all_clear"]
        (alert,) = talk.alerts
        assert (alert.severity, alert.audience) == (Severity.INFO, Severity.CRITICAL)
        assert "reported only now, because its files came together" in " ".join(alert.body.split())

    def test_what_is_still_open_is_told_however_old(self):
        assert Talk().update("011" + "1" * 100) == ["anomaly"]

    def test_silent_history_stays_silent(self):
        talk = Talk()
        for n in range(9, 30):
            assert talk.update("01100" + "0" * n) == []
        assert pytest.approx(8 * STEP) == NEWS


class TestNotices:
    def test_it_tells_the_next_one_if_that_is_known(self):
        world, talk = World.of("00"), Talk(notices=True)
        last = max(a.t_surface for a in world.dives.values())
        world.next = NextSurfacing(last + 60, last + 3 * 3600, 600.0, 27.5, -84.0, 1e4, 0.0, 1e4, "test")
        talk.update(world)
        assert "Next call: 1970" in talk.alerts[-1].body and "084° 00.000' W" in talk.alerts[-1].body
        world, talk = World.of("00"), Talk(notices=True)
        world.next = NextSurfacing(last - 7200, last, 600.0, 27.5, -84.0, 1e4, 0.0, 1e4, "of an earlier one")
        talk.update(world)
        assert "Next call: not known" in talk.alerts[-1].body

    def test_one_a_surfacing(self):
        talk = Talk(notices=True)
        assert [talk.update("0" * n) for n in range(1, 4)] == [["surfacing"]] * 3
        assert len({a.id for a in talk.alerts}) == 3

    def test_only_the_latest_of_many(self):
        talk = Talk(notices=True)
        assert talk.update("00000") == ["surfacing"]
        assert talk.alerts[0].time == 4 * STEP + 2.5 * HOUR

    def test_never_of_an_older_one(self):
        talk = Talk(notices=True)
        talk.update("000 0")
        assert talk.update("00000") == []

    def test_not_again_when_its_time_is_corrected(self):
        talk, world = Talk(notices=True), World.of("000")
        talk.update(world)
        for shift in (300.0, -300.0):
            world.dives[2 * STEP] = replace(dive(2, "0"), t_surface=2 * STEP + 2.5 * HOUR + shift)
            assert talk.update(world) == []
        world.dives[3 * STEP] = dive(3, "0")
        assert talk.update(world) == ["surfacing"]

    def test_not_for_a_dive_that_has_not_ended(self):
        talk, world = Talk(notices=True), World.of("00")
        talk.update(world)
        world.dives[2 * STEP] = dive(2, "-", unusable=Unusable.NOT_SURFACED)
        assert talk.update(world) == []

    def test_none_when_nobody_wants_them(self):
        assert Talk(notices=False).update("000") == []
