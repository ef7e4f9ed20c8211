"""Watching and scanning real folders, with inotify and by polling."""

import os
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from queue import Empty, Queue

import pytest

from gliderwatch.slocum.folders import Place, expand, scan
from gliderwatch.slocum.watch import CacheChanged, Change, FileChanged, ScienceChanged, TreeChanged, Watcher

LONG = "electa-2022-308-3-2.sbd"
SHORT = "00930002.sbd"


class Dockserver:
    """A root with one glider, a cache folder, and a place outside of both to move files from."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.root = path / "gliders"
        self.cache = path / "cache"
        self.outside = path / "outside"
        self.inbox = self.root / "electa" / "from-glider"
        for folder in (self.inbox, self.cache, self.outside, self.inbox.parent / "logs"):
            folder.mkdir(parents=True)

    def move_in(self, target: Path, content: bytes = b"data") -> Path:
        source = self.outside / target.name
        source.write_bytes(content)
        source.rename(target)
        return target


@pytest.fixture
def dock(tmp_path) -> Dockserver:
    return Dockserver(tmp_path)


@pytest.fixture(params=["inotify", "polling"])
def kind(request) -> str:
    return request.param


@pytest.fixture
def watch(dock, kind) -> Iterator:
    watchers = []

    def _watch(roots=None, explicit=None, caches=None, queue=None):
        queue = Queue() if queue is None else queue
        watcher = Watcher(
            [dock.root] if roots is None else roots,
            explicit or {},
            [dock.cache] if caches is None else caches,
            queue,
            observer=kind,
            poll_seconds=0.05,
        )
        watchers.append(watcher)
        watcher.start()
        return watcher, queue

    yield _watch
    for watcher in watchers:
        watcher.stop()


def drain(queue: Queue, quiet: float = 0.3) -> list[Change]:
    """All that comes until nothing has come for a while."""
    changes = []
    while True:
        try:
            changes.append(queue.get(timeout=quiet))
        except Empty:
            return changes


def expect(queue: Queue, *changes: Change, seconds: float = 20.0) -> list[Change]:
    """All that comes until each of these has come, in any order."""
    deadline = time.monotonic() + seconds
    seen: list[Change] = []
    while missing := [change for change in changes if change not in seen]:
        try:
            seen.append(queue.get(timeout=max(deadline - time.monotonic(), 0.0)))
        except Empty:
            pytest.fail(f"{missing} did not come, only {seen}")
    return seen


def state(folder: Path) -> dict[str, tuple[int, int, int]]:
    found = {}
    for path in [folder, *folder.rglob("*")]:
        status = path.lstat()
        found[str(path)] = (status.st_mtime_ns, status.st_ctime_ns, status.st_size)
    return found


# --------------------------------------------------------------------------- events


@pytest.mark.parametrize("name", [LONG, SHORT, LONG.upper(), "00930002.scd", "00930002.dbd"])
def test_a_file_that_is_moved_in(watch, dock, name):
    _, queue = watch()
    drain(queue)
    path = dock.move_in(dock.inbox / name)
    expect(queue, FileChanged(path, "electa"))


def test_a_file_that_is_written(watch, dock):
    _, queue = watch()
    drain(queue)
    (dock.inbox / SHORT).write_bytes(b"data")
    expect(queue, FileChanged(dock.inbox / SHORT, "electa"))


@pytest.mark.timing
def test_inotify_tells_of_a_file_within_half_a_second_and_not_before_it_is_closed(dock):
    queue: Queue = Queue()
    watcher = Watcher([dock.root], {}, [], queue)
    watcher.start()
    try:
        drain(queue)
        with (dock.inbox / SHORT).open("wb") as file:
            file.write(b"data")
            file.flush()
            assert drain(queue) == []
        expect(queue, FileChanged(dock.inbox / SHORT, "electa"), seconds=0.5)
        delays = []
        for i in range(10):
            path = dock.inbox / f"electa-2022-308-3-{i}.sbd"
            start = time.monotonic()
            dock.move_in(path)
            expect(queue, FileChanged(path, "electa"), seconds=2.0)
            delays.append(time.monotonic() - start)
        assert sorted(delays)[5] < 0.5
    finally:
        watcher.stop()


def test_renaming_tells_of_both_names(watch, dock):
    (dock.inbox / SHORT).write_bytes(b"data")
    _, queue = watch()
    drain(queue)
    (dock.inbox / SHORT).rename(dock.inbox / LONG)
    expect(queue, FileChanged(dock.inbox / LONG, "electa"), FileChanged(dock.inbox / SHORT, "electa"))


def test_other_files_and_folders_are_no_news(watch, dock):
    left_out = ("electa/archive", "unknown/from-glider", "electa/from-glider/archive", "electa/to-glider")
    for folder in (*left_out, "electa/from-glider/.~tmp~"):
        (dock.root / folder).mkdir(parents=True, exist_ok=True)
    _, queue = watch()
    drain(queue)
    for path in (
        dock.inbox / "00930002.tbd",
        dock.inbox / "notes.txt",
        dock.inbox / f".{LONG}.x81f",
        dock.inbox / f".{LONG}",
        dock.inbox / f"{LONG}.filepart",
        dock.inbox / ".~tmp~" / LONG,
        dock.inbox / "archive" / LONG,
        dock.inbox.parent / LONG,
        dock.inbox.parent / "logs" / LONG,
        dock.inbox.parent / "to-glider" / LONG,
        dock.inbox.parent / "archive" / LONG,
        dock.root / "unknown" / "from-glider" / LONG,
        dock.outside / LONG,
        dock.cache / "notes.txt",
    ):
        path.write_bytes(b"data")
    last = FileChanged(dock.move_in(dock.inbox / LONG), "electa")  # what comes before it is all there was
    news = {change for change in expect(queue, last) if not isinstance(change, TreeChanged)}
    assert news <= {ScienceChanged(dock.inbox / "00930002.tbd"), last}


def test_a_science_file_is_news_for_the_flight_file_beside_it(watch, dock):
    _, queue = watch()
    drain(queue)
    dock.move_in(dock.inbox / "00930002.TCD")
    expect(queue, ScienceChanged(dock.inbox / "00930002.TCD"))


def test_a_glider_that_appears_is_watched_at_once(watch, dock):
    _, queue = watch()
    drain(queue)
    inbox = dock.root / "nemo" / "from-glider"
    inbox.mkdir(parents=True)
    expect(queue, TreeChanged(inbox.parent), TreeChanged(inbox))
    expect(queue, FileChanged(dock.move_in(inbox / "nemo-2024-1-0-0.sbd"), "nemo"))


def test_folders_that_appear_within_each_other_write_nothing_to_the_journal(dock):
    program = (
        "import sys; from pathlib import Path; from queue import Queue\n"
        "from gliderwatch.slocum.watch import TreeChanged, Watcher\n"
        "root, queue = Path(sys.argv[1]), Queue()\n"
        "watcher = Watcher([root], {}, [], queue); watcher.start()\n"
        "for i in range(50):\n"
        "    inbox = root / f'unit_{i}' / 'from-glider'; inbox.mkdir(parents=True)\n"
        "    while queue.get(timeout=20.0) != TreeChanged(inbox): pass\n"
        "watcher.stop()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, dock.root], capture_output=True, text=True, check=True, timeout=60
    )
    assert (done.stdout, done.stderr) == ("", "")


def test_a_glider_folder_that_is_moved_in_is_news_and_watched(watch, dock):
    inbox = dock.outside / "nemo" / "from-glider"
    inbox.mkdir(parents=True)
    (inbox / SHORT).write_bytes(b"data")
    watcher, queue = watch()
    drain(queue)
    inbox.parent.rename(dock.root / "nemo")
    expect(queue, TreeChanged(dock.root / "nemo"))
    assert [found.glider_folder for found in watcher.scan()] == ["nemo"]
    moved = dock.move_in(dock.root / "nemo" / "from-glider" / "nemo-2024-1-0-0.sbd")
    expect(queue, FileChanged(moved, "nemo"))


def test_a_cache_file_is_news(watch, dock):
    _, queue = watch()
    drain(queue)
    for name in ("0f682cb2.cac", "0F682CB2.CCC"):
        expect(queue, CacheChanged(dock.move_in(dock.cache / name)))


def test_explicit_paths_have_the_gliders_name(watch, dock, tmp_path):
    folder = tmp_path / "elsewhere" / "unit7"
    folder.mkdir(parents=True)
    _, queue = watch(explicit={"nemo": [folder]})
    drain(queue)
    expect(queue, FileChanged(dock.move_in(folder / SHORT), "nemo"))


def test_a_root_may_be_a_pattern_a_link_or_in_groups(watch, dock, tmp_path):
    inbox = tmp_path / "stations" / "default" / "gliders" / "nemo" / "from-glider"
    group = tmp_path / "gmc" / "rutgers" / "gliders" / "ru30" / "from-glider"
    for folder in (inbox, group):
        folder.mkdir(parents=True)
    (tmp_path / "link").symlink_to(tmp_path / "gmc")
    _, queue = watch(roots=[tmp_path / "stations" / "*" / "gliders", tmp_path / "link"])
    drain(queue)
    expect(queue, FileChanged(dock.move_in(inbox / SHORT), "nemo"))
    expect(queue, FileChanged(dock.move_in(group / SHORT), "ru30"))


def test_places_that_come_and_go_are_followed_by_refresh(watch, dock, tmp_path):
    root, cache = tmp_path / "later", tmp_path / "later-cache"
    watcher, queue = watch(roots=[root], caches=[cache])
    assert len(watcher.problems) == 2
    assert str(root) in watcher.problems[0] + watcher.problems[1]
    assert watcher.cache_folders() == ()
    for _ in range(2):
        inbox = root / "electa" / "from-glider"
        inbox.mkdir(parents=True)
        cache.mkdir()
        watcher.refresh()
        assert watcher.problems == ()
        expect(queue, TreeChanged(root))
        assert watcher.cache_folders() == (cache,)
        expect(queue, FileChanged(dock.move_in(inbox / LONG), "electa"))
        expect(queue, CacheChanged(dock.move_in(cache / "0f682cb2.cac")))
        shutil.rmtree(root)
        shutil.rmtree(cache)
        assert watcher.alive()
        watcher.refresh()
        assert len(watcher.problems) == 2
    assert watcher.alive()


def test_a_root_that_is_replaced_by_another_is_watched(watch, dock):
    watcher, queue = watch()
    dock.root.rename(dock.outside / "old")
    dock.inbox.mkdir(parents=True)
    watcher.refresh()
    drain(queue)
    expect(queue, FileChanged(dock.move_in(dock.inbox / LONG), "electa"))


def test_a_watcher_whose_thread_has_ended_is_not_alive_and_can_be_restarted(watch, dock):
    watcher, queue = watch()
    assert watcher.alive()
    observer = watcher._observer
    observer.stop()
    observer.join()
    assert not watcher.alive()
    watcher.restart()
    assert watcher.alive()
    drain(queue)
    expect(queue, FileChanged(dock.move_in(dock.inbox / LONG), "electa"))


def test_an_emitter_that_has_ended_is_noticed_and_replaced(watch, dock):
    watcher, queue = watch()
    for emitter in tuple(watcher._observer.emitters):
        emitter.stop()
        emitter.join()
    assert not watcher.alive()
    watcher.refresh()
    assert watcher.alive()
    drain(queue)
    expect(queue, FileChanged(dock.move_in(dock.inbox / LONG), "electa"))


def test_a_queue_that_fails_does_not_end_the_watching(watch, dock):
    class Full:
        def __init__(self) -> None:
            self.fail, self.failed, self.queue = False, threading.Event(), Queue()

        def put(self, change: Change) -> None:
            if self.fail:
                self.failed.set()
                raise RuntimeError("full")
            self.queue.put(change)

    sink = Full()
    watcher, _ = watch(queue=sink)
    drain(sink.queue)
    sink.fail = True
    dock.move_in(dock.inbox / SHORT)
    assert sink.failed.wait(5.0)
    sink.fail = False
    assert watcher.alive()
    expect(sink.queue, FileChanged(dock.move_in(dock.inbox / LONG), "electa"))


def test_stopping_ends_every_thread(watch):
    before = set(threading.enumerate())
    watcher, _ = watch()
    assert set(threading.enumerate()) > before
    watcher.stop()
    assert not watcher.alive()
    assert set(threading.enumerate()) == before


def test_a_limit_of_inotify_is_told_with_the_cure(dock, monkeypatch):
    def refuse(*_: object, **__: object) -> None:
        raise OSError(28, "inotify watch limit reached")

    watcher = Watcher([dock.root], {}, [], Queue())
    watcher.start()
    try:
        monkeypatch.setattr(watcher._observer, "schedule", refuse)
        watcher._watches.clear()
        watcher.refresh()
        assert "fs.inotify.max_user_watches" in watcher.problems[0]
        assert str(dock.root) in watcher.problems[0]
    finally:
        watcher.stop()


def test_nothing_is_written_below_a_root(watch, dock):
    (dock.inbox / LONG).write_bytes(b"data")
    for folder in (dock.inbox, dock.inbox.parent, dock.root, dock.cache):
        folder.chmod(0o555)
    before = state(dock.root), state(dock.cache)
    watcher, queue = watch()
    assert len(list(watcher.scan())) == 1
    drain(queue)
    watcher.refresh()
    watcher.stop()
    assert (state(dock.root), state(dock.cache)) == before


# --------------------------------------------------------------------------- scanning


def found(*places: Place) -> dict[str, str]:
    unread: list[str] = []
    files = list(scan(places, unread))
    assert unread == []
    assert len({file.path for file in files}) == len(files)
    return {file.path.name: file.glider_folder for file in files}


def test_scanning_finds_the_flight_data_of_all_layouts(dock):
    for folder, name in (
        ("electa/from-glider", "a.sbd"),
        ("electa/from-glider", "b.tbd"),
        ("electa/from-glider/2024", "c.SCD"),
        ("electa/from-glider/archive", "d.sbd"),
        ("electa/logs", "e.sbd"),
        ("electa", "f.sbd"),
        ("group/gliders/nemo/from-glider", "g.dbd"),
        ("unknown/from-glider", "h.sbd"),
        ("Unknown/from-glider", "i.sbd"),
        ("electa/from-glider", ".k.sbd"),
        ("electa/from-glider/.~tmp~", "l.sbd"),
        (".snapshot/electa/from-glider", "m.sbd"),
        ("stations/default/gliders/ru30/from-glider", "j.mcd"),
    ):
        (dock.root / folder).mkdir(parents=True, exist_ok=True)
        (dock.root / folder / name).write_bytes(b"12345")
    assert found(Place(dock.root)) == {"a.sbd": "electa", "c.SCD": "electa", "g.dbd": "nemo", "j.mcd": "ru30"}
    assert found(Place(dock.root / "electa")) == {"a.sbd": "electa", "c.SCD": "electa"}
    assert found(Place(dock.inbox, "my-electa")) == {"a.sbd": "my-electa", "c.SCD": "my-electa"}
    both = found(Place(dock.inbox, "my-electa"), Place(dock.root))
    assert both == {"a.sbd": "my-electa", "c.SCD": "my-electa", "g.dbd": "nemo", "j.mcd": "ru30"}
    for file in scan([Place(dock.root)], []):
        assert Place(dock.root).glider_folder(file.path) == file.glider_folder
        assert (file.size, file.mtime_ns) == (5, file.path.stat().st_mtime_ns)


def test_links_are_not_followed_and_loops_end(dock):
    (dock.outside / "from-glider").mkdir()
    (dock.outside / "from-glider" / "a.sbd").write_bytes(b"data")
    (dock.inbox / "b.sbd").write_bytes(b"data")
    (dock.root / "escape").symlink_to(dock.outside)
    (dock.inbox / "c.sbd").symlink_to(dock.outside / "from-glider" / "a.sbd")
    (dock.inbox / "loop").symlink_to(dock.root)
    (dock.inbox / "d.sbd").symlink_to("d.sbd")
    os.mkfifo(dock.inbox / "e.sbd")
    (dock.inbox / "f.sbd").mkdir()
    assert found(Place(dock.root)) == dict.fromkeys([f"{name}.sbd" for name in "bcdef"], "electa")


def test_what_cannot_be_read_is_told_and_the_rest_is_found(dock, monkeypatch):
    (dock.inbox / "b.sbd").write_bytes(b"data")
    (dock.root / "zulu" / "from-glider").mkdir(parents=True)
    (dock.root / "gone").mkdir()
    scandir = os.scandir

    def refuse(path):
        if Path(path).name == "zulu":
            raise PermissionError(13, "Permission denied")
        if Path(path).name == "gone":
            raise FileNotFoundError(2, "No such file or directory")
        return scandir(path)

    monkeypatch.setattr(os, "scandir", refuse)
    unread: list[str] = []
    assert [file.path.name for file in scan([Place(dock.root)], unread)] == ["b.sbd"]
    assert unread == [f"{dock.root / 'zulu'} cannot be read: Permission denied"]


def test_files_that_go_while_they_are_listed_are_left_out(dock):
    for i in range(20):
        (dock.inbox / f"{i:02d}.sbd").write_bytes(b"data")
    files = scan([Place(dock.root)], [])
    first = next(files)
    for path in dock.inbox.iterdir():
        path.unlink()
    assert [first.path.name, *(file.path.name for file in files)] == ["00.sbd"]


def test_patterns_name_what_is_there_now(dock):
    assert expand([dock.path / "g*", dock.path / "not-there", dock.root]) == [
        dock.root,
        dock.path / "not-there",
    ]
    assert expand([dock.path / "not-*"]) == []
