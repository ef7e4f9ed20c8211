"""What is long in an input is processed while nobody's write waits for it, and is committed only as it would
be then."""

from dataclasses import replace

import pytest

from gliderwatch.errors import NotAssessed
from gliderwatch.incidents.acknowledgement import acknowledge_thread
from gliderwatch.model import Severity
from gliderwatch.params import GliderParams
from gliderwatch.service import transaction
from gliderwatch.service.run import processed
from gliderwatch.store.state_file import File, Status, Store
from missions import Leg, cut, ending, feed, mission

MADE = mission([Leg(heading=0.4 * k) for k in range(10)])


@pytest.fixture
def path(tmp_path):
    return tmp_path / "state.sqlite"


def take(store, segment):
    file = File(f"/{segment.id.name}", 1, 1, Status.WAITING, "unit", segment.id.name)
    return transaction.process_file(store, file, segment, GliderParams(), None, 0.0)


def meanwhile(monkeypatch, happens):
    """Let something happen once, while the next run is processed; how long each run is."""
    runs, todo = [], [happens]

    def interrupted(run, *arguments):
        runs.append(len(run.segments))
        done = processed(run, *arguments)
        if todo:
            todo.pop()()
        return done

    monkeypatch.setattr(transaction, "processed", interrupted)
    return runs


@pytest.mark.parametrize("late", [False, True], ids=["next", "late"])
def test_others_write_while_a_run_is_processed_and_neither_is_lost(path, monkeypatch, late):
    ack = acknowledge_thread("incident", Severity.WARNING, "Ann", "mine", 5.0)
    other = [*MADE[:3], *MADE[4:]] if late else MADE[:-1]
    store = feed(other, store=Store.open(path))

    def acknowledged():
        beside = Store.open(path)  # where the file were locked, it would wait for it and fail
        beside._db.execute("PRAGMA busy_timeout = 0")
        with beside.transaction():
            beside.notes.acknowledge("unit", ack)
        beside.close()

    runs = meanwhile(monkeypatch, acknowledged)
    take(store, MADE[3] if late else MADE[-1])
    assert runs == [len(MADE) - 3 if late else 1]
    assert store.notes.acks("unit") == {"incident": ack}
    assert ending(store, "unit") == ending(feed(MADE), "unit")


def test_what_was_processed_upon_another_state_is_processed_again(path, monkeypatch):
    """Another file of the glider comes while one is processed: not merged, but done again."""
    store = feed(MADE[:-2], store=Store.open(path))
    runs = meanwhile(monkeypatch, lambda: take(store, MADE[-2]))
    take(store, MADE[-1])
    assert runs == [1, 1, 1]
    assert ending(store, "unit") == ending(feed(MADE), "unit")


def test_a_fuller_copy_that_came_meanwhile_is_not_lost_to_what_was_processed_without_it(path, monkeypatch):
    part = replace(cut(MADE[-2], MADE[-2].last_t - 600.0), completeness=(0, 1, ""))
    store = feed([*MADE[:-2], part], store=Store.open(path))
    runs = meanwhile(monkeypatch, lambda: take(store, MADE[-2]))
    take(store, MADE[-1])
    assert runs == [1, 1, 1]
    assert ending(store, "unit") == ending(feed(MADE), "unit")


def test_a_segment_that_cannot_be_assessed_changes_nothing(path, monkeypatch):
    store = feed(MADE[:-1], store=Store.open(path))
    before = ending(store, "unit")
    monkeypatch.setattr("gliderwatch.service.run.process", lambda *_: 1 / 0)
    with pytest.raises(NotAssessed):
        take(store, MADE[-1])
    assert ending(store, "unit") == before
    assert store.file(f"/{MADE[-1].id.name}") is None
