"""A file that changes between the look at it and its taking: the daemon's own loop, turned by hand."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from pathlib import Path

import pytest

import dinkum
from gliderwatch.config import load
from gliderwatch.model import Segment
from gliderwatch.service.daemon import Daemon
from gliderwatch.slocum.decode import decode
from gliderwatch.slocum.watch import FileChanged
from gliderwatch.store.state_file import File, Status

NAME = "unit_7-2024-250-1-3.sbd"
WHOLE = dinkum.header() + dinkum.cycles(dinkum.rows(60))
PART = WHOLE[: len(WHOLE) // 2]
CONFIG = """
dockserver: {roots: [gliders], cache: [cache], settle_seconds: 1}
state: {path: state.sqlite}
gliders: {unit_7: }
"""


class Hand:
    """A decoder whose results come when they are let go."""

    def __init__(self, caches: Path) -> None:
        self.caches, self.held = caches, list[tuple[Path, Future[Segment]]]()

    def submit(self, path: Path) -> Future[Segment]:
        """The segment to come."""
        self.held.append((path, Future()))
        return self.held[-1][1]

    def read(self) -> Segment:
        """What the file first in line holds now."""
        return decode(self.held[0][0], [self.caches])

    def let_go(self, segment: Segment) -> None:
        """Give the first in line its result."""
        self.held.pop(0)[1].set_result(segment)


class Loop:
    """A daemon that is not let run: its loop is turned by hand, its decoder is in hand."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.inbox, cache = folder / "gliders" / "unit_7" / "from-glider", folder / "cache"
        self.inbox.mkdir(parents=True)
        cache.mkdir()
        (cache / "0abc12ef.cac").write_bytes(dinkum.sensor_list())
        config = folder / "gliderwatch.yml"
        config.write_text(CONFIG, encoding="utf-8")
        self.daemon, self.hand = Daemon(load(config), config, workers=1), Hand(cache)
        monkeypatch.setattr(self.daemon._runtime.decoder, "submit", self.hand.submit)

    def until(self, condition: Callable[[], object]) -> None:
        """Turn the loop until a condition holds."""
        deadline = time.monotonic() + 10.0
        while not condition():
            assert time.monotonic() < deadline, "turned in vain"
            self.daemon._news.put(FileChanged(self.inbox / "nothing.sbd", "unit_7"))  # do not wait
            self.daemon._turn()

    def put(self, content: bytes, change: int) -> Path:
        """Let a whole file come in place of what is there, with another time of change."""
        path, beside = self.inbox / NAME, self.inbox / "beside"
        beside.write_bytes(content)
        os.utime(beside, ns=(change, change))
        beside.rename(path)
        self.daemon._news.put(FileChanged(path, "unit_7"))
        return path

    def row(self) -> File | None:
        """What the ledger says of the file."""
        return self.daemon._store.file(str(self.inbox / NAME))

    def is_taken(self) -> bool:
        """Whether it is said to be taken."""
        row = self.row()
        return row is not None and row.status == Status.TAKEN


@pytest.fixture
def loop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Loop]:
    loop = Loop(tmp_path, monkeypatch)
    yield loop
    loop.daemon._runtime.stop()
    loop.daemon._store.close()
    loop.daemon._lock.end()


def test_a_file_that_grew_while_it_was_decoded_is_decoded_again_and_taken_once(loop: Loop) -> None:
    loop.put(PART, 1_000)
    loop.until(lambda: loop.hand.held)
    path = loop.put(WHOLE, 2_000)
    # The decoder read the whole file, while the ledger would say the size of the part.
    loop.hand.let_go(loop.hand.read())
    loop.until(lambda: loop.hand.held or loop.row())
    assert loop.row() is None, "taken under the size of another state of the file"
    loop.hand.let_go(loop.hand.read())
    loop.until(loop.is_taken)
    row = loop.row()
    assert row is not None
    assert (row.size, row.mtime_ns) == (len(WHOLE), 2_000)
    whole = decode(path, [loop.hand.caches])
    assert whole.completeness == loop.daemon._store.segments.completeness(whole.id)
    for _ in range(5):  # the change is heard of once more; it is no duplicate of itself
        loop.daemon._news.put(FileChanged(path, "unit_7"))
        loop.daemon._turn()
    assert loop.row() == row
    assert not loop.hand.held


def test_a_file_replaced_again_and_again_is_taken_in_its_last_state(loop: Loop) -> None:
    for change in range(1, 6):
        path = loop.put(WHOLE[: len(WHOLE) * change // 5], change)
        loop.until(lambda: loop.hand.held)
        early = loop.hand.read()
        if change < 5:
            loop.put(WHOLE[: len(WHOLE) * (change + 1) // 5], change + 1)
        loop.hand.let_go(early)
    loop.until(loop.is_taken)
    row = loop.row()
    assert row is not None
    assert (row.size, row.mtime_ns) == (len(WHOLE), 5)
    whole = decode(path, [loop.hand.caches])
    assert whole.completeness == loop.daemon._store.segments.completeness(whole.id)


def test_a_file_that_went_while_it_was_decoded_is_taken_all_the_same(loop: Loop) -> None:
    path = loop.put(WHOLE, 1_000)
    loop.until(lambda: loop.hand.held)
    segment = loop.hand.read()
    path.unlink()
    loop.hand.let_go(segment)
    loop.until(loop.is_taken)


def test_a_result_of_another_segment_than_the_header_told_is_not_taken(loop: Loop) -> None:
    path = loop.put(WHOLE, 1_000)
    loop.until(lambda: loop.hand.held)
    other = dinkum.header("unit_7-2024-250-1-4") + dinkum.cycles(dinkum.rows(60))
    loop.put(other[: len(WHOLE)].ljust(len(WHOLE), b"\x1a"), 1_000)  # same size, same time of change
    segment = loop.hand.read()
    path.unlink()
    loop.hand.let_go(segment)
    for _ in range(3):
        loop.daemon._news.put(FileChanged(path, "unit_7"))
        loop.daemon._turn()
    assert loop.row() is None
    assert not loop.daemon._store.segments.is_held("unit_7", "unit_7-2024-250-1-4")


def test_a_file_that_comes_does_not_wait_for_a_folder_full_of_bad_ones(loop: Loop) -> None:
    for number in range(1000):
        (loop.inbox / f"unit_7-2024-250-2-{number}.sbd").touch()
    loop.until(lambda: loop.daemon._intake._settled)
    loop.put(WHOLE, 1_000)
    loop.until(lambda: loop.hand.held)
    assert len(loop.daemon._intake._settled) > 500, "all the others were looked at first"
    loop.hand.let_go(loop.hand.read())
    loop.until(loop.is_taken)
    loop.until(lambda: not loop.daemon._intake._settled)
    assert len(loop.daemon._store.files(Status.QUARANTINED)) == 1000


def test_a_file_that_grew_without_news_before_it_was_looked_at_settles_anew(loop: Loop) -> None:
    """A busy machine may bring the news of a growing file late: still for a second is still on disk."""
    path = loop.inbox / "02500003.sbd"
    path.write_bytes(PART)
    loop.daemon._news.put(FileChanged(path, "unit_7"))
    settling = loop.daemon._runtime.settling
    loop.until(lambda: settling.next_deadline(time.monotonic()) is not None)
    loop.daemon._runtime.watcher.stop()  # from here on no news comes
    loop.until(lambda: (settling.next_deadline(time.monotonic()) or 0.0) < 0.3)
    grown = time.monotonic()
    path.write_bytes(WHOLE)
    loop.until(lambda: loop.hand.held)
    assert time.monotonic() > grown + 0.9, "taken as it was a second ago"


def test_a_file_that_is_gone_is_not_remembered_for_ever(loop: Loop) -> None:
    """Else a service of years would keep the name of each file that the dockserver has cleared away."""
    path = loop.put(WHOLE, 1_000)
    loop.until(lambda: loop.hand.held)
    loop.hand.let_go(loop.hand.read())
    loop.until(loop.is_taken)
    settling = loop.daemon._runtime.settling
    loop.daemon._scan()
    assert settling.passed(path) is not None
    path.unlink()
    loop.daemon._scan()
    assert settling.passed(path) is None
