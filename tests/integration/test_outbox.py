"""The dispatcher with real threads: order, retry, independence of channels, and an end in time."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from alert_support import MemoryStore, alert, until
from gliderwatch.delivery.channels import DeliveryError
from gliderwatch.delivery.dispatcher import Dispatcher, OutboxRow, retry_delay
from gliderwatch.model import Alert, Severity


class FakeChannel:
    """Keeps what it was sent; fails as often as told, or waits until let go."""

    def __init__(self, fail: int = 0, error: Exception | None = None) -> None:
        self.sent: list[str] = []
        self.tries = 0
        self.fail = fail
        self.error = error or DeliveryError("server is down")
        self.gate = threading.Event()
        self.gate.set()
        self.prepared = threading.Event()

    def prepare(self) -> None:
        self.prepared.set()

    def send(self, alert: Alert) -> None:
        self.tries += 1
        self.gate.wait(30)
        if self.fail > 0:
            self.fail -= 1
            raise self.error
        self.sent.append(alert.id)


def soon(attempts: int, row_id: int) -> float:
    return 0.02


@contextmanager
def running(
    store: MemoryStore, channels: dict[str, FakeChannel], limit: float = 90.0
) -> Iterator[tuple[Dispatcher, threading.Event]]:
    wake = threading.Event()
    made = Dispatcher(store.open, channels, time.time, wake, delay=soon, limit=limit)
    made.start()
    try:
        yield made, wake
    finally:
        for channel in channels.values():
            channel.gate.set()
        made.stop()


@pytest.mark.timing
def test_wakes_at_once_and_marks_after_sending() -> None:
    store, channel = MemoryStore(), FakeChannel()
    with running(store, {"mail": channel}) as (_, wake):
        until(channel.prepared.is_set)
        begun = time.monotonic()
        row = store.add(alert(), "mail")
        wake.set()
        until(lambda: row in store.done)
        assert time.monotonic() - begun < 0.5
    assert channel.sent == ["a1"]
    assert store.marked == [row]


def test_the_store_is_used_in_one_thread_only() -> None:
    store, channels = MemoryStore(), {"a": FakeChannel(), "b": FakeChannel(fail=1)}
    for i in range(6):
        store.add(alert(f"a{i}"), "ab"[i % 2])
    with running(store, channels) as (_, wake):
        wake.set()
        until(lambda: len(store.done) == 6)
    assert len(store.threads) == 1
    assert threading.get_ident() not in store.threads


def test_retries_until_delivered_and_then_never_again() -> None:
    store, channel = MemoryStore(), FakeChannel(fail=3)
    row = store.add(alert(), "mail")
    with running(store, {"mail": channel}) as (_, wake):
        until(lambda: row in store.done)
        tries = channel.tries
        store.add(alert("a2", incident=""), "mail")  # gives the dispatcher another round
        wake.set()
        until(lambda: len(channel.sent) == 2)
    assert tries == 4
    assert channel.sent == ["a1", "a2"]
    assert [error for _, error, _ in store.errors] == ["server is down"] * 3


def test_a_dead_or_hanging_channel_delays_no_other() -> None:
    dead, hanging, good = FakeChannel(fail=10**6), FakeChannel(), FakeChannel()
    hanging.gate.clear()
    store = MemoryStore()
    for i in range(5):
        for name in ("dead", "hanging", "good"):
            store.add(alert(f"{i}", incident=f"i{i}"), name)
    with running(store, {"dead": dead, "hanging": hanging, "good": good}):
        until(lambda: len(good.sent) == 5, 2)
        until(lambda: hanging.tries == 1, 2)  # its thread may begin after that of the good one has ended
        assert hanging.sent == []


def test_messages_of_an_incident_stay_in_order() -> None:
    channel, store = FakeChannel(fail=2), MemoryStore()
    for name in ("alarm", "reminder", "clear"):
        store.add(alert(name), "mail")
    with running(store, {"mail": channel}):
        until(lambda: len(store.done) == 3)
    assert channel.sent == ["alarm", "reminder", "clear"]


def test_an_incident_that_waits_does_not_hold_up_another() -> None:
    class Choosy(FakeChannel):
        def send(self, alert: Alert) -> None:
            if alert.incident == "bad":
                raise DeliveryError("refused")
            super().send(alert)

    channel, store = Choosy(), MemoryStore()
    store.add(alert("x1", incident="bad"), "mail")
    store.add(alert("y1", incident="good"), "mail")
    store.add(alert("n1", incident=""), "mail")
    store.add(alert("n2", incident=""), "mail")
    with running(store, {"mail": channel}):
        until(lambda: len(channel.sent) == 3)
    assert sorted(channel.sent) == ["n1", "n2", "y1"]


def test_the_loudest_goes_first() -> None:
    channel, store = FakeChannel(), MemoryStore()
    for i, severity in enumerate((Severity.INFO, Severity.WARNING, Severity.CRITICAL)):
        store.add(alert(severity.name, severity=severity, incident=str(i)), "mail")
    with running(store, {"mail": channel}):
        until(lambda: len(store.done) == 3)
    assert channel.sent == ["CRITICAL", "WARNING", "INFO"]


@pytest.mark.timing
def test_stops_in_time_though_a_send_hangs_and_leaves_its_row() -> None:
    channel, store = FakeChannel(), MemoryStore()
    channel.gate.clear()
    store.add(alert(), "mail")
    with running(store, {"mail": channel}) as (dispatcher, _):
        until(lambda: channel.tries == 1)
        begun = time.monotonic()
        dispatcher.stop(2.0)
        assert time.monotonic() - begun < 2.3
        assert not dispatcher.alive()
        assert store.done == {}


def test_a_send_under_way_at_the_end_is_still_marked() -> None:
    channel, store = FakeChannel(), MemoryStore()
    channel.gate.clear()
    row = store.add(alert(), "mail")
    with running(store, {"mail": channel}) as (dispatcher, _):
        until(lambda: channel.tries == 1)
        threading.Timer(0.2, channel.gate.set).start()
        dispatcher.stop(2.0)
        assert row in store.done


def test_a_send_that_never_returns_counts_as_failed_and_frees_its_channel() -> None:
    channel, store = FakeChannel(), MemoryStore()
    channel.gate.clear()
    first = store.add(alert("a1"), "mail")
    with running(store, {"mail": channel}, limit=0.2):
        until(lambda: len(store.errors) >= 1)
        assert store.errors[0][:2] == (first, "no answer within 0.2 s")
        channel.gate.set()
        until(lambda: first in store.done)
        store.add(alert("a2"), "mail")
        until(lambda: len(store.done) == 2)


def test_survives_a_store_that_fails_without_sending_twice() -> None:
    channel, store = FakeChannel(), MemoryStore()
    channel.gate.clear()
    row = store.add(alert(), "mail")
    with running(store, {"mail": channel}) as (dispatcher, _):
        until(lambda: channel.tries == 1)
        store.broken = 2
        channel.gate.set()
        until(lambda: row in store.done, 10)
        assert dispatcher.alive()
        assert store.opened > 1
    assert channel.sent == ["a1"]


def test_a_channel_that_raises_anything_is_tried_again_and_its_text_is_not_kept() -> None:
    channel, store = FakeChannel(fail=1, error=RuntimeError("password hunter2")), MemoryStore()
    row = store.add(alert(), "mail")
    with running(store, {"mail": channel}):
        until(lambda: row in store.done)
    assert store.errors[0][1] == "unexpected RuntimeError"


def test_a_row_for_a_channel_that_is_gone_is_parked_until_it_is_there_again() -> None:
    store, channel = MemoryStore(), FakeChannel()
    row = store.add(alert(), "old")
    with running(store, {"mail": channel}) as (_, wake):
        until(lambda: bool(store.errors))
        store.add(alert("a2"), "mail")  # gives the dispatcher another round
        wake.set()
        until(lambda: channel.sent == ["a2"])
    assert ["no such channel" in error for _, error, _ in store.errors] == [True]
    assert row not in store.done
    with running(store, {"old": channel}):
        until(lambda: row in store.done)
    assert channel.sent == ["a2", "a1"]


class TestRefused:
    """A channel that will never take a message."""

    def refusing(self) -> FakeChannel:
        return FakeChannel(fail=1, error=DeliveryError("550 no such user", permanent=True))

    def test_it_is_not_tried_again_and_holds_back_nothing(self) -> None:
        store, channel = MemoryStore(), self.refusing()
        first, second = store.add(alert("a1"), "mail"), store.add(alert("a2"), "mail")
        with running(store, {"mail": channel}):
            until(lambda: second in store.done)
        assert store.given_up == {first: "550 no such user"}
        assert channel.sent == ["a2"] and channel.tries == 2 and store.errors == []

    def test_the_others_hear_of_it_once_a_day(self) -> None:
        store, channel, other = MemoryStore(), self.refusing(), FakeChannel()
        channel.fail = 2
        for n in range(2):
            store.add(alert(f"a{n}", incident=str(n)), "mail")
        with running(store, {"mail": channel, "slack": other}):
            until(lambda: len(store.given_up) == 2 and len(other.sent) == 1)
        (report,) = (row.alert for row in store.rows.values() if row.channel == "slack")
        assert "mail refuses" in report.title and "550 no such user" in report.body
        assert [row.alert.id for row in store.rows.values() if row.channel == "mail"] == ["a0", "a1"]

    def test_no_report_is_made_of_a_report(self) -> None:
        store, a, b = MemoryStore(), self.refusing(), self.refusing()
        a.fail = b.fail = 100
        store.add(alert(), "a")
        with running(store, {"a": a, "b": b}):
            until(lambda: len(store.given_up) == 2)
        assert len(store.rows) == 2


def test_a_dispatcher_that_cannot_read_the_outbox_makes_no_progress() -> None:
    store = MemoryStore()
    with running(store, {"mail": FakeChannel()}) as (dispatcher, wake):
        until(lambda: store.opened == 1)
        until(dispatcher.alive)
        store.broken = 10**6
        wake.set()
        until(lambda: store.opened >= 2, 10)
        before = dispatcher.progress()
        until(lambda: store.opened >= 3, 10)
        assert dispatcher.progress() == before
        store.broken = 0
        until(lambda: dispatcher.progress() > before, 10)


def test_a_dead_server_is_asked_some_dozen_times_in_six_hours_and_then_at_least_every_17_minutes() -> None:
    """The schedule of a channel that is down for hours, with time as an argument."""
    now, tries = 0.0, []
    while now < 6 * 3600:
        tries.append(now)
        now += retry_delay(len(tries), 7)
    assert 28 <= len(tries) <= 33
    assert tries[3] < 60 and all(later - earlier <= 990 for earlier, later in pairwise(tries))


def test_tells_the_watchdog_that_it_moves() -> None:
    store = MemoryStore()
    with running(store, {"mail": FakeChannel()}) as (dispatcher, wake):
        until(dispatcher.alive)
        before = dispatcher.progress()
        wake.set()
        until(lambda: dispatcher.progress() > before)
        assert dispatcher.progress() <= time.monotonic()


def test_idles_without_looking_at_the_store_all_the_time() -> None:
    class Blocks(FakeChannel):
        def send(self, alert: Alert) -> None:
            if self.tries:
                self.gate.clear()
            super().send(alert)

    store, channel = MemoryStore(), Blocks(fail=1)
    looks = 0
    due = store.due

    def counted(now: float) -> list[OutboxRow]:
        nonlocal looks
        looks += 1
        return due(now)

    store.due = counted  # type: ignore[method-assign]
    store.add(alert("a1", incident="1"), "mail")  # fails, and is due again while the next one hangs
    store.add(alert("a2", incident="2"), "mail")
    with running(store, {"mail": channel}):
        until(lambda: channel.tries == 2)
        time.sleep(0.5)
        assert looks < 10


@given(st.integers(1, 10**6), st.integers(1, 10**9))
def test_back_off_grows_to_a_quarter_of_an_hour(attempts: int, row_id: int) -> None:
    delay = retry_delay(attempts, row_id)
    assert delay == retry_delay(attempts, row_id)
    assert 5.0 <= delay <= 990.0
    assert delay >= min(5.0 * 2.0 ** min(attempts - 1, 20), 900.0)


@pytest.mark.parametrize("attempts", [1, 5, 10])
def test_rows_that_fail_together_do_not_come_back_together(attempts: int) -> None:
    assert len({retry_delay(attempts, row) for row in range(50)}) == 50
