"""What is old is removed: never what is open, what is to be told, or what a late file still needs."""

import json
import shutil
import zlib
from contextlib import contextmanager
from dataclasses import replace

import pytest

from acceptance.angus import FILES, angus, put, taken
from acceptance.support import Daemon, until
from alert_support import alert
from gliderwatch.incidents.notifications import NotificationState
from gliderwatch.model import SegmentId
from gliderwatch.params import GliderParams
from gliderwatch.pipeline import GliderState
from gliderwatch.service import transaction
from gliderwatch.service.daemon import DAY, HOUR, Retention
from gliderwatch.service.routing import Routing, post_alerts
from gliderwatch.store import codec, conversion, retention
from gliderwatch.store.conversion import moved
from gliderwatch.store.maintenance import damage
from gliderwatch.store.outbox import Outbox
from gliderwatch.store.state_file import File, Status, Store
from missions import Leg, ending, feed, mission, opened

PARAMS = GliderParams(speed_min=0.2, speed_max=0.4, speed_learnt=False)
ALL = Routing(channels=lambda alert: ["mail"], notices=lambda glider: False)
HEALTHY, SICK = Leg(speed=0.3), Leg(speed=0.08)
LEGS = [SICK if 4 <= k < 8 else replace(HEALTHY, heading=0.3 * k) for k in range(90)]
MORE = [*LEGS, *(replace(HEALTHY, heading=1.0 + k) for k in range(4))]
CUT = opened(LEGS, 70)
TABLES = ("segments", "assessments", "incidents", "expected", "heard", "said", "alerts", "outbox", "files")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A state file of a mission with an incident that is over, told and delivered."""
    path = tmp_path_factory.mktemp("whole") / "state.sqlite"
    store = feed(mission(LEGS), PARAMS, ALL, Store.open(path))
    store._db.execute("UPDATE outbox SET delivered_at = 1.0")
    store._db.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    assert [i.cleared_at is not None for i in store.incidents("unit")] == [True]
    store.close()
    return path


@pytest.fixture
def path(whole, tmp_path):
    return shutil.copy(whole, tmp_path / "state.sqlite")


@pytest.fixture
def store(path):
    opened = Store.open(path)
    yield opened
    opened.close()


@pytest.fixture(scope="module")
def uncut(whole, tmp_path_factory):
    """The same with four segments more, `MORE`, and nothing ever removed."""
    path = shutil.copy(whole, tmp_path_factory.mktemp("uncut") / "state.sqlite")
    full = feed(mission(MORE)[len(LEGS) :], PARAMS, ALL, Store.open(path))
    yield full
    full.close()


def clear(store: Store, cut: float = CUT) -> int:
    return sum(store.remove(cut))


def content(store: Store) -> dict[str, list]:
    return {name: sorted(map(tuple, store._db.execute(f"SELECT * FROM {name}"))) for name in TABLES}


def tail(store: Store, since: float) -> list:
    return [a for a in store.assessments("unit") if a.t_dive >= since]


def test_what_comes_after_is_as_if_nothing_had_been_removed(store, uncut):
    assert clear(store) > 60
    feed(mission(MORE)[len(LEGS) :], PARAMS, ALL, store)
    assert ending(store, "unit").state == ending(uncut, "unit").state
    assert tail(store, CUT) == tail(uncut, CUT) != []
    assert len(store.assessments("unit")) < len(uncut.assessments("unit")) / 2


def test_a_late_file_finds_the_state_before_it(whole):
    made, late = mission(LEGS), 71
    store = feed([s for k, s in enumerate(made) if k != late], PARAMS, ALL)
    assert clear(store) > 0
    feed([made[late]], PARAMS, ALL, store)
    full = Store.reading(whole)
    assert ending(store, "unit").state == ending(full, "unit").state
    assert tail(store, CUT) == tail(full, CUT)


def test_a_file_that_is_too_late_is_known_as_such(store):
    made = mission(LEGS)
    assert not any(store.is_past(s.id) for s in made)
    assert not store.is_past(SegmentId(0.0, "unit", "earlier than all"))
    clear(store)
    held = [row[0] for row in store._db.execute("SELECT name FROM segments ORDER BY opened_at")]
    first = next(s.id for s in made if s.id.name == held[0])
    past = [s.id.name for s in made if store.is_past(s.id)]
    assert past == [s.id.name for s in made[: -len(held) + 1]]  # the first that is held is as it will be
    assert store.is_past(replace(first, opened_at=first.opened_at + 60.0))
    assert not store.is_past(SegmentId(0.0, "another", "name"))


def test_the_first_checkpoint_is_not_thinned_out(store):
    clear(store)
    first = store._db.execute("SELECT name FROM segments ORDER BY opened_at LIMIT 1").fetchone()[0]
    more = [*LEGS, *(replace(HEALTHY, heading=1.0 + k) for k in range(64))]
    feed(mission(more)[len(LEGS) :], PARAMS, ALL, store)
    sql = "SELECT checkpoint IS NOT NULL FROM segments WHERE name = ?"
    assert store._db.execute(sql, (first,)).fetchone()[0] == 1


def test_a_first_checkpoint_that_is_gone_keeps_all_until_the_next_file_makes_it_again(store):
    """As a migration left it that set all checkpoints to NULL: no error in each hour's removal."""
    made = mission([*LEGS, replace(HEALTHY, heading=1.0)])
    clear(store)
    store._db.execute("UPDATE segments SET checkpoint = NULL")
    before = content(store)
    assert clear(store) == 0 and content(store) == before
    feed(made[len(LEGS) :], PARAMS, ALL, store)
    first = store._db.execute("SELECT checkpoint FROM segments ORDER BY opened_at LIMIT 1").fetchone()[0]
    assert first is not None
    clear(store)


def test_a_state_that_changed_its_shape_is_gone_on_from_as_if_it_had_not(store, uncut, monkeypatch):
    """The first segment that is kept holds what cannot be made again: all that was learnt before it."""
    clear(store)
    expected, _ = uncut.segments.resume(SegmentId(float("inf"), "unit", ""))
    for name, record in store._db.execute("SELECT name, checkpoint FROM segments").fetchall():
        if record is not None:
            data = json.loads(zlib.decompress(record))["data"]
            data["older"] = {"after": data.pop("settled"), "dive": data.pop("last")}
            old = zlib.compress(json.dumps({"v": 1, "data": data}).encode())
            store._db.execute("UPDATE segments SET checkpoint = ? WHERE name = ?", (old, name))

    def flat(state):
        moved(state, "older.after", "settled")
        moved(state, "older.dive", "last")
        return state

    monkeypatch.setattr(conversion, "CONVERTERS", {GliderState: (flat,)})
    assert clear(store, CUT + DAY) > 0, "the removal reads the first checkpoint"
    feed(mission(MORE)[len(LEGS) :], PARAMS, ALL, store)
    assert ending(store, "unit").state == codec.encode(expected)
    assert tail(store, CUT + DAY) == tail(uncut, CUT + DAY) != []


def test_an_incident_that_is_over_goes_with_what_was_said_of_it(store):
    told = len(store.alerts())
    assert told == 2  # the alarm and the all-clear
    clear(store)
    assert store.incidents("unit") == [] and store.notified("unit").threads == () and store.alerts() == []
    assert transaction.notify_pilots(store, "unit", PARAMS, ALL, 0.0) == ()
    assert store._db.execute("SELECT count(*) FROM outbox").fetchone()[0] == 0


def test_an_open_incident_keeps_all_that_is_since():
    legs = [HEALTHY if k < 20 else SICK for k in range(90)]
    store = feed(mission(legs), PARAMS, ALL)
    store._db.execute("UPDATE outbox SET delivered_at = 1.0")
    before, (incident,) = content(store), store.incidents("unit")
    assert incident.cleared_at is None and incident.since < CUT
    clear(store)
    after = content(store)
    kept = ("incidents", "said", "alerts", "outbox")
    assert {name: after[name] for name in kept} == {name: before[name] for name in kept}
    assert tail(store, incident.since) == [a for a in store.assessments("unit") if a.t_dive >= incident.since]
    assert len(tail(store, incident.since)) >= len(legs) - 21
    assert min(row[1] for row in after["segments"]) < incident.since
    assert transaction.notify_pilots(store, "unit", PARAMS, ALL, 0.0) == ()


def test_an_end_that_was_not_told_keeps_its_incident(store):
    said = store.notified("unit")
    (thread,) = said.threads
    open_ = replace(thread, reported=replace(thread.reported, cleared_at=None))
    with store.transaction():
        post_alerts(store, "unit", replace(said, threads=(open_,)), (), lambda alert: (), 0.0)
    clear(store)
    assert len(store.incidents("unit")) == 1
    assert [a.kind for a in transaction.notify_pilots(store, "unit", PARAMS, ALL, 0.0)] == ["all_clear"]


def test_what_came_lately_is_kept_whatever_its_clock_says(store):
    """A glider whose clock stands in 1970, and an archive that was taken in yesterday."""
    store._db.execute("UPDATE heard SET at = ?", (CUT + 1,))
    before = content(store)
    assert clear(store) == 0 and content(store) == before


def test_messages_that_wait_and_those_to_the_operator_stay(store, path):
    with store.transaction():
        store.post(alert("unit/0", glider="unit", incident=""), ["mail"], 0.0)
        store.post(alert("operator/disk/1", glider="", incident=""), ["mail"], 0.0)
    outbox = Outbox(path)
    outbox.delivered(next(row.id for row in outbox.due(1.0) if row.alert.glider == ""), 2.0)
    outbox.close()
    clear(store)
    assert [a.id for a in store.alerts()] == ["unit/0", "operator/disk/1"]
    assert [u.alert for u in store.undelivered()] == ["unit/0"]


def test_files_that_are_there_or_whose_folder_is_away_stay_known(store, tmp_path):
    folder = tmp_path / "from-glider"
    folder.mkdir()
    (folder / "there.sbd").touch()
    paths = [folder / "there.sbd", folder / "gone.sbd", tmp_path / "away" / "unknown.sbd"]
    with store.transaction():
        store._db.execute("DELETE FROM files")
        for p in paths:
            store.record(File(str(p), 1, 1, Status.TAKEN, "unit", p.stem), CUT - 1)
        store.record(File(str(folder / "new.sbd"), 1, 1, Status.TAKEN, "unit", "new"), CUT + 1)
        store.record(File(str(folder / "wait.sbd"), 1, 1, Status.WAITING, "unit", "wait"), CUT - 1)
    clear(store)
    left = {p.path.rpartition("/")[2] for p in store.files(*Status)}
    assert left == {"there.sbd", "unknown.sbd", "new.sbd", "wait.sbd"}


@pytest.mark.slow
def test_an_interruption_anywhere_leaves_a_good_store(whole, store, tmp_path):
    """After each step, and inside of each: it is whole, a file that comes then leads to the same, and the
    next run ends as one that was not interrupted."""
    clear(store)
    aim, made = content(store), mission([*LEGS, HEALTHY])
    after = ending(feed(made[-1:], PARAMS, ALL, store), "unit").state
    steps = 0
    while True:
        path = shutil.copy(whole, tmp_path / f"{steps}.sqlite")
        interrupted = Store.open(path)
        done = stopped_in(interrupted, steps)
        interrupted.close()
        assert damage(path) is None
        again = Store.open(path)
        if steps % 5 == 0:  # a file that comes before the next run
            copy = Store.open(shutil.copy(path, tmp_path / "copy.sqlite"))
            assert ending(feed(made[-1:], PARAMS, ALL, copy), "unit").state == after
            copy.close()
        clear(again)
        assert content(again) == aim
        again.close()
        path.unlink()
        if done:
            break
        steps += 1
    assert steps > 5


def stopped_in(store: Store, n: int) -> bool:
    """Remove up to an error at the end of transaction `n`, before its commit; whether there was none."""
    count = 0

    @contextmanager
    def transaction():
        nonlocal count
        with store.transaction():
            yield
            count += 1
            if count > n:
                raise KeyboardInterrupt

    try:
        for _ in retention.remove(store._db, transaction, store.gliders(), CUT):
            pass
    except KeyboardInterrupt:
        return False
    return True


def fill(store: Store) -> None:
    """Make the greater part of the file free pages."""
    store._db.execute("CREATE TABLE filling (data BLOB)")
    store._db.execute("INSERT INTO filling VALUES (zeroblob(20000000))")
    store._db.execute("DROP TABLE filling")
    assert store._db.execute("PRAGMA freelist_count").fetchone()[0] > 3000


def compact(store: Store) -> int:
    """Remove nothing, but give room back; in how many steps beside the one through the ledger."""
    steps = len(list(retention.remove(store._db, store.transaction, (), 0.0))) - 1
    assert store._db.execute("PRAGMA freelist_count").fetchone()[0] == 0
    assert store._db.execute("PRAGMA page_count").fetchone()[0] < 2000
    return steps


def test_the_room_is_given_back_page_by_page(store, path, monkeypatch):
    """However large the file is: this takes no longer at a time than any other step."""
    monkeypatch.setattr(retention, "_LARGEST", 0.0)
    before = content(store)
    fill(store)
    store._db.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    large = path.stat().st_size
    assert compact(store) > 3
    store._db.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    assert path.stat().st_size < large - 19e6
    assert content(store) == before
    assert damage(path) is None


def test_a_file_of_an_earlier_making_is_written_anew_where_that_is_cheap(store, path, monkeypatch):
    store._db.executescript("PRAGMA journal_mode = DELETE; PRAGMA auto_vacuum = NONE; VACUUM")
    store.close()
    store = Store.open(path)
    assert store._db.execute("PRAGMA auto_vacuum").fetchone()[0] == 0
    before = content(store)
    fill(store)
    with monkeypatch.context() as small:
        small.setattr(retention, "_LARGEST", 0.0)
        list(retention.remove(store._db, store.transaction, (), 0.0))
        assert store._db.execute("PRAGMA freelist_count").fetchone()[0] > 3000
    assert compact(store) == 1
    fill(store)
    assert compact(store) > 3  # from then on page by page
    assert content(store) == before
    store.close()
    assert damage(path) is None


class TestDaily:
    def begun(self, steps: list[list[int]], cuts: list[float]) -> Retention:
        def begin(cut: float):
            cuts.append(cut)
            yield from steps.pop(0)

        return Retention(begin, 1e9, 0.0)

    def test_an_hour_after_the_start_then_daily_step_by_step(self):
        cuts: list[float] = []
        made = self.begun([[1, 2], []], cuts)
        assert made.pause(0.0) == HOUR
        made.turn(100.0, 1e9 + 10, 10.0)
        assert cuts == []
        for _ in range(3):
            assert made.pause(HOUR) == 0.0
            made.turn(100.0, 1e9 + HOUR, HOUR)
        assert cuts == [1e9 + HOUR - 100 * DAY] and made.pause(HOUR) == DAY
        made.turn(100.0, 1e9 + HOUR + DAY, HOUR + DAY)
        assert len(cuts) == 2

    def test_nothing_is_removed_where_all_is_kept(self):
        cuts: list[float] = []
        self.begun([], cuts).turn(None, 1e9 + HOUR, HOUR)
        assert cuts == []

    def test_a_clock_that_has_jumped_removes_nothing(self):
        """Else years would be gone by a machine that wakes up in 2040."""
        cuts: list[float] = []
        made = self.begun([[]], cuts)
        made.turn(100.0, 2e9, HOUR)
        assert cuts == [] and made.pause(HOUR) == DAY
        made.turn(100.0, 2e9 + DAY, HOUR + DAY)
        assert len(cuts) == 1

    def test_after_an_error_it_begins_anew(self):
        def broken(cut: float):
            yield 1
            raise OSError

        made = Retention(broken, 1e9, 0.0)
        made.turn(100.0, 1e9 + HOUR, HOUR)
        with pytest.raises(OSError):
            made.turn(100.0, 1e9 + HOUR, HOUR)
        assert made.pause(HOUR) == HOUR


def test_said_of_a_glider_without_incidents_is_left_alone(store):
    with store.transaction():
        post_alerts(store, "unit", replace(store.notified("unit"), surfaced=5.0), (), lambda alert: (), 0.0)
    said = NotificationState(surfaced=5.0, neighbours=store.notified("unit").neighbours)
    clear(store)
    assert store.notified("unit") == said


def test_the_daemon_notes_a_file_that_is_too_late(tmp_path):
    """Its own state before it is gone: taken, it would begin the glider anew."""
    site = angus(tmp_path)
    with Daemon(site) as daemon:
        put(site, *FILES)
        taken(site, *FILES)
        daemon.stop()
    store = Store.open(site.state)
    store._db.execute("UPDATE heard SET at = 0")
    assert sum(store.remove(2e9)) > 0
    before = store.assessments("angus")
    store.close()
    with Daemon(site):
        site.put("angus", "again.sbd", FILES[0].data)
        until(lambda: site.statuses("again.sbd") == [Status.DUPLICATE], "noted")
    assert "older than what state.keep_days keeps" in site.files()["again.sbd"].reason
    store = Store.reading(site.state)
    assert store.assessments("angus") == before
    store.close()
