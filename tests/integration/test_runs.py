"""A long list of files: a worker processes runs of them, the daemon commits; its own loop, turned by hand."""

from __future__ import annotations

import pickle
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest
from pebble import ProcessExpired

from gliderwatch.config import load
from gliderwatch.errors import NotAssessed, Retry
from gliderwatch.model import Segment
from gliderwatch.processes import NotBegun
from gliderwatch.service import backlog as backlog_module
from gliderwatch.service import intake as intake_module
from gliderwatch.service.daemon import Daemon
from gliderwatch.service.run import Run, processed_for_another, why_not
from gliderwatch.simulate.delivery import arrivals, write_cache
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Scenario
from gliderwatch.slocum.decode import decode
from gliderwatch.store.state_file import Status
from missions import Ending, ending, feed

MISSION = simulate(Scenario(seed=5, glider="unit", days=4.0))
FILES = list(arrivals(MISSION))
CONFIG = """
dockserver: {roots: [gliders], cache: [cache], settle_seconds: 1}
state: {path: state.sqlite}
gliders: {unit: }
"""


@pytest.fixture(scope="module")
def segments(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Segment]:
    """By the names of their files."""
    folder = tmp_path_factory.mktemp("decoded")
    write_cache(folder, MISSION)
    for file in FILES:
        (folder / file.name).write_bytes(file.data)
    return {file.name: decode(folder / file.name, [folder]) for file in FILES}


def expired(number: int) -> ProcessExpired:
    error = ProcessExpired("abnormal termination")
    error.exitcode = -number
    return error


def done(work: Callable[..., Any], *arguments: Any, **named: Any) -> Future[Any]:
    future: Future[Any] = Future()
    try:
        future.set_result(work(*arguments, **named))
    except Exception as error:
        future.set_exception(error)
    return future


class Loop:
    """A daemon that is not let run; it decodes and processes here, what it sends going through pickle."""

    def __init__(self, folder: Path, segments: dict[str, Segment], monkeypatch: pytest.MonkeyPatch) -> None:
        self.segments, inbox = list(segments.values()), folder / "gliders" / "unit" / "from-glider"
        inbox.mkdir(parents=True)
        write_cache(folder / "cache", MISSION)
        self.paths = [inbox / file.name for file in FILES]
        for path, file in zip(self.paths, FILES, strict=True):
            path.write_bytes(file.data)
        config = folder / "gliderwatch.yml"
        config.write_text(CONFIG, encoding="utf-8")
        self.daemon, self.runs = Daemon(load(config), config, workers=1), list[int]()
        self.before: Callable[[Run], object] = lambda run: None
        runtime = self.daemon._runtime
        monkeypatch.setattr(backlog_module, "LONG", 4)
        monkeypatch.setattr(runtime.decoder, "submit", lambda path: done(segments.get, path.name))
        monkeypatch.setattr(runtime.workers_of_runs, "submit", lambda *sent: done(self._processed, *sent))

    def _processed(self, *sent: Any) -> Any:
        run, params, kept = pickle.loads(pickle.dumps(sent))
        self.runs.append(len(run.segments))
        self.before(run)
        return pickle.loads(pickle.dumps(processed_for_another(run, params, kept)))

    def take_all(self) -> Ending:
        """Turn the loop until nothing is at hand; what is known then."""
        deadline = time.monotonic() + 60.0
        while not self.daemon._caught_up or sum(self.daemon._store.counts().values()) < len(FILES):
            assert time.monotonic() < deadline, "turned in vain"
            self.daemon._turn()
        return ending(self.daemon._store, "unit")


@pytest.fixture
def loop(tmp_path: Path, segments: dict[str, Segment], monkeypatch: pytest.MonkeyPatch) -> Iterator[Loop]:
    loop = Loop(tmp_path, segments, monkeypatch)
    yield loop
    loop.daemon._runtime.stop()
    loop.daemon._store.close()
    loop.daemon._lock.end()


def one_by_one(loop: Loop, but: int = -1) -> Ending:
    return ending(feed([one for n, one in enumerate(loop.segments) if n != but]), "unit")


def test_runs_end_as_each_file_by_itself(loop: Loop) -> None:
    assert loop.take_all() == one_by_one(loop)
    assert loop.runs[0] == 16 and sum(loop.runs) >= len(FILES) - 3


def test_a_run_that_does_not_hold_any_more_is_processed_again(loop: Loop) -> None:
    """As where a call came meanwhile: none of what it led to is kept."""

    def interfere(_run: Run) -> None:
        loop.before = lambda run: None
        with loop.daemon._store.transaction():
            loop.daemon._store.segments.changed("unit")

    loop.before = interfere
    committed = list[bool]()
    process_run = intake_module.transaction.process_run

    def noted(*arguments: Any) -> Any:
        outcome = process_run(*arguments)
        committed.append(outcome is not None)
        return outcome

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(intake_module.transaction, "process_run", noted)
        assert loop.take_all() == one_by_one(loop)
    assert committed[:2] == [False, True]


def test_a_worker_that_is_killed_costs_no_file(loop: Loop) -> None:
    def end_once(_run: Run) -> None:
        loop.before = lambda run: None
        raise expired(9)

    loop.before = end_once
    assert loop.take_all() == one_by_one(loop)
    assert loop.runs[:17] == [16] + [1] * 16


@pytest.mark.parametrize("end", [expired(9), NotBegun()], ids=["at work", "before it began"])
def test_what_a_killed_process_had_to_assess_is_tried_again(end: Exception) -> None:
    assert isinstance(why_not(end), Retry)
    assert isinstance(why_not(expired(11)), NotAssessed)


def test_of_a_run_one_file_that_cannot_be_processed_is_left_out_alone(loop: Loop) -> None:
    bad = loop.segments[5].id.name

    def hang(run: Run) -> None:
        if any(segment.id.name == bad for segment in run.segments):
            raise TimeoutError

    loop.before = hang
    assert loop.take_all() == one_by_one(loop, but=5)
    (file,) = loop.daemon._store.files(Status.QUARANTINED)
    assert file.path == str(loop.paths[5]) and "took longer than" in file.reason


def test_an_unmute_that_is_written_after_the_look_at_its_time_is_seen(
    loop: Loop, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The command had to wait for the state file."""
    now, store, intake, seen = time.time(), loop.daemon._store, loop.daemon._intake, list[str]()
    monkeypatch.setattr(intake, "_notify_if_last", seen.append)
    with store.transaction():
        store.notes.mute("unit", now + 7200.0, now - 60.0)
    intake.notify_unmuted(now + 1.0)
    assert seen == []
    with store.transaction():
        store.notes.unmute("unit", now - 10.0)
    intake.notify_unmuted(now + 2.0)
    assert seen == ["unit"]
