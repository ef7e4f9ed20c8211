"""A glider whose clock is set in mid-mission, or whose mission counter begins again: what is said."""

import random
import sqlite3
from dataclasses import replace
from functools import cache
from itertools import pairwise

import pytest

from clocks import WEEKS, shifted, with_clock_set
from gliderwatch.incidents import overdue
from gliderwatch.model import Kind, SegmentId
from gliderwatch.service import transaction
from gliderwatch.service.routing import Routing
from gliderwatch.store import codec, database
from gliderwatch.store.state_file import File, Status, Store
from missions import START, Leg, ending, feed, mission

HOUR, DAY = 3600.0, 86400.0
LEGS = [Leg(hours=3.0, heading=1.0 + 0.02 * (k % 3)) for k in range(24)]
ALL = Routing(channels=lambda alert: ["mail"], notices=lambda glider: False)


def live(segments, delays=None, store=None, start=0):
    """A store whose files come when the glider calls, whatever its clock says, and the messages made."""
    store, alerts = store or Store.open(":memory:"), []
    for i, (s, came) in enumerate(zip(segments, delays, strict=True), start):
        file = File(f"/{i}/{s.id.name}", 1, 1, Status.WAITING, s.id.glider, s.id.name)
        params, now = transaction.GliderParams(), came
        alerts += transaction.tick(store, "unit", ALL, [], now)
        alerts += transaction.process_file(store, file, s, params, ALL, now).alerts
    return store, alerts


MISSION = mission(LEGS)


@cache
def right():
    """What comes of the mission with a clock that is right."""
    return feed(MISSION)


@cache
def fallen(step):
    """The same with a clock that is set by `step` (s) before the 16th segment."""
    return feed(with_clock_set(MISSION, 15, step))


CAME = [s.last_t + 600.0 for s in MISSION]


@cache
def live_fallen(step):
    """The files of `fallen` as they come when it calls: the store, and the messages."""
    return live(with_clock_set(MISSION, 15, step), CAME)


@pytest.mark.parametrize(
    "step",
    [
        -2 * HOUR,
        -10 * DAY,
        -WEEKS,
        *(pytest.param(step, marks=pytest.mark.slow) for step in (-1 * HOUR, -5 * HOUR, -9500.0)),
    ],
)
class TestSetBack:
    def test_no_dive_is_flagged_or_lost(self, step):
        dives = fallen(step).assessments("unit")
        assert [a.flag for a in dives] == [0] * len(MISSION)
        assert [a.t_dive for a in dives] == sorted(a.t_dive for a in dives)

    def test_its_dives_are_where_they_were_and_a_note_says_why(self, step):
        dives = fallen(step).assessments("unit")
        pairs = zip(dives, right().assessments("unit"), strict=True)
        off = [abs(a.t_dive - b.t_dive) for a, b in pairs]
        assert max(off) < 900.0 and max(off[:15]) == 0.0
        assert all(any("behind" in note for note in a.notes) for a in dives[15:])
        assert not any("behind" in note for a in dives[:15] for note in a.notes)

    def test_any_order_of_arrival_ends_alike(self, step):
        segments = with_clock_set(MISSION, 15, step)
        order = random.Random(5).sample(segments, len(segments))
        assert ending(feed(order), "unit") == ending(fallen(step), "unit")

    def test_it_is_not_overdue_while_it_calls(self, step):
        store, alerts = live_fallen(step)
        assert not [a for a in alerts if a.kind == Kind.OVERDUE]
        at = transaction.next_tick(store, "unit", ALL, CAME[-1])
        assert at is not None and at > CAME[-1] + 3 * HOUR


@pytest.mark.parametrize("step", [1 * HOUR, 2 * HOUR, 5 * HOUR])
def test_a_clock_set_forward_by_hours_costs_no_dive(step):
    dives = feed(with_clock_set(MISSION, 15, step)).assessments("unit")
    assert [a.flag for a in dives] == [0] * len(MISSION)
    (noted,) = (a for a in dives if any("clock was set forward" in note for note in a.notes))
    assert noted.t_dive == dives[15].t_dive
    assert [a.t_dive for a in dives[15:]] == [a.t_dive + step for a in right().assessments("unit")[15:]]


@pytest.mark.parametrize(
    ("step", "size", "why"),
    [(-WEEKS, "1024 weeks", "GPS"), (-10 * DAY, "10 days", "restart"), (-5 * HOUR, "5 h", "restart")],
)
def test_the_operator_is_told_once(step, size, why):
    store, alerts = live_fallen(step)
    (told,) = (a for a in alerts if a.kind == Kind.OPERATOR)
    assert told.title == f"unit CLOCK fell back by {size}"
    assert why in told.body and "put on the right time" in told.body
    assert store.clock_steps("unit")[0].segment == MISSION[15].id.name


def test_that_it_is_right_again_is_told():
    _, alerts = live(with_clock_set(MISSION, 10, -10 * DAY, until=18), CAME)
    assert [a.title for a in alerts if a.kind == Kind.OPERATOR] == [
        "unit CLOCK fell back by 10 days",
        "unit CLOCK right again",
    ]


def test_a_clock_set_by_an_hour_is_a_matter_of_notes():
    _, alerts = live_fallen(-2 * HOUR)
    assert not [a for a in alerts if a.kind == Kind.OPERATOR]


FALLEN = with_clock_set(MISSION, 15, -10 * DAY)
LOST = [s for i, s in enumerate(FALLEN) if i != 14]
LOST_CAME = [t for i, t in enumerate(CAME) if i != 14]


@cache
def live_lost():
    """What comes of it as the glider calls; a test that adds to the store makes its own."""
    return live(LOST, LOST_CAME)


class TestNotKnownByHowMuch:
    """The clock fell by ten days, and a segment before it is missing."""

    def test_its_dives_are_kept_apart_and_it_is_said(self):
        store, alerts = live_lost()
        (told,) = (a for a in alerts if a.kind == Kind.OPERATOR)
        assert told.title == "unit CLOCK fell back, not known by how much"
        assert "kept apart" in told.body
        assert not any(a.flag for a in store.assessments("unit"))

    def test_it_calls_and_so_it_is_not_overdue(self):
        store, alerts = live_lost()
        assert not [a for a in alerts if a.kind == Kind.OVERDUE]
        signs = store.facts("unit").signs(0.0)
        expected = store.facts("unit").expected(LOST_CAME[-1])
        assert overdue.expected_call(expected, signs, LOST_CAME[-1], None).last_sign == LOST_CAME[-1]

    def test_a_glider_that_was_overdue_has_called(self):
        store, _ = live(MISSION[:14], CAME[:14])
        late = CAME[13] + 2 * DAY
        (alert,) = transaction.tick(store, "unit", ALL, [], late)
        assert alert.kind == Kind.OVERDUE
        _, alerts = live([FALLEN[15]], [late + HOUR], store, 50)
        assert Kind.ALL_CLEAR in {a.kind for a in alerts}

    def test_the_missing_file_puts_all_in_its_place(self):
        store, _ = live(LOST, LOST_CAME)
        live([FALLEN[14]], [CAME[-1] + 60.0], store, 50)
        assert ending(store, "unit") == ending(fallen(-10 * DAY), "unit")
        assert [a.flag for a in store.assessments("unit")] == [0] * len(MISSION)


def test_a_restart_with_a_wrong_clock_is_told_and_the_glider_has_called():
    """A new mission, dated twenty years ago: its numbers tell nothing."""
    again = [
        replace(s, id=replace(s.id, name=f"unit-2004-100-0-{k}"))
        for k, s in enumerate(shifted(s, -WEEKS - 5 * DAY) for s in MISSION[15:])
    ]
    store, alerts = live([*MISSION[:15], *again], CAME)
    (told,) = alerts
    assert told.title == "unit OLD DATES: files are 7173 days old"
    assert "kept apart" in told.body and "unit-2004-100-0" in told.body
    assert not any(a.flag for a in store.assessments("unit"))
    assert transaction.next_tick(store, "unit", ALL, CAME[-1]) > CAME[-1] + 3 * HOUR


def test_a_file_that_is_sent_again_days_later_is_not_told():
    late = [t + 5 * DAY if i in (3, 20) else t for i, t in enumerate(CAME)]
    order = sorted(range(len(late)), key=lambda i: late[i])
    _, alerts = live([MISSION[i] for i in order], [late[i] for i in order])
    assert not [a for a in alerts if a.kind == Kind.OPERATOR]


def test_an_archive_read_at_the_first_start_is_no_glider_at_sea():
    old = [shifted(s, -400 * DAY) for s in MISSION]
    store, alerts = live(old, [START + 1.0 * i for i in range(len(old))])
    assert not alerts
    assert not overdue.is_at_sea(store.facts("unit").signs(0.0), 3 * HOUR, START + 100.0)
    assert overdue.next_tick((), store.facts("unit"), None, START + 100.0) is None


TWICE = [replace(s, id=replace(s.id, name=f"unit-2023-318-0-{i % 12}")) for i, s in enumerate(MISSION)]


@cache
def twice():
    """What comes of it in the order of time."""
    return feed(TWICE)


def test_old_files_that_nobody_can_read_send_no_glider_to_sea():
    """On deck it makes files every hour; those of last year come too, and their cache is missing."""
    store, now = Store.open(":memory:"), START + DAY
    for k in range(8):
        t = now - (8 - k) * HOUR
        store.record_sign(SegmentId(t, "unit", f"unit-2023-319-0-{k}"), t + 60.0, t + 90.0)
        old = now - 400 * DAY + k * 3 * HOUR
        store.record_sign(SegmentId(old, "unit", f"unit-2022-280-0-{k}"), None, now - HOUR)
    assert overdue.outlook(store.facts("unit"), now) is None


class TestOneNameTwoSegments:
    """The mission counter began again at 0 on the same day: the names of twelve segments come twice."""

    def test_all_are_taken_and_no_dive_is_lost(self):
        store = twice()
        assert store.extent("unit")[0] == len(TWICE)
        assert [a.flag for a in store.assessments("unit")] == [0] * len(MISSION)
        assert not store.clock_steps("unit")

    def test_any_order_of_arrival_ends_alike(self):
        order = random.Random(6).sample(TWICE, len(TWICE))
        assert ending(feed(order), "unit") == ending(twice(), "unit")

    def test_a_copy_that_opened_seconds_later_is_the_same_segment(self):
        fuller = replace(shifted(TWICE[3], 0.0), completeness=(2, 10**6, "x"), kind="dbd")
        fuller = replace(fuller, id=replace(fuller.id, opened_at=fuller.id.opened_at + 4.0))
        store = feed([*TWICE, fuller])
        assert store.extent("unit")[0] == len(TWICE)
        assert store.segments.completeness(fuller.id) == fuller.completeness
        assert len(store.facts("unit").signs(0.0)) == len(TWICE)

    def test_each_has_its_own_expectation(self):
        found = [e.after for e in twice().forecasts("unit")]
        assert len(found) >= len(TWICE) - 1 and all(a <= b for a, b in pairwise(found))


def test_a_state_file_of_schema_4_is_taken_on(tmp_path):
    """Its segments, signs of life and forecasts stay; a clock that falls afterwards is seen."""
    path, segments = tmp_path / "state.sqlite", with_clock_set(MISSION, 15, -10 * DAY)
    with sqlite3.connect(path) as db:
        steps = [database.schema(), *(database.MIGRATIONS[v] for v in (2, 3, 4))]
        db.executescript("\n".join([*steps, "PRAGMA user_version = 4;"]))
    old = sqlite3.connect(path)
    for s in segments[:15]:
        row = (s.id.glider, s.id.opened_at, s.id.name, codec.plain_encode(s.completeness), codec.encode(s))
        old.execute("INSERT INTO segments VALUES (?, ?, ?, ?, ?, NULL, 1)", row)
        old.execute(
            "INSERT INTO heard VALUES ('unit', ?, ?, ?, ?)", (s.id.name, s.id.opened_at, s.last_t, 7.0)
        )
    old.commit()
    old.close()
    store = Store.open(path)
    assert store.extent("unit")[0] == 15
    assert [s.at for s in store.facts("unit").signs(0.0)] == [7.0] * 15
    assert ending(feed(segments[15:], store=store), "unit") == ending(fallen(-10 * DAY), "unit")
    assert store.segments.resume(SegmentId(float("inf"), "unit", ""))[1] == []
