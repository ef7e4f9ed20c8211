"""The state file: all or nothing, versions, what may be written twice and what may not."""

import base64
import gzip
import json
import sqlite3
import subprocess
import sys
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from alert_support import SLOW, alert, incident
from gliderwatch.errors import GliderwatchError, StateError
from gliderwatch.incidents.notifications import NotificationState
from gliderwatch.incidents.overdue import Sign
from gliderwatch.model import Alert, NextSurfacing, Segment, SegmentId, Series, Unusable, readonly
from gliderwatch.pages.reading import read_glider
from gliderwatch.params import Attention, GliderParams
from gliderwatch.pipeline import GliderState, Memory, Outcome
from gliderwatch.service import routing, transaction
from gliderwatch.service.routing import Routing, post_alerts
from gliderwatch.store import codec, database, maintenance
from gliderwatch.store.database import SCHEMA
from gliderwatch.store.outbox import Outbox
from gliderwatch.store.segments import Segments
from gliderwatch.store.state_file import File, Status, Store
from missions import Leg, cut, ending, feed, mission

GOLDEN = Path(__file__).parents[1] / "golden"
FIRST = GOLDEN / "schema-1.sqlite.gz"
LEGS = [Leg(heading=0.5 * k) for k in range(6)]


@pytest.fixture
def path(tmp_path):
    return tmp_path / "state" / "gliderwatch.sqlite"


@pytest.fixture
def store(path):
    opened = Store.open(path)
    yield opened
    opened.close()


def file(name: str, status: Status = Status.TAKEN, **changes) -> File:
    return replace(File(f"/from-glider/{name}", 10, 20, status), **changes)


class TestOpening:
    def test_the_folder_is_made(self, store, path):
        assert path.exists() and store.gliders() == []

    def test_what_was_written_is_there_next_time(self, path):
        first = feed(mission(LEGS), store=Store.open(path))
        expected = ending(first, "unit")
        first.close()
        assert ending(Store.open(path), "unit") == expected

    def test_it_writes_ahead_and_syncs(self, store):
        assert store._db.execute("PRAGMA journal_mode").fetchone()[0] == "wal"
        assert store._db.execute("PRAGMA synchronous").fetchone()[0] == 2  # FULL
        assert store._db.execute("PRAGMA foreign_keys").fetchone()[0] == 1

    def test_its_schema_is_numbered(self, store):
        assert store._db.execute("PRAGMA user_version").fetchone()[0] == SCHEMA

    def test_a_newer_schema_is_refused_and_left_alone(self, store, path):
        store._db.execute(f"PRAGMA user_version = {SCHEMA + 1}")
        store.close()
        before = path.read_bytes()
        for attempt in (Store.open, Store.reading, Outbox):
            with pytest.raises(StateError, match=rf"schema {SCHEMA + 1}.*up to {SCHEMA}: install the newer"):
                attempt(path)
        assert path.read_bytes() == before

    def test_an_older_schema_is_migrated_step_by_step(self, store, path, monkeypatch):
        store.record(file("a"), 0.0)
        store.close()
        steps = {
            SCHEMA + 1: "CREATE TABLE extra (a INTEGER);",
            SCHEMA + 2: "ALTER TABLE extra ADD COLUMN b INTEGER;",
        }
        monkeypatch.setattr(database, "SCHEMA", SCHEMA + 2)
        monkeypatch.setattr(database, "MIGRATIONS", steps)
        migrated = Store.open(path)
        assert migrated._db.execute("PRAGMA user_version").fetchone()[0] == SCHEMA + 2
        assert migrated._db.execute("SELECT a, b FROM extra").fetchall() == []
        assert migrated.counts() == {Status.TAKEN: 1}

    def test_a_state_file_of_schema_1_is_taken_on(self, path):
        """As gliderwatch 0.1.0 left it: its segments stay, its states are made anew from them."""
        path.parent.mkdir()
        made = mission(LEGS)
        with sqlite3.connect(path) as db:
            db.executescript(database.schema() + "PRAGMA user_version = 1;")
        old = sqlite3.connect(path)
        for s in made[:-1]:
            row = (
                s.id.glider,
                s.id.opened_at,
                s.id.name,
                codec.plain_encode(s.completeness),
                codec.encode(s),
            )
            old.execute("INSERT INTO segments VALUES (?, ?, ?, ?, ?, x'00', 1)", row)
        waits = alert(incident="")
        old.execute("INSERT INTO alerts VALUES ('a1', 'unit', 0, 0, ?)", (codec.plain_encode(waits),))
        old.execute("INSERT INTO outbox (alert, channel, incident) VALUES ('a1', 'mail', '')")
        old.commit()
        old.close()
        store = feed(made[-1:], store=Store.open(path))
        assert ending(store, "unit") == ending(feed(made), "unit")
        assert store.facts("unit").expected(1e12) == feed(made).facts("unit").expected(1e12)
        assert [row.alert for row in Outbox(path).due(1e9)] == [waits], "held by nothing"

    def test_a_state_file_that_the_first_release_wrote_is_gone_on_from(self, path):
        """By the daemon of 0.1.0 (schema 1) of a simulated remora, its mail still undelivered."""
        path.parent.mkdir()
        path.write_bytes(gzip.decompress(FIRST.read_bytes()))
        with sqlite3.connect(path) as db:
            assert db.execute("PRAGMA user_version").fetchone() == (1,)
        store = Store.open(path)
        (before,) = store.incidents("sim")
        assert [row.alert.incident for row in Outbox(path).due(2e9)] == [before.id]
        _, identities = store.segments.resume(SegmentId(float("-inf"), "sim", ""))
        made = [store.segments.get(identity) for identity in identities]
        fuller = replace(made[-1], completeness=(9, 10**6, ""))
        feed([fuller], store=store)
        assert ending(store, "sim") == ending(feed([*made[:-1], fuller]), "sim")
        (after,) = store.incidents("sim")
        assert after.opened_at < before.opened_at, "today's estimator sees it sooner"
        assert len(made) == 31

    @pytest.mark.parametrize("schema", [4, 7, 10, 12, 14])
    def test_a_state_file_that_was_cut_is_gone_on_from(self, path, schema):
        """`keep_days` has removed what was before its first checkpoint: that is read, not made again. What
        comes next gives dives, flags and the incident that the code that wrote it made of the same segments;
        speeds are those of another estimator."""
        path.parent.mkdir()
        path.write_bytes(gzip.decompress((GOLDEN / f"schema-{schema}.sqlite.gz").read_bytes()))
        with sqlite3.connect(path) as db:
            assert db.execute("PRAGMA user_version").fetchone() == (schema,)
            assert db.execute("SELECT milestone FROM segments ORDER BY opened_at").fetchone() == (2,)
            cut = db.execute("SELECT max(opened_at) FROM segments").fetchone()[0]
        then = json.loads(gzip.decompress((GOLDEN / f"schema-{schema}-goes-on.json.gz").read_bytes()))
        come = [codec.decode(base64.b64decode(record), Segment) for record in then.pop("segments")]
        with closing(Store.open(path)) as store:
            speaking = Routing(channels=lambda alert: ["mail"], notices=lambda glider: False)
            feed(come, speaking=speaking, store=store)
            found = {
                "assessments": store.assessments("sim"),
                "incidents": store.incidents("sim"),
                "expected": store.forecasts("sim"),
                "alerts": store.alerts(),
            }
            now = {name: json.loads(codec.plain_encode(v)) for name, v in found.items()}
            flown = [(a["t_dive"], a["flag"]) for a in then["assessments"]]
            assert [(a["t_dive"], a["flag"]) for a in now["assessments"]] == flown
            pairs = zip(now["assessments"], then["assessments"], strict=True)
            assert all(abs(a["speed"] - b["speed"]) < 0.03 for a, b in pairs if b["speed"] is not None)
            incident = [(i["id"], i["kind"], i["dives"]) for i in then["incidents"]]
            assert [(i["id"], i["kind"], i["dives"]) for i in now["incidents"]] == incident
            assert len(then["alerts"]) == 1 and then["incidents"][0]["dives"] > 1
            (open_,), _ = store.incidents("sim"), list(store.remove(cut))
            first = store._db.execute("SELECT min(opened_at) FROM segments").fetchone()[0]
            assert first < open_.since and store.incidents("sim") == [open_]

    def test_a_migration_that_fails_changes_nothing(self, store, path, monkeypatch):
        store.close()
        monkeypatch.setattr(database, "SCHEMA", SCHEMA + 1)
        monkeypatch.setattr(database, "MIGRATIONS", {SCHEMA + 1: "CREATE TABLE extra (a); NONSENSE;"})
        with pytest.raises(StateError, match="cannot be used"):
            Store.open(path)
        with sqlite3.connect(path) as db:
            assert db.execute("PRAGMA user_version").fetchone()[0] == SCHEMA
            assert db.execute("SELECT count(*) FROM sqlite_schema WHERE name = 'extra'").fetchone()[0] == 0

    def test_what_is_no_state_file_is_said(self, path):
        path.parent.mkdir()
        path.write_bytes(b"no database, but longer than a header of one would be" * 20)
        for attempt in (Store.open, Store.reading):
            with pytest.raises(StateError, match=r"gliderwatch\.sqlite"):
                attempt(path)

    def test_a_folder_that_cannot_be_made_is_said(self, tmp_path):
        (tmp_path / "file").write_text("")
        with pytest.raises(StateError, match=r"Choose another state\.path"):
            Store.open(tmp_path / "file" / "state.sqlite")


class TestTrouble:
    """The state file cannot be written, or read."""

    def limited(self, store: Store) -> None:
        """No page more than the file has now: what a full disk is to SQLite."""
        pages = store._db.execute("PRAGMA page_count").fetchone()[0]
        store._db.execute(f"PRAGMA max_page_count = {pages}")

    def test_a_full_disk_is_said_and_nothing_is_half_written(self, store):
        self.limited(store)
        with (
            pytest.raises(StateError, match=r"cannot be used: .*full. What to do: make room"),
            store.transaction(),
        ):
            for n in range(1000):
                store.record(file(f"file {n}"), 0.0)
        assert store.counts() == {} and not store._db.in_transaction
        store._db.execute("PRAGMA max_page_count = 100000")
        with store.transaction():
            store.record(file("a"), 0.0)
        assert store.counts() == {Status.TAKEN: 1}

    def test_what_cannot_be_committed_is_taken_back(self, store, monkeypatch):
        class Failing(sqlite3.Connection):
            def execute(self, sql, *values):
                if sql == "COMMIT" and self.fails:
                    raise sqlite3.OperationalError("disk I/O error")
                return super().execute(sql, *values)

        path = store._path
        db = sqlite3.connect(path, isolation_level=None, factory=Failing)
        db.fails = True
        other = Store(db, path)
        with pytest.raises(StateError, match="disk I/O error"), other.transaction():
            other.record(file("a"), 0.0)
        db.fails = False
        assert other.counts() == {}
        with other.transaction():
            other.record(file("b"), 0.0)
        assert other.counts() == {Status.TAKEN: 1}

    def test_a_lock_is_said(self, store, path):
        store._db.execute("PRAGMA busy_timeout = 20")
        with closing(sqlite3.connect(path, isolation_level=None)) as other:
            other.execute("BEGIN IMMEDIATE")
            with pytest.raises(StateError, match="end the program that holds it locked"):
                store.probe()
        store.probe()

    def test_a_probe_needs_to_write(self, store):
        store.probe()
        store._db.execute("PRAGMA query_only = 1")
        with pytest.raises(StateError, match="let the user of the service write there"):
            store.probe()

    def test_a_mistake_of_the_program_is_no_trouble_of_the_disk(self, store):
        with pytest.raises(sqlite3.IntegrityError), store.transaction():
            store._db.execute("INSERT INTO outbox (alert, channel, incident) VALUES ('zz', 'mail', '')")


class TestDamage:
    def test_a_whole_file_and_no_file_are_not_damaged(self, store, path):
        with store.transaction():
            store.record(file("a"), 0.0)
        assert maintenance.damage(path) is None and maintenance.damage(path.with_name("none")) is None

    def test_another_kind_of_file_an_empty_one_and_bad_pages(self, store, path):
        for n in range(500):
            store.record(file(f"file {n}"), 0.0)
        store.close()
        whole = path.read_bytes()
        for bad in (b"", b"x" * 5000, whole[:5000], whole[:8192] + b"\xa5" * 8192 + whole[16384:]):
            path.write_bytes(bad)
            assert maintenance.damage(path)

    def test_a_check_that_is_cut_short_calls_nothing_damaged(self, store, path):
        with store.transaction():
            for n in range(20_000):
                store.record(file(f"file {n}"), 0.0)
        store.close()
        assert [maintenance.damage(path, seconds) for seconds in np.linspace(0.0, 0.01, 10)] == [None] * 10

    def test_all_of_it_is_renamed_and_a_second_time_does_not_hide_the_first(self, store, path):
        store.record(file("a"), 0.0)  # is in the log still
        first = maintenance.set_aside(path, 0.0)
        assert first.name == path.name + ".damaged-19700101T000000Z"
        assert not list(path.parent.glob(path.name + "-*"))
        path.write_bytes(b"")
        second = maintenance.set_aside(path, 0.0)
        assert maintenance.asides(path) == [first, second]
        with closing(Store.reading(first)) as old:
            assert old.counts() == {Status.TAKEN: 1}

    def test_what_was_told_is_saved_once(self, store, path):
        store.post(alert("a"), ["mail"], 1.0)
        store.post(alert("b"), ["mail", "slack"], 1.0)
        post_alerts(store, "electa", NotificationState(surfaced=5.0), [], lambda a: [], 1.0)
        store._db.execute("UPDATE outbox SET delivered_at = 2 WHERE alert = 'a'")
        store._db.execute("UPDATE alerts SET data = '{' WHERE id = 'b'")
        store.post(alert("c"), ["mail"], 1.0)
        store.close()
        aside = maintenance.set_aside(path, 0.0)
        saved = []

        def report(n: int) -> Alert:
            saved.append(n)
            return alert("damaged", body=f"{n} saved")

        assert maintenance.restore(path, aside, report, ["mail"]) is not None
        assert maintenance.restore(path, aside, report, ["mail"]) is None
        with closing(Store.open(path)) as new:
            assert [a.id for a in new.alerts()] == ["a", "c", "damaged"] and saved[1] == 2
            assert [u.alert for u in new.undelivered()] == ["c", "damaged"]
            assert new.notified("electa") == NotificationState(surfaced=5.0)


class TestReading:
    def test_no_state_file(self, path):
        with pytest.raises(StateError, match="has the daemon run"):
            Store.reading(path)
        assert not path.exists()

    def test_it_sees_and_cannot_write(self, store, path):
        store.record(file("a"), 0.0)
        reader = Store.reading(path)
        assert reader.counts() == {Status.TAKEN: 1}
        with pytest.raises(sqlite3.OperationalError, match="readonly"):
            reader.record(file("b"), 0.0)
        store.record(file("b"), 0.0)
        assert reader.counts() == {Status.TAKEN: 2}  # beside the daemon that writes


def tables(store: Store) -> dict[str, list]:
    names = [r[0] for r in store._db.execute("SELECT name FROM sqlite_schema WHERE type = 'table'")]
    return {n: [tuple(r) for r in store._db.execute(f"SELECT * FROM {n}")] for n in names}


class TestTransaction:
    """Each input leads to all of its rows or to none."""

    @pytest.mark.parametrize(
        ("part", "step"),
        [
            (Segments, "put"),
            (Store, "apply"),
            (Segments, "checkpoint"),
            (Segments, "thin"),
            (Store, "keep_notified"),
            (Store, "post"),
        ],
    )
    def test_whatever_fails_on_the_way_leaves_nothing(self, store, monkeypatch, part, step):
        speaking = routing.Routing(channels=lambda a: ["mail"], notices=lambda g: True)
        feed(mission(LEGS)[:3], speaking=speaking, store=store)
        before = tables(store)
        whole = getattr(part, step)

        def breaks(self, *args):
            whole(self, *args)
            raise KeyboardInterrupt  # as of a signal, not only what an error handler would catch

        monkeypatch.setattr(part, step, breaks)
        with pytest.raises(KeyboardInterrupt):
            feed(mission(LEGS)[3:4], speaking=speaking, store=store)
        assert tables(store) == before
        monkeypatch.undo()
        feed(mission(LEGS)[3:4], speaking=speaking, store=store)
        assert len(store.assessments("unit")) == 4

    def test_a_process_that_dies_leaves_nothing(self, path):
        feed(mission(LEGS)[:3], store=Store.open(path)).close()
        code = (
            "import os, sys\n"
            "from pathlib import Path\n"
            "from gliderwatch.store.state_file import File, Status, Store\n"
            "store = Store.open(Path(sys.argv[1]))\n"
            "with store.transaction():\n"
            "    store.record(File('/x', 1, 1, Status.TAKEN), 0.0)\n"
            "    store._db.execute('DELETE FROM assessments')\n"
            "    os._exit(9)\n"
        )
        done = subprocess.run([sys.executable, "-c", code, str(path)], check=False, timeout=60)
        assert done.returncode == 9
        after = Store.open(path)
        assert len(after.assessments("unit")) == 3 and after.file("/x") is None

    def test_a_reader_sees_all_of_it_or_nothing(self, store, path):
        reader = Store.reading(path)
        with store.transaction():
            store.record(file("a"), 0.0)
            assert reader.counts() == {}
        assert reader.counts() == {Status.TAKEN: 1}


class TestLedger:
    def test_a_file_comes_back(self, store):
        waiting = file("a", Status.WAITING, glider="g", segment="s", reason="why", crc="abc")
        store.record(waiting, 5.0)
        assert store.file(waiting.path) == waiting and store.file("/other") is None

    def test_the_last_word_on_a_file_counts(self, store):
        store.record(file("a", Status.WAITING), 1.0)
        store.record(file("a", Status.TAKEN), 2.0)
        assert store.counts() == {Status.TAKEN: 1}

    def test_files_by_status(self, store):
        for k, status in enumerate(Status):
            store.record(file(f"{9 - k}", status), 0.0)
        assert [f.status for f in store.files(Status.WAITING, Status.UNKNOWN)] == [
            Status.UNKNOWN,
            Status.WAITING,
        ]
        assert store.files() == []

    def test_only_known_states(self, store):
        with pytest.raises(sqlite3.IntegrityError):
            store._db.execute("INSERT INTO files VALUES ('/x', 1, 1, 'lost', '', '', '', '', 0, '')")


class TestSegments:
    def test_a_segment_comes_back(self, store):
        s = mission(LEGS)[0]
        assert store.segments.put(s) == s.id
        back = store.segments.get(s.id)
        assert back.id == s.id and back.get("depth").v.tolist() == s.get("depth").v.tolist()
        assert store.segments.completeness(s.id) == s.completeness
        assert store.segments.completeness(SegmentId(s.id.opened_at, "unit", "other")) is None

    def test_dense_data_are_kept_thinned_and_lead_to_the_same(self, store):
        """4 s data, as of a file that was recovered with the glider."""
        rng = np.random.default_rng(0)
        made = [_dense(s, rng) for s in mission(LEGS[:3])]
        first = feed(made, store=store)
        kept = store.segments.get(made[1].id)
        assert len(kept.get("pitch")) < len(made[1].get("pitch")) / 6
        assert kept.get("fix_lat").t.tolist() == made[1].get("fix_lat").t.tolist()
        assert kept.completeness == made[1].completeness
        again = feed([made[2], made[1], made[0]])
        assert ending(again, "unit") == ending(first, "unit")

    def test_a_fuller_copy_replaces_it_from_its_time_on(self, store):
        s = mission(LEGS)[2]
        store.segments.put(cut(s, s.id.opened_at + 3000))
        assert store.segments.put(s) == s.id
        assert store.segments.completeness(s.id) == s.completeness
        assert store.extent("unit") == (1, 0)

    def test_a_copy_opened_at_another_time_touches_both(self, store):
        """The clock was set between two copies."""
        s = mission(LEGS)[2]
        store.segments.put(s)
        later = replace(s, id=replace(s.id, opened_at=s.id.opened_at + 60))
        assert store.segments.put(later) == s.id
        assert store.segments.put(s) == s.id

    def test_it_goes_on_from_the_newest_checkpoint_before(self, store):
        made = mission(LEGS)
        feed(made, store=store)
        state, todo = store.segments.resume(made[3].id)
        assert todo == [s.id for s in made[3:]]
        assert state.navigation.last_t == made[2].last_t
        assert store.segments.resume(made[0].id) == (GliderState(), [s.id for s in made])

    def test_each_glider_for_itself(self, store):
        made = mission(LEGS)
        feed(made, store=store)
        assert store.segments.resume(SegmentId(0.0, "other", "")) == (GliderState(), [])
        assert store.gliders() == ["unit"]


def _dense(s: Segment, rng: np.random.Generator) -> Segment:
    """The segment with pitch, heading and depth every 4 s, and noise on them."""
    held = dict(s.quantities)
    for name in ("pitch", "heading", "depth"):
        t = np.arange(held[name].t[0], held[name].t[-1], 4.0)
        v = np.interp(t, held[name].t, held[name].v) + rng.normal(0.0, 0.01, len(t))
        held[name] = Series(readonly(t), readonly(v))
    return replace(s, quantities=held)


class TestResults:
    def test_new_results_replace_those_from_their_time_on(self, store):
        a = [replace(SLOW, t_dive=100.0 * k, t_surface=100.0 * k + 50) for k in range(4)]
        store.apply("electa", Outcome(GliderState(), float("-inf"), tuple(a), (), None))
        changed = replace(a[2], speed=0.2)
        store.apply("electa", Outcome(GliderState(), 200.0, (changed,), (), None))
        assert store.assessments("electa") == [a[0], a[1], changed]

    def test_a_dive_of_a_clock_that_is_ahead_does_not_hide_the_one_before(self, store):
        a = [replace(SLOW, t_dive=100.0 * k, t_surface=100.0 * k + 50) for k in range(3)]
        store.apply("electa", Outcome(GliderState(), float("-inf"), tuple(a), (), None))
        assert store.facts("electa").latest_dives(1, 200.0) == (a[1],)
        assert read_glider(store, "electa", Attention(), 200.0, dives=1).latest == a[1]

    def test_incidents_opened_later_go(self, store):
        made = [incident(id=f"electa/anomaly/{k}", opened_at=100.0 * k) for k in range(3)]
        store.apply("electa", Outcome(GliderState(), float("-inf"), (), tuple(made), None))
        cleared = replace(made[1], cleared_at=150.0)
        store.apply("electa", Outcome(GliderState(), 100.0, (), (cleared,), None))
        assert store.incidents("electa") == [made[0], cleared]

    def test_a_dive_that_has_not_ended_is_no_surfacing(self, store):
        known = store.facts("electa")
        ended = replace(SLOW, t_dive=0.0, t_surface=50.0)
        lost = replace(SLOW, t_dive=100.0, t_surface=150.0, unusable=Unusable.DATA_MISSING)
        under_way = replace(SLOW, t_dive=200.0, t_surface=250.0, unusable=Unusable.NOT_SURFACED, flag=None)
        store.apply("electa", Outcome(GliderState(), float("-inf"), (ended, lost, under_way), (), None))
        assert known.last_surfacing(1e9) == lost
        assert known.last_surfacing(149.0) == ended and known.last_surfacing(0.0) is None
        assert known.dive(200.0) == under_way and known.dive(1.0) is None


class TestSurfacings:
    def expect(self, store: Store, after: float, opened_at: float) -> NextSurfacing:
        made = NextSurfacing(after, after + 100.0, opened_at, 30.0, -80.0, 1.0, 0.0, 1.0, "as before")
        state = GliderState(memory=Memory(expected=made))
        store.segments.checkpoint(
            SegmentId(opened_at, "electa", f"electa-{opened_at:g}"), state, state.memory.expected
        )
        return made

    def test_the_last_expected_as_known_at_a_time(self, store):
        self.expect(store, 200.0, 199.0)
        first, second = self.expect(store, 100.0, 0.0), self.expect(store, 200.0, 201.0)
        known = store.facts("electa")
        assert [known.expected(t) for t in (99.0, 199.0, 1e9)] == [None, first, second]
        assert store.facts("other").expected(1e9) is None

    def test_a_segment_that_is_taken_again_leads_to_expect_something_else(self, store):
        first = self.expect(store, 100.0, 0.0)
        self.expect(store, 200.0, 110.0)
        moved = self.expect(store, 190.0, 110.0)
        assert store.facts("electa").expected(1e9) == moved
        store.segments.checkpoint(SegmentId(110.0, "electa", "electa-110"), GliderState(), None)
        assert store.facts("electa").expected(1e9) == first

    def test_a_segment_is_heard_once_and_read_later(self, store):
        identity = SegmentId(100.0, "electa", "electa-1")
        store.record_sign(identity, None, 500.0)
        assert store.facts("electa").signs(0.0) == (Sign(100.0, None, 500.0),)
        store.record_sign(identity, 200.0, 900.0)
        store.record_sign(identity, 150.0, 950.0)
        assert store.facts("electa").signs(0.0) == (Sign(100.0, 200.0, 500.0),)
        assert store.facts("electa").signs(500.1) == () and store.facts("other").signs(0.0) == ()

    def test_the_first_surfacing_after_a_time(self, store):
        ended = [replace(SLOW, t_dive=t, t_surface=t + 50) for t in (0.0, 100.0)]
        under_way = replace(SLOW, t_dive=200.0, t_surface=250.0, unusable=Unusable.NOT_SURFACED, flag=None)
        store.apply("electa", Outcome(GliderState(), float("-inf"), (*ended, under_way), (), None))
        assert [store.facts("electa").first_surfacing(t) for t in (0.0, 50.0, 150.0)] == [50.0, 150.0, None]


class TestMessages:
    def test_what_was_said_comes_back(self, store):
        assert store.notified("unit") == NotificationState()
        speaking = routing.Routing(channels=lambda a: ["mail"], notices=lambda g: True)
        feed(mission(LEGS), speaking=speaking, store=store)
        assert store.notified("unit").surfaced is not None
        assert [a.kind for a in store.alerts()] == ["surfacing"] * 6

    def test_a_message_is_kept_once(self, store):
        for _ in range(2):
            store.post(alert(), ["mail", "slack"], 0.0)
        store.post(alert(title="another text"), ["mail", "phone"], 0.0)
        assert [a.title for a in store.alerts()] == [alert().title]
        assert [u.channel for u in store.undelivered()] == ["mail", "slack", "phone"]

    def test_no_second_row_for_a_channel(self, store):
        store.post(alert(), ["mail"], 0.0)
        with pytest.raises(sqlite3.IntegrityError, match="UNIQUE"):
            store._db.execute("INSERT INTO outbox (alert, channel, incident) VALUES ('a1', 'mail', '')")

    def test_no_row_without_its_message(self, store):
        with pytest.raises(sqlite3.IntegrityError, match="FOREIGN KEY"):
            store._db.execute("INSERT INTO outbox (alert, channel, incident) VALUES ('zz', 'mail', '')")

    def test_a_delivered_message_is_not_sent_again(self, store, path):
        store.post(alert(), ["mail"], 0.0)
        outbox = Outbox(path)
        (row,) = outbox.due(0.0)
        outbox.delivered(row.id, 1.0)
        store.post(alert(), ["mail"], 2.0)
        assert outbox.due(1e9) == [] and store.undelivered() == []


class TestOutbox:
    def made(self, store, path, *alerts: Alert) -> Outbox:
        for a in alerts:
            store.post(a, ["mail"], 0.0)
        return Outbox(path)

    def test_a_thread_keeps_its_order(self, store, path):
        outbox = self.made(store, path, alert("a/0"), alert("a/1"), alert("b/0", incident="other"))
        first = outbox.due(0.0)
        assert [r.alert.id for r in first] == ["a/0", "b/0"]
        outbox.failed(first[0].id, "down", next_try=100.0)
        assert [r.alert.id for r in outbox.due(50.0)] == ["b/0"]
        outbox.delivered(first[0].id, 100.0)
        assert [r.alert.id for r in outbox.due(100.0)] == ["a/1", "b/0"]

    def test_messages_without_a_thread_wait_for_none(self, store, path):
        outbox = self.made(store, path, alert("s/0", incident=""), alert("s/1", incident=""))
        assert [r.alert.id for r in outbox.due(0.0)] == ["s/0", "s/1"]

    def test_attempts_are_counted_with_their_reason(self, store, path):
        outbox = self.made(store, path, alert())
        (row,) = outbox.due(0.0)
        for k in range(3):
            outbox.failed(row.id, f"refused {k}", next_try=float(k))
        assert [(u.alert, u.attempts, u.error) for u in store.undelivered()] == [("a1", 3, "refused 2")]
        assert outbox.due(10.0)[0].attempts == 3

    def test_it_comes_back_as_it_was(self, store, path):
        (row,) = self.made(store, path, alert()).due(0.0)
        assert row.alert == alert() and row.channel == "mail"

    def test_each_has_its_own_connection(self, store, path):
        """The dispatcher's thread and the daemon's write in turn."""
        outbox = self.made(store, path, alert())
        with store.transaction():
            store.record(file("a"), 0.0)
        outbox.delivered(outbox.due(0.0)[0].id, 0.0)
        with store.transaction():
            store.record(file("b"), 0.0)
        outbox.close()
        assert store.undelivered() == []


def test_a_duplicate_is_noted_and_changes_nothing(store):
    made = mission(LEGS)
    feed(made, store=store)
    before = ending(store, "unit")
    again = File("/again", 1, 1, Status.WAITING)
    taken = transaction.process_file(store, again, made[2], GliderParams(), None, 0.0)
    assert taken.file.status == Status.DUPLICATE and "fuller copy" in taken.file.reason
    assert ending(store, "unit") == before and store.counts()[Status.DUPLICATE] == 1


def test_all_errors_are_of_one_kind(path):
    with pytest.raises(GliderwatchError):
        Store.reading(path)
