"""Quiet hours by the clock on the wall, and who is told when."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, time
from math import inf
from zoneinfo import ZoneInfo

import pytest

import written
from alert_support import SLOW, alert, incident
from dives_by_letters import World
from gliderwatch.incidents.acknowledgement import acknowledge
from gliderwatch.incidents.notifications import NotificationState, due_notifications
from gliderwatch.incidents.open_threads import unacknowledged
from gliderwatch.incidents.overdue import ExpectedCall, Silence
from gliderwatch.incidents.send_schedule import AT_ONCE, NO_INCIDENT, Due, QuietHours, Standing, Wait
from gliderwatch.incidents.send_schedule import due as goes_out
from gliderwatch.messages.template import escalated
from gliderwatch.model import Incident, Severity

AMSTERDAM = ZoneInfo("Europe/Amsterdam")
NEW = Standing(notified=False, unanswered=True)
NOON = datetime(2026, 6, 1, 12, tzinfo=UTC).timestamp()


def quiet(start: str, end: str, zone: ZoneInfo = AMSTERDAM) -> QuietHours:
    return QuietHours(time.fromisoformat(start), time.fromisoformat(end), zone, Severity.CRITICAL)


def at(text: str) -> float:
    """A time in UTC."""
    return datetime.fromisoformat(text).replace(tzinfo=UTC).timestamp()


@pytest.mark.parametrize(
    ("start", "end", "now", "until"),
    [
        ("22:00", "07:00", "2026-06-01 20:30", "2026-06-02 05:00"),  # 22:30 in summer: next morning
        ("22:00", "07:00", "2026-06-02 04:59", "2026-06-02 05:00"),
        ("22:00", "07:00", "2026-12-01 20:30", "2026-12-01 20:30"),  # 21:30 in winter: not yet
        ("22:00", "07:00", "2026-06-02 05:00", "2026-06-02 05:00"),  # the end is none of them
        ("12:00", "14:00", "2026-06-01 10:00", "2026-06-01 12:00"),  # the start is
        ("22:00", "07:00", "2026-03-28 21:30", "2026-03-29 05:00"),  # the night that is an hour shorter
        ("22:00", "07:00", "2026-10-24 20:30", "2026-10-25 06:00"),  # and the one that is longer
        ("22:00", "02:30", "2026-03-28 22:00", "2026-03-29 01:30"),  # 02:30 is left out: 03:30 it is
        ("22:00", "02:30", "2026-10-24 22:00", "2026-10-25 00:30"),  # 02:30 comes twice: the first
        ("22:00", "02:30", "2026-10-25 01:10", "2026-10-25 01:30"),  # at the second 02:10, the second
        ("03:00", "02:30", "2026-03-28 22:00", "2026-03-30 00:30"),  # the half hour of that day is left out
    ],
)
def test_they_end_by_the_clock_on_the_wall(start: str, end: str, now: str, until: str) -> None:
    told = datetime.fromtimestamp(quiet(start, end).until(at(now)), UTC)
    assert f"{told:%Y-%m-%d %H:%M}" == until


def test_only_what_is_quieter_waits() -> None:
    waits = (Wait(quiet=quiet("08:00", "20:00", ZoneInfo("UTC"))),)
    assert goes_out(waits, Severity.CRITICAL, NOON, NO_INCIDENT) == Due(0.0, inf)
    assert goes_out(waits, Severity.WARNING, NOON, NO_INCIDENT) == Due(NOON + 8 * 3600, inf)


@pytest.mark.parametrize(
    ("standing", "expected"),
    [
        (NEW, Due(inf, NOON + 1800)),
        (replace(NEW, notified=True), Due(0.0, inf)),
        (replace(NEW, unanswered=False), None),
        (replace(NEW, escalates=NOON + 60), Due(inf, NOON + 60)),  # with what waits already
        (NO_INCIDENT, Due(0.0, inf)),
    ],
)
def test_who_is_second_hears_of_what_nobody_takes_on(standing: Standing, expected: Due | None) -> None:
    assert goes_out((Wait(after=1800.0),), Severity.CRITICAL, NOON, standing) == expected


def test_who_waits_least_decides_for_a_channel() -> None:
    chief, night = Wait(after=1800.0), Wait(quiet=quiet("08:00", "20:00", ZoneInfo("UTC")))
    warning = Severity.WARNING
    assert goes_out((chief, *AT_ONCE), warning, NOON, NEW) == Due(0.0, inf)
    assert goes_out((chief, replace(chief, after=600.0)), warning, NOON, NEW) == Due(inf, NOON + 600)
    assert goes_out((chief, night), warning, NOON, NEW) == Due(NOON + 8 * 3600, NOON + 1800)
    late = Wait(after=10 * 3600.0)
    assert goes_out((late, night), warning, NOON, NEW) == Due(NOON + 8 * 3600, inf)
    assert goes_out((chief, night), warning, NOON, replace(NEW, unanswered=False)) == Due(
        NOON + 8 * 3600, inf
    )


def test_an_escalation_heeds_quiet_hours_too() -> None:
    chief = Wait(after=1800.0, quiet=quiet("12:15", "14:00", ZoneInfo("UTC")))
    assert goes_out((chief,), Severity.WARNING, NOON, NEW) == Due(inf, NOON + 7200)
    assert goes_out((chief,), Severity.CRITICAL, NOON, NEW) == Due(inf, NOON + 1800)


# --------------------------------------------------------------------------- what is unanswered


def told(letters: str) -> tuple[NotificationState, tuple[Incident, ...]]:
    world = World.of(letters)
    return due_notifications(NotificationState(), world, None, False)[0], world.incidents()


def test_an_open_incident_is_unanswered_until_somebody_takes_it_on_or_it_grows_worse() -> None:
    said, (one,) = told("0011")
    assert unacknowledged(said, (one,), {}) == {one.id}
    acks = {one.id: acknowledge(one, "Ann", "", 0.0)}
    assert unacknowledged(said, (one,), acks) == frozenset()
    worse = replace(one, worst=replace(one.worst, speed=0.02))
    assert unacknowledged(said, (worse,), acks) == {one.id}


def test_what_is_over_withdrawn_or_was_never_told_needs_no_answer() -> None:
    said, (one,) = told("0011")
    assert unacknowledged(said, (replace(one, cleared_at=1e6),), {}) == frozenset()
    assert unacknowledged(said, (), {}) == frozenset()
    assert unacknowledged(NotificationState(), (one,), {}) == frozenset()


def test_a_silence_is_unanswered_while_it_lasts() -> None:
    silence = Silence("electa/overdue/1", ExpectedCall(1.0, 2.0, 3.0, 1.0), 1, 1)
    assert unacknowledged(NotificationState(silences=(silence,)), (), {}) == {"electa/overdue/1"}
    assert unacknowledged(NotificationState(silences=(replace(silence, called=9.0),)), (), {}) == frozenset()


# --------------------------------------------------------------------------- words


def test_an_escalated_message_says_why_it_comes_and_what_to_do() -> None:
    made = alert(incident="electa/anomaly/1667639520+", html="<body>\n<p style='x'>a</p>\n<p style='y'>b</p>")
    told = escalated(made, 1800.0)
    assert told.title == f"NOT ACKNOWLEDGED {made.title}"
    lead = "Nobody has acknowledged this for 30 min: that is why it comes to you. "
    lead += "To take it on: sudo -u gliderwatch gliderwatch ack electa/anomaly/1667639520"
    assert told.body == f"{lead}\n\n{made.body}"
    assert told.html == f"<body>\n<p><b>{lead}</b></p>\n<p style='x'>a</p>\n<p style='y'>b</p>"
    assert (told.id, told.incident) == (made.id, made.incident)


def test_a_mail_says_it_above_all_else() -> None:
    made = written.opened(incident(), SLOW, alert_id="a", audience=Severity.CRITICAL)
    told = escalated(replace(made, incident="electa/anomaly/1"), 60.0)
    place = told.html.index("Nobody has acknowledged this for 1 min")
    assert told.html.index("<body") < place < told.html.index("<b>electa SLOW")


def test_a_silence_is_taken_on_by_a_mute() -> None:
    told = escalated(alert(incident="electa/overdue/1667639520"), 7200.0)
    assert "for 2.0 h" in told.body
    assert "gliderwatch mute electa --hours 6" in told.body
