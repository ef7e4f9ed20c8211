"""Messages that wait in the outbox: for an acknowledgement, and for the end of quiet hours."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from datetime import UTC, time
from pathlib import Path

import pytest

from alert_support import alert
from gliderwatch.delivery.dispatcher import Delivery
from gliderwatch.incidents.send_schedule import QuietHours, Wait
from gliderwatch.model import Alert, Severity
from gliderwatch.service import metrics
from gliderwatch.service.operator_alerts import HOUR
from gliderwatch.service.routing import post_alert
from gliderwatch.store import maintenance, outbox
from gliderwatch.store.outbox import Outbox
from gliderwatch.store.state_file import Store
from gliderwatch.store.watch_health import Failing, failing

NOW = 1_700_000_000.0  # 22:13 UTC
MORNING = NOW + 31600.0  # 07:00 UTC
HALF = 1800.0
CHIEF = {"sms": [Wait(after=HALF)]}
NIGHT = {"sms": [Wait(quiet=QuietHours(time(22), time(7), UTC, Severity.CRITICAL))]}
BOTH = {"sms": [*CHIEF["sms"], *NIGHT["sms"]]}
THREAD = alert().incident


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "state.sqlite"


@pytest.fixture
def store(path: Path) -> Iterator[Store]:
    with closing(Store.open(path)) as store:
        yield store


@pytest.fixture
def rows(store: Store, path: Path) -> Iterator[Outbox]:
    with closing(Outbox(path)) as rows:
        yield rows


def post(
    store: Store,
    made: Alert,
    channels: dict[str, list[Wait]],
    now: float = NOW,
    unanswered: tuple[str, ...] = (THREAD,),
) -> None:
    post_alert(store, made, channels, now, unanswered)


def withdraw(store: Store, now: float = NOW + 60) -> None:
    outbox.withdraw(store._db, "electa", (), now)


def ids(rows: Outbox, now: float) -> list[str]:
    """What goes out one after the other."""
    found = []
    while due := rows.due(now):
        found += [row.alert.id for row in due]
        for row in due:
            rows.delivered(row.id, now)
    return found


def warning(alert_id: str) -> Alert:
    return alert(alert_id, severity=Severity.WARNING, audience=Severity.WARNING)


class TestEscalation:
    def test_it_waits_for_its_time_also_over_a_restart(self, store: Store, rows: Outbox, path: Path) -> None:
        post(store, alert(), CHIEF)
        assert rows.due(NOW) == rows.due(NOW + HALF - 1) == []
        with closing(Outbox(path)) as again:
            (row,) = again.due(NOW + HALF)
        assert row.unacknowledged == HALF and row.alert == alert()

    def test_what_is_acknowledged_by_then_never_goes_out(self, store: Store, rows: Outbox) -> None:
        post(store, alert(), CHIEF)
        post(store, alert("b", incident="other", glider="sam"), CHIEF, unanswered=("other",))
        withdraw(store)
        assert [u.alert for u in store.undelivered()] == ["b"]
        assert ids(rows, NOW + 1e6) == ["b"]
        assert store.refused(0.0) == []

    def test_what_is_due_already_is_not_withdrawn(self, store: Store, rows: Outbox) -> None:
        """It may be on its way: who gets the alarm is to get the all-clear."""
        post(store, alert("a"), CHIEF)
        withdraw(store, NOW + HALF)
        post(store, alert("clear"), CHIEF, NOW + HALF, ())
        assert ids(rows, NOW + HALF) == ["a", "clear"]

    def test_withdrawn_on_its_way_and_delivered_counts_as_told(self, store: Store, rows: Outbox) -> None:
        post(store, alert("a"), CHIEF)
        (row,) = rows.due(NOW + HALF)
        withdraw(store, NOW + HALF - 1)
        rows.delivered(row.id, NOW + HALF)
        post(store, alert("clear"), CHIEF, NOW + 2 * HALF, ())
        assert ids(rows, NOW + 2 * HALF) == ["clear"]

    def test_who_was_told_hears_the_rest_at_once(self, store: Store, rows: Outbox) -> None:
        post(store, alert("a"), CHIEF)
        assert ids(rows, NOW + HALF) == ["a"]
        for name, unanswered in (("reminder", (THREAD,)), ("clear", ())):
            post(store, alert(name), CHIEF, NOW + HALF, unanswered)
        (row,) = rows.due(NOW + HALF)
        assert row.alert == alert("reminder"), "told as it is"
        assert ids(rows, NOW + HALF) == ["reminder", "clear"]

    @pytest.mark.parametrize("how", ["withdrawn", "refused"])
    def test_who_was_not_told_does_not_hear_the_end(self, store: Store, rows: Outbox, how: str) -> None:
        post(store, alert("a"), CHIEF)
        if how == "refused":
            (row,) = rows.due(NOW + HALF)
            rows.refused(row.id, Delivery.REFUSED, "no such number", NOW, None, [])
        else:
            withdraw(store)
        post(store, alert("clear"), CHIEF, NOW + HALF, ())
        assert store.undelivered() == []

    def test_what_comes_meanwhile_waits_with_it(self, store: Store, rows: Outbox) -> None:
        post(store, alert("a"), CHIEF)
        post(store, alert("correction"), CHIEF, NOW + 600)
        assert rows.due(NOW + HALF - 1) == []
        assert ids(rows, NOW + HALF) == ["a", "correction"]

    def test_what_grows_worse_after_an_acknowledgement_waits_afresh(self, store: Store, rows: Outbox) -> None:
        post(store, alert("a"), CHIEF)
        withdraw(store)
        post(store, alert("worse"), CHIEF, NOW + 1e5)
        assert rows.due(NOW + 1e5 + HALF - 1) == []
        assert ids(rows, NOW + 1e5 + HALF) == ["worse"]

    @pytest.mark.parametrize("jump", [-1e8, -3600.0, 1e8])
    def test_a_clock_that_jumps_holds_nothing(self, store: Store, rows: Outbox, jump: float) -> None:
        post(store, alert(), CHIEF)
        assert len(rows.due(NOW + jump)) == 1

    def test_at_once_is_at_once_by_any_clock(self, store: Store, rows: Outbox) -> None:
        post(store, alert(), {"mail": [Wait()]})
        assert len(rows.due(NOW - 30)) == 1


class TestQuietHours:
    def test_the_quiet_wait_for_the_morning_and_keep_their_order(self, store: Store, rows: Outbox) -> None:
        for name in ("a/0", "a/1"):
            post(store, warning(name), NIGHT)
        assert rows.due(MORNING - 1) == []
        assert ids(rows, MORNING) == ["a/0", "a/1"]

    def test_the_loud_come_at_once_and_bring_along_what_came_before(self, store: Store, rows: Outbox) -> None:
        post(store, warning("overdue/0"), NIGHT)
        post_alert(store, alert("b", incident="b", audience=Severity.WARNING), NIGHT, NOW)
        post(store, alert("overdue/1"), NIGHT, NOW + 60)
        assert ids(rows, NOW + 60) == ["overdue/0", "overdue/1"]
        assert ids(rows, MORNING) == ["b"]

    def test_an_acknowledgement_does_not_withdraw_them(self, store: Store, rows: Outbox) -> None:
        post(store, warning("a"), NIGHT)
        withdraw(store)
        assert ids(rows, MORNING) == ["a"]

    def test_a_channel_of_two_people_goes_by_who_waits_less(self, store: Store, rows: Outbox) -> None:
        post(store, warning("a"), BOTH)
        post(store, warning("b"), {"mail": BOTH["sms"]})
        held = [(u.channel, u.held_until, u.escalates) for u in store.undelivered()]
        assert held == [("sms", NOW + HALF, True), ("mail", NOW + HALF, True)]
        assert rows.due(NOW + HALF)[0].unacknowledged == HALF
        withdraw(store)
        held = [(u.channel, u.held_until, u.escalates) for u in store.undelivered()]
        assert held == [("sms", MORNING, False), ("mail", MORNING, False)]
        assert rows.due(MORNING)[0].alert.title == alert().title


class TestLookedAt:
    """What is held is no trouble, and does not count from when it was made."""

    def test_the_channel_does_not_fail_by_it(self, store: Store, rows: Outbox, path: Path) -> None:
        post(store, alert(), CHIEF)
        assert failing(path, NOW + HALF) == {}
        rows.failed(1, "down", NOW + HALF)
        assert failing(path, NOW + HALF) == {"sms": Failing(NOW + HALF, 1, "down")}

    def test_nor_is_its_delivery_late(self, store: Store, rows: Outbox, path: Path) -> None:
        seen = metrics.Outbox(path)
        post(store, alert("a"), CHIEF)
        post(store, alert("b", incident="b"), CHIEF, unanswered=("b",))
        assert seen.look(NOW + 60) == ([], [], {"sms": 0})
        withdraw(store)
        assert seen.look(NOW + 60) == ([], [], {})
        post(store, alert("c"), CHIEF)
        rows.delivered(3, NOW + HALF + 2)
        assert seen.look(NOW + HALF + 2) == ([("sms", 2.0)], [], {})

    def test_it_is_saved_from_a_damaged_file(self, store: Store, path: Path) -> None:
        post(store, alert("a"), CHIEF)
        store.close()
        aside = maintenance.set_aside(path, 0.0)
        maintenance.restore(path, aside, lambda n: alert("damaged", time=NOW), ["mail"])
        with closing(Store.open(path)) as new:
            assert [(u.alert, u.held_until) for u in new.undelivered()] == [
                ("a", NOW + HALF),
                ("damaged", 0.0),
            ]

    def test_so_is_one_of_an_earlier_release(self, store: Store, path: Path) -> None:
        post(store, alert("a"), CHIEF)
        store._db.executescript(
            "ALTER TABLE outbox DROP COLUMN held_until; ALTER TABLE outbox DROP COLUMN escalates;"
            "ALTER TABLE outbox DROP COLUMN delivery;"
        )
        store.close()
        aside = maintenance.set_aside(path, 0.0)
        maintenance.restore(path, aside, lambda n: alert("damaged", time=NOW), ["mail"])
        with closing(Store.open(path)) as new:
            assert [u.alert for u in new.undelivered()] == ["a", "damaged"]


class TestRefused:
    """A channel that refuses for good is one that fails."""

    def refuse(self, rows: Outbox, now: float, delivery: Delivery = Delivery.REFUSED) -> None:
        (row,) = rows.due(now)
        rows.refused(row.id, delivery, "no such user", now, None, [])

    def test_it_fails_for_a_day(self, store: Store, rows: Outbox, path: Path) -> None:
        store.post(alert(), ["mail"], NOW)
        self.refuse(rows, NOW + 1)
        assert failing(path, NOW + 23 * HOUR) == {"mail": Failing(NOW, 1, "refused: no such user")}
        assert failing(path, NOW + 25 * HOUR) == {}

    def test_or_until_it_delivers(self, store: Store, rows: Outbox, path: Path) -> None:
        store.post(alert("a"), ["mail"], NOW)
        self.refuse(rows, NOW + 1)
        store.post(alert("b"), ["mail", "web"], NOW)
        (mail, web) = rows.due(NOW + 2)
        rows.delivered(web.id, NOW + 2)
        assert set(failing(path, NOW + 3)) == {"mail"}, "another channel delivered"
        rows.delivered(mail.id, NOW + 4)
        assert failing(path, NOW + 5) == {}

    def test_but_not_where_others_of_its_addresses_took_it(
        self, store: Store, rows: Outbox, path: Path
    ) -> None:
        store.post(alert(), ["mail"], NOW)
        self.refuse(rows, NOW + 1, Delivery.PARTLY_REFUSED)
        assert failing(path, NOW + HOUR) == {}

    def test_the_words_of_a_refusal_decide_nothing(self, store: Store, rows: Outbox, path: Path) -> None:
        """A mail server whose answer looks like words of ours; and a message that was not read."""
        for k, words in enumerate(("only some took it: none", "withdrawn: no", "")):
            store.post(alert(str(k)), ["mail"], NOW)
            (row,) = rows.due(NOW + 1)
            rows.refused(row.id, Delivery.REFUSED, words, NOW + 1, None, [])
            assert failing(path, NOW + HOUR)["mail"].messages == k + 1
            assert len(store.refused(NOW)) == k + 1

    def test_what_a_release_before_refused_is_known_by_its_words(self, store: Store, path: Path) -> None:
        """In a file that is not migrated, and after it is."""
        errors = ("", "refused: no", "refused: only some took it: 550", "withdrawn: over", "given up: ?")
        for k, error in enumerate(errors):
            store.post(alert(str(k)), ["mail"], NOW)
            sql = "UPDATE outbox SET delivered_at = ?, error = ? WHERE alert = ?"
            store._db.execute(sql, (NOW - k, error, str(k)))
        store.post(alert("waits"), ["mail"], NOW)
        store._db.execute("UPDATE outbox SET error = 'refused: not yet' WHERE alert = 'waits'")
        store._db.executescript(
            "ALTER TABLE outbox DROP COLUMN delivery; ALTER TABLE files DROP COLUMN hindrance;"
            "DROP INDEX files_by_segment; DROP TABLE calls; DROP TABLE health; DROP TABLE field_settings;"
            "DROP TABLE field_batches; DROP TABLE field_checkpoints; DROP TABLE field_soundings;"
            "DROP TABLE field_advice; DROP TABLE layers; DROP TABLE relays;"
            "PRAGMA user_version = 4;"
        )
        assert [u.alert for u in store.refused(0.0)] == ["1", "2", "4"]
        with closing(Store.open(path)) as new:
            found = [row[0] for row in new._db.execute("SELECT delivery FROM outbox ORDER BY id")]
            assert [u.alert for u in new.refused(0.0)] == ["1", "2", "4"]
        made = ["delivered", "refused", "partly_refused", "withdrawn", "unreadable", "pending"]
        assert found == made and set(made) == set(Delivery)

    def test_what_it_refused_is_a_failure_and_no_delivery(
        self, store: Store, rows: Outbox, path: Path
    ) -> None:
        seen = metrics.Outbox(path)
        store.post(alert(), ["mail"], NOW)
        self.refuse(rows, NOW + 1)
        assert seen.look(NOW + 2) == ([], [("mail", 1)], {})
