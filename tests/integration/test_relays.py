"""Relays over a real broker: batches of fields go round, whatever happens to broker, lines and relays."""

from __future__ import annotations

import random
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from queue import Empty, SimpleQueue

import numpy as np
import pytest

from acceptance.support import until
from broker import Broker, Line, needs_mosquitto
from gliderwatch.delivery import mqtt
from gliderwatch.fleet import exchange
from gliderwatch.fleet import scalar_field as sf
from gliderwatch.fleet.advice import Box
from gliderwatch.fleet.batches import packed, params_of, unpacked
from gliderwatch.fleet.scalar_field import Batch
from gliderwatch.service import relays as service
from gliderwatch.service.fields import FleetField, catch_up, take_from_relays
from gliderwatch.service.relays import BatchesCame, RelayExchange, RelaySettings
from gliderwatch.store.relays import RelayState
from gliderwatch.store.state_file import Store

pytestmark = needs_mosquitto
BOX, T0 = Box(50.0, -30.0, 50.5, -29.0, 0.0, 100.0), 1.7e9
PARAMS = params_of("sci_water_temp", "literal")
FIELD = FleetField("sst", BOX, "sci_water_temp", PARAMS, is_shared=True)


def batch(k: int, n: int = 6) -> Batch:
    """Of glider ``k % 3``, two hours after the one before."""
    rng = np.random.default_rng([5, k])
    t = T0 + 7200.0 * k + 300.0 * np.arange(n)
    value = 15 + rng.normal(size=n)
    whole = Batch(f"b{k:03}", f"g{k % 3}", t, rng.uniform(0, 1, (n, 3)), value, np.full(n, 30.0))
    return unpacked(packed(whole), whole.id, whole.glider)


class Relay:
    """What of the daemon has to do with relays, without its loop."""

    def __init__(self, folder: Path, name: str, port: int, field: FleetField = FIELD) -> None:
        self.name, self.port, self.field = name, port, field
        self.path = folder / f"{name}.sqlite"
        self.start()

    def start(self) -> None:
        self.news: SimpleQueue[BatchesCame] = SimpleQueue()
        self.store = Store.open(self.path)
        keys = {self.field.name: exchange.key_of(self.field.key)}
        broker = mqtt.Broker("127.0.0.1", self.port, is_tls=False)
        self.exchange = RelayExchange(
            RelaySettings(self.name, "test", broker, keys), self.path, self.news.put
        )
        self.exchange.start()

    def stop(self) -> None:
        self.exchange.stop()
        self.store.close()

    def measure(self, *batches: Batch) -> None:
        with self.store.transaction():
            self.store.fields.begin(self.field.name, self.field.key)
            self.store.fields.put(self.field.name, batches, is_shared=True)

    def turn(self) -> None:
        try:
            while True:
                came = self.news.get_nowait()
                take_from_relays(self.store, self.field, came.batches)
        except Empty:
            pass

    @property
    def ids(self) -> set[str]:
        self.turn()
        rows = self.store._db.execute("SELECT id FROM field_batches WHERE field = 'sst'")
        return {row[0] for row in rows}

    @property
    def content(self) -> tuple[tuple[str, bytes], ...]:
        sql = "SELECT id, data FROM field_batches WHERE field = 'sst' ORDER BY id"
        return tuple((row[0], row[1]) for row in self.store._db.execute(sql))

    @property
    def state(self) -> RelayState:
        return self.store.relays()


@pytest.fixture(autouse=True)
def hurry(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(service, "PAUSE", 0.02)
    monkeypatch.setattr(service, "CALM", 0.1)
    monkeypatch.setattr(service, "PATIENCE", 1.0)
    monkeypatch.setattr(mqtt, "LONGEST_RETRY", 1)


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Broker]:
    (tmp_path / "broker").mkdir()
    with Broker(tmp_path / "broker") as made:
        yield made


def test_three_relays_end_with_one_field(tmp_path: Path, broker: Broker) -> None:
    """One is cut off for a day of surfacings, one is killed and starts again, the broker loses its memory."""
    line = Line(broker.port)
    a, b = (Relay(tmp_path, name, broker.port) for name in "ab")
    relays = [a, b, c := Relay(tmp_path, "c", line.port)]
    batches = [batch(k) for k in range(24)]
    for k, each in enumerate(random.Random(1).sample(batches[:6], 6)):
        relays[k % 3].measure(each)
    until(lambda: all(len(r.ids) == 6 for r in relays), "the first six everywhere", 20)
    until(lambda: all(r.state.waiting == 0 for r in relays), "all of them confirmed", 20)
    line.cut()
    until(lambda: not c.state.link.is_up, "one is cut off", 20)
    assert "batches wait" not in c.state.link.error
    for k, each in enumerate(batches[6:18]):
        relays[k % 3].measure(each)
    assert c.state.waiting == 4
    until(lambda: len(a.ids) == len(b.ids) == 14, "the others go on", 20)
    b.stop()  # with all in the state file, and nothing else
    broker.__exit__()
    with Broker(tmp_path / "broker") as again:  # on another port, and with no memory
        line._target = again.port
        line.mend()
        for relay in (a, b):
            relay.port = again.port
        a.stop()
        a.start()
        for each in batches[18:]:
            c.measure(each)
        b.start()
        until(lambda: all(len(r.ids) == 24 for r in relays), "all of them everywhere", 30)
        assert {relay.content for relay in relays} == {tuple((b.id, packed(b)) for b in batches)}
        until(lambda: set(a.state.others) == {"b", "c"}, "who is there", 20)
        until(lambda: a.state.others["c"][1].batches == {"sst": 24}, "what they have", 20)
        for relay in relays:
            relay.stop()


def test_a_field_is_brought_up_to_date_by_some_hours_at_a_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gliderwatch.service.fields.CATCH_UP", 1)
    with closing(Store.open(tmp_path / "s.sqlite")) as store:
        assert take_from_relays(store, FIELD, [batch(k, 2) for k in range(2)])
        assert not take_from_relays(store, FIELD, [batch(1, 2)])
        times = [catch_up(store, FIELD) for _ in range(3)]
        assert times[0] < times[1] == times[2]
        whole = sf.run(None, [batch(k, 2) for k in range(2)], PARAMS)[-1]
        assert times[2] == whole.t
        np.testing.assert_array_equal(store.fields.newest("sst", PARAMS).known.d, whole.known.d)


def test_a_new_relay_gets_all_and_a_fuller_copy_wins(tmp_path: Path, broker: Broker) -> None:
    a = Relay(tmp_path, "a", broker.port)
    a.measure(*(batch(k) for k in range(5)))
    until(lambda: a.state.waiting == 0, "sent", 20)
    b = Relay(tmp_path, "b", broker.port)
    b.measure(batch(2, 9), batch(3, 4))
    until(lambda: len(b.ids) == 5, "all of it", 20)

    def lengths(relay: Relay) -> list[int]:
        relay.turn()
        sql = "SELECT data, id, glider FROM field_batches ORDER BY id"
        return [len(unpacked(*row).t) for row in relay.store._db.execute(sql)]

    until(lambda: lengths(a) == lengths(b) == [6, 6, 9, 6, 6], "the longer of each", 20)
    a.stop()
    b.stop()


def test_another_box_is_not_exchanged_and_nonsense_is_left_alone(tmp_path: Path, broker: Broker) -> None:
    a = Relay(tmp_path, "a", broker.port)
    a.measure(batch(0))
    other = replace(FIELD, box=replace(BOX, north=51.0))
    b = Relay(tmp_path, "b", broker.port, other)
    b.measure(batch(1))
    until(lambda: "b" in a.state.others and a.state.others["b"][1].apart == ("sst",), "apart", 20)
    ahead = Batch("late", "g", np.array([4e9]), np.zeros((1, 3)), np.zeros(1), np.ones(1))
    samples = (exchange.Sample("bad", "g", b"?"), exchange.Sample("late", "g", packed(ahead)))
    key = exchange.key_of(FIELD.key)
    good = exchange.Sample("b007", "g1", packed(batch(7)))
    parcel = exchange.Parcel(exchange.FORM, "z", "sst", key, (*samples, good))
    link = a.exchange._link
    for data in (b"", b"\xc1", b"x" * 300_000, exchange.encode(parcel)):
        a.exchange._ears.came("test/batches", data)
    until(lambda: "b007" in a.ids, "the good one", 20)
    assert a.ids == {"b000", "b007"} and link is a.exchange._link
    a.stop()
    b.stop()


def test_who_may_not_enter_is_told_why(tmp_path: Path) -> None:
    (tmp_path / "broker").mkdir()
    with Broker(tmp_path / "broker", "allow_anonymous false") as closed:
        a = Relay(tmp_path, "a", closed.port)
        until(lambda: a.state.link is not None and "uthori" in a.state.link.error, "why", 20)
        assert not a.state.link.is_up
        assert mqtt.reach(mqtt.broker_of(f"mqtt://127.0.0.1:{closed.port}")) == "Not authorized"
        a.stop()
    assert "refused" in (mqtt.reach(mqtt.broker_of(f"mqtt://127.0.0.1:{closed.port}")) or "")
