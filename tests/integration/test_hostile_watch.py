"""Watching when the system gives up: limits, a queue that overflows, dead threads, slow shares."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from queue import Empty, Queue

import pytest
from watchdog.observers import inotify, inotify_c
from watchdog.observers.api import BaseObserver
from watchdog.observers.polling import PollingObserverVFS

import dinkum
from gliderwatch.errors import Quarantine, Retry
from gliderwatch.ingest import watch
from gliderwatch.ingest.header import read_header, read_regular
from gliderwatch.ingest.watch import Change, EventsLost, FileChanged, Watcher

NAME = "electa-2022-308-3-2.sbd"
QUEUE = Path("/proc/sys/fs/inotify/max_queued_events")


class Place:
    """A root with one glider, a watcher on it, and its queue."""

    def __init__(self, folder: Path) -> None:
        self.root, self.queue, self.heard = folder / "gliders", Queue[Change](), set[Change]()
        self.inbox = self.root / "electa" / "from-glider"
        self.inbox.mkdir(parents=True)
        self.watcher = Watcher([self.root], {}, [], self.queue, poll_seconds=0.05)

    def hears(self, path: Path, seconds: float = 5.0) -> bool:
        """Whether news of a file comes, within some seconds; it is written until then."""
        change, deadline, again = FileChanged(path, path.parents[1].name), time.monotonic() + seconds, 0.0
        while (now := time.monotonic()) < deadline:
            if now >= again:
                path.write_bytes(b"data")
                again = now + 0.3
            with suppress(Empty):
                news = self.queue.get(timeout=0.05)
                self.heard.add(news)
                if news == change:
                    return True
        return False

    def tells(self, news: Change) -> bool:
        """Whether some news has come."""
        with suppress(Empty):
            while True:
                self.heard.add(self.queue.get_nowait())
        return news in self.heard


@pytest.fixture
def place(tmp_path: Path) -> Iterator[Place]:
    place = Place(tmp_path)
    yield place
    place.watcher.stop()


def wait(condition: Callable[[], object], seconds: float = 10.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


# --------------------------------------------------------------------------- limits


def refuse(number: int) -> Callable[..., object]:
    def refused(*_: object, **__: object) -> object:
        raise OSError(number, "inotify limit reached")

    return refused


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EMFILE])
def test_folders_are_polled_where_inotify_has_no_instance_left(
    place: Place, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    monkeypatch.setattr(inotify_c.InotifyFD, "_create_inotify_fd", refuse(number))
    place.watcher.start()
    assert place.watcher.alive()
    (problem,) = place.watcher.problems
    assert "polled" in problem
    assert "fs.inotify.max_user_watches" in problem
    assert place.hears(place.inbox / NAME)


def test_folders_are_polled_where_the_observer_cannot_watch_a_root(
    place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(inotify_c.InotifyFD, "add_callback", refuse(errno.ENOSPC))
    place.watcher.start()
    assert place.watcher.alive()
    assert str(place.root) in place.watcher.problems[0]
    assert place.hears(place.inbox / NAME)


def test_folders_are_polled_where_a_sub_folder_is_left_out_without_a_word(
    place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Watchdog passes over a sub-folder that it cannot watch: one more try tells that the limit is met."""
    real = inotify_c.inotify_add_watch

    def limited(instance: int, path: bytes, mask: int) -> int:
        if path != os.fsencode(place.root):
            inotify_c.ctypes.set_errno(errno.ENOSPC)
            return -1
        return real(instance, path, mask)

    for module in (inotify_c, watch):
        monkeypatch.setattr(module, "inotify_add_watch", limited)
    place.watcher.start()
    assert "limit" in place.watcher.problems[0]
    assert place.hears(place.inbox / NAME)


def test_polling_lasts_over_a_rescan_and_ends_with_a_restart(
    place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as limited:
        limited.setattr(inotify_c.InotifyFD, "_create_inotify_fd", refuse(errno.EMFILE))
        place.watcher.start()
    place.watcher.refresh()
    assert "polled" in place.watcher.problems[0]
    place.watcher.restart()
    assert place.watcher.problems == ()
    assert not isinstance(place.watcher._observer, PollingObserverVFS)
    assert place.hears(place.inbox / NAME)


@pytest.mark.parametrize(("limit", "polled"), [("watches", True), ("instances", True), (None, False)])
def test_the_limits_of_the_kernel_itself(tmp_path: Path, limit: str | None, polled: bool) -> None:
    """In a user namespace, which has limits of its own."""
    for number in range(10):
        (tmp_path / f"g{number}" / "from-glider").mkdir(parents=True)
    script = (
        "import sys; from queue import Queue; from gliderwatch.ingest.watch import Watcher\n"
        "watcher = Watcher([sys.argv[1]], {}, [], Queue()); watcher.start()\n"
        "print(watcher.alive(), *watcher.problems); watcher.stop()\n"
    )
    lower = f"echo {3 if limit == 'watches' else 0} > /proc/sys/user/max_inotify_{limit} && " if limit else ""
    unshare = shutil.which("unshare")
    if (
        unshare is None
        or subprocess.run([unshare, "-Ur", "sh", "-c", f"{lower}true"], check=False).returncode
    ):
        pytest.skip("no user namespaces here")
    run = subprocess.run(
        [unshare, "-Ur", "sh", "-c", f'{lower}exec "$@"', "sh", sys.executable, "-c", script, tmp_path],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert run.stdout.startswith("True"), run.stderr
    assert ("polled" in run.stdout) is polled


# --------------------------------------------------------------------------- overflow, threads


def test_after_an_overflow_the_rescan_finds_all_and_the_restarted_watch_sees_all(
    place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    limit = int(QUEUE.read_text())
    if limit > 50_000:
        pytest.skip("the queue of inotify is long here")
    held, read = threading.Event(), inotify_c.InotifyFD.read_events

    def slow(self: inotify_c.InotifyFD, **more: int) -> list[inotify_c.InotifyEvent]:
        assert held.wait(60)
        return read(self, **more)

    monkeypatch.setattr(inotify_c.InotifyFD, "read_events", slow)
    held.set()
    place.watcher.start()
    assert place.hears(place.inbox / NAME)
    held.clear()
    place.hears(place.inbox / NAME, 0.5)  # what was waited for before is read
    files = [place.inbox / f"electa-2022-308-4-{number}.sbd" for number in range(limit)]
    for path in files:
        path.touch()
    later = place.root / "nemo" / "from-glider"
    later.mkdir(parents=True)
    away = place.root.rename(place.root.with_name("away"))
    held.set()
    wait(lambda: place.tells(EventsLost()), 30.0)
    away.rename(place.root)
    place.watcher.restart()
    assert len(place.heard & {FileChanged(path, "electa") for path in files}) < len(files), "nothing was lost"
    assert place.watcher.alive()
    assert {found.path for found in place.watcher.scan()} >= set(files)
    assert place.hears(later / NAME) and place.hears(place.inbox / NAME)


@pytest.mark.parametrize("culprit", ["reader", "emitter", "observer"])
def test_each_thread_that_dies_is_noticed_and_replaced(
    place: Place, monkeypatch: pytest.MonkeyPatch, culprit: str
) -> None:
    owner, method = {
        "reader": (inotify_c.InotifyFD, "handle_event"),
        "emitter": (inotify.InotifyFullEmitter, "queue_events"),
        "observer": (BaseObserver, "dispatch_events"),
    }[culprit]
    place.watcher.start()
    assert place.watcher.alive()
    with monkeypatch.context() as broken:
        broken.setattr(threading, "excepthook", lambda _: None)
        broken.setattr(owner, method, refuse(errno.EIO))
        (place.inbox / NAME).touch()
        wait(lambda: not place.watcher.alive())
    place.watcher.restart()
    assert place.watcher.alive()
    assert place.hears(place.inbox / NAME)


# --------------------------------------------------------------------------- slow shares


def test_a_file_that_grows_while_a_slow_share_gives_it_is_not_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, fstat, states = tmp_path / NAME, os.fstat, list[int]()
    path.write_bytes(b"x" * 1000)

    def slow(number: int) -> os.stat_result:
        states.append(number)
        if len(states) == 2:  # after it was read
            with path.open("ab") as file:
                file.write(b"more")
        return fstat(number)

    monkeypatch.setattr(os, "fstat", slow)
    with pytest.raises(Retry, match="changed while it was read"):
        read_regular(path, 10_000)
    assert read_regular(path, 10_000)[0] == b"x" * 1000 + b"more"


@pytest.mark.parametrize("number", [errno.EIO, errno.ESTALE, errno.ETIMEDOUT, errno.EACCES, errno.ENXIO])
def test_a_share_that_fails_is_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    path = tmp_path / NAME
    path.write_bytes(dinkum.header())
    with monkeypatch.context() as away:
        away.setattr(os, "open", refuse(number))
        with pytest.raises(Retry, match="cannot be read"):
            read_header(path)
    assert read_header(path).id.glider == "unit_7"


def test_a_link_is_not_followed_also_where_it_came_after_the_look(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    secret, path = tmp_path / "secret", tmp_path / NAME
    secret.write_bytes(dinkum.header())
    path.symlink_to(secret)
    with pytest.raises(Quarantine, match="symbolic link"):
        read_header(path)
    status = secret.stat()
    monkeypatch.setattr(Path, "stat", lambda self, **_: status)
    with pytest.raises((Retry, Quarantine)):
        read_header(path)
