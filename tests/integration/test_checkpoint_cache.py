"""Many files of one glider at hand: few checkpoints are written, and all ends as if each had been."""

import pytest

from gliderwatch.errors import Quarantine
from gliderwatch.model import SegmentId
from gliderwatch.params import GliderParams
from gliderwatch.service import transaction
from gliderwatch.store.segments import RECENT, Segments
from gliderwatch.store.state_file import File, Status, Store
from missions import Leg, ending, feed, mission

LEGS = [Leg(heading=0.4 * k) for k in range(24)]
FINAL = SegmentId(float("inf"), "unit", "")


@pytest.fixture
def path(tmp_path):
    return tmp_path / "state.sqlite"


def fed(store: Store, segments: list, behind: int) -> Store:
    with store.followed_by(behind):
        return feed(segments, store=store)


def checkpoints(store: Store) -> int:
    return store._db.execute("SELECT count(checkpoint) FROM segments").fetchone()[0]


def test_it_ends_as_if_each_had_been_written(path):
    made = mission(LEGS)
    store = fed(Store.open(path), made[:-2], RECENT)
    assert checkpoints(store) < len(made) / 3
    feed(made[-2:], store=store)
    assert ending(store, "unit") == ending(feed(made), "unit")


def test_what_was_in_memory_alone_is_remade_after_the_end_of_the_process(path):
    made = mission(LEGS)
    fed(Store.open(path), made[:-1], RECENT).close()
    assert ending(feed(made[-1:], store=Store.open(path)), "unit") == ending(feed(made), "unit")


@pytest.mark.parametrize("behind", [0, RECENT])
def test_a_file_from_before_finds_no_stale_checkpoint(path, behind):
    """Checkpoints of a first life, then one that comes late with many behind it, then one still later."""
    made = mission(LEGS)
    store = feed([s for k, s in enumerate(made) if k not in (3, 12, 23)], store=Store.open(path))
    fed(store, [made[3]], RECENT)
    fed(store, [made[12]], behind)
    store.close()
    store = feed([made[23]], store=Store.open(path))
    assert ending(store, "unit") == ending(feed(made), "unit")


def test_what_was_taken_back_is_not_gone_on_from(path, monkeypatch):
    made = mission(LEGS)
    store = fed(Store.open(path), made[:10], RECENT)
    with monkeypatch.context() as patch:
        patch.setattr(Segments, "thin", lambda *_: (_ for _ in ()).throw(Quarantine("broken")))
        with pytest.raises(Quarantine), store.followed_by(RECENT):
            file = File("/x", 1, 1, Status.WAITING, "unit", made[10].id.name)
            transaction.process_file(store, file, made[10], GliderParams(), None, 0.0)
    feed(made[11:], store=store)
    assert ending(store, "unit") == ending(feed([*made[:10], *made[11:]]), "unit")


def test_the_last_is_on_the_disk_and_the_ones_before_it_need_not_be(path):
    store = Store.open(path)
    mode = lambda: store._db.execute("PRAGMA synchronous").fetchone()[0]  # noqa: E731
    with store.followed_by(1):
        assert mode() == 1  # NORMAL: a power cut may take it back, whole
    assert mode() == 2
    with store.followed_by(0):
        assert mode() == 2


def test_the_gliders_are_found_one_after_another(path):
    store = Store.open(path)
    assert store.gliders() == []
    for name in ("b", "a", "c"):
        for k in range(2):
            row = (name, k, f"{name}-{k}", "", 0, k, 0, 0, b"", None)
            store._db.execute("INSERT INTO segments VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)", row)
    assert store.gliders() == ["a", "b", "c"]
