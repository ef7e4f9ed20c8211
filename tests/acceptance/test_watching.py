"""The daemon as installed, when what it watches with, or what it watches, goes away."""

from __future__ import annotations

import os
import shutil
import sys
import time
from pathlib import Path

import pytest

from acceptance.angus import FILES, SHORT, put, taken
from acceptance.chaos import flood, hooked
from acceptance.support import Daemon, Site, until
from gliderwatch.store.state_file import Status

BROKEN = """
import errno
from pathlib import Path
from watchdog.observers import inotify_c
from gliderwatch.service import daemon
from gliderwatch.slocum import header
daemon.BEAT = 0.5
MARK = Path({mark!r})
{how}
from gliderwatch.cli.main import main
if __name__ == "__main__":
    main()
"""
FULL = """
def full(self, *_, **__):
    raise OSError(errno.ENOSPC, "inotify watch limit reached")
inotify_c.InotifyFD.add_callback = full
"""


def broken(site: Site, how: str = "", **env: str) -> Daemon:
    """The daemon with something that goes wrong once the file `mark` is there."""
    mark = str(site.config.with_name("mark"))
    return Daemon(site, (sys.executable, "-c", BROKEN.format(mark=mark, how=how)), **env)


def mark(site: Site) -> Path:
    """Let it go wrong from now on."""
    path = site.config.with_name("mark")
    path.touch()
    return path


def test_a_dead_thread_of_the_watcher_is_started_again(site: Site) -> None:
    site.configure("angus", rescan_seconds=3600)
    with broken(site, **hooked(CHAOS_OBSERVER=site.config.with_name("mark"))) as daemon:
        put(site, FILES[0])
        taken(site, FILES[0])
        path = mark(site)
        put(site, FILES[1])  # the news of it dies with the reader
        until(lambda: not path.exists(), "the reader has died")
        until(lambda: daemon.log("observer died, started again"), "noticed")
        taken(site, FILES[1])
        put(site, *FILES[2:])
        taken(site, *FILES[2:])
        time.sleep(1.5)  # three looks at whether it lives
        assert len(daemon.log("observer died, started again")) == 1, "only the rescans find files"


@pytest.mark.slow
def test_what_an_overflow_lost_is_found_at_once_and_all_is_watched_from_then_on(site: Site) -> None:
    site.configure("angus", rescan_seconds=3600)
    with Daemon(site) as daemon:
        put(site, FILES[0])
        taken(site, FILES[0])
        with daemon.stopped():
            flood(site.folder("angus"))
            put(site, *FILES[1:3])  # the news of them are not kept
        taken(site, *FILES[1:3])
        put(site, *FILES[3:])
        taken(site, *FILES[3:])
        assert daemon.log("inotify lost events.*")


def test_at_the_limit_of_inotify_it_polls_and_says_so(site: Site) -> None:
    site.configure("angus", rescan_seconds=3600)
    with broken(site, FULL) as daemon:
        until(lambda: daemon.log("folder left out"), "told")
        assert daemon.log("folder left out")[0]["level"] == "warning"
        reason = daemon.log("folder left out")[0]["reason"]
        assert "polled" in reason
        assert "fs.inotify.max_user_watches" in reason
        put(site, *FILES)
        taken(site, *FILES)
        assert not daemon.log("observer died.*")


@pytest.mark.parametrize("observer", ["inotify", pytest.param("polling", marks=pytest.mark.slow)])
def test_a_root_that_is_unmounted_and_back(site: Site, observer: str) -> None:
    site.configure("angus", rescan_seconds=1, observer=observer)
    away = site.root.with_name("away")
    with Daemon(site) as daemon:
        put(site, FILES[0])
        taken(site, FILES[0])
        site.root.rename(away)
        until(lambda: any(str(site.root) in e["reason"] for e in daemon.log("folder left out")), "told")
        for file in FILES[1:3]:
            (away / "angus" / "from-glider" / file.name).write_bytes(file.data)
        site.root.mkdir()  # the bare mount point
        time.sleep(1.1)  # one rescan sees it
        site.root.rmdir()
        away.rename(site.root)
        taken(site, *FILES[:3])
        put(site, *FILES[3:])
        taken(site, *FILES[3:])
        assert daemon.alive()
        assert site.statuses(*(f.name for f in FILES)) == [Status.TAKEN] * len(FILES)
        assert len(daemon.log("file taken")) == len(FILES), "taken twice"


def test_a_fuller_copy_that_waited_while_the_root_was_away_is_taken(site: Site) -> None:
    """What was known of the segment was a cut copy; the fuller one had not been read when the root went."""
    site.configure("angus", rescan_seconds=1)
    cut, root, cache = SHORT[0], site.root.with_name("away"), site.cache.with_name("cache-away")
    whole = FILES[0].name
    with Daemon(site) as daemon:
        site.put("angus", cut.name, cut.data[: len(cut.data) // 2])
        taken(site, cut)
        site.cache.rename(cache)
        put(site, FILES[0])
        until(lambda: site.statuses(whole) == [Status.WAITING], "waits for its cache")
        site.root.rename(root)
        until(lambda: site.statuses(whole) == [Status.DUPLICATE], "taken for renamed")
        cache.rename(site.cache)
        root.rename(site.root)
        taken(site, FILES[0])
        assert daemon.stop() == 0


@pytest.mark.slow
def test_a_file_that_settled_while_the_root_was_away_is_taken(site: Site) -> None:
    site.configure("angus", rescan_seconds=1)
    away = site.root.with_name("away")
    with Daemon(site) as daemon:
        put(site, FILES[1])
        taken(site, FILES[1])
        put(site, SHORT[0])
        time.sleep(0.5)  # seen, and not yet complete: that takes a second, and by then it is not there
        site.root.rename(away)
        until(lambda: len(daemon.log("folder left out")) > 2, "more than a second has gone by")
        away.rename(site.root)
        taken(site, SHORT[0])
        assert daemon.stop() == 0


def test_new_cache_folders_of_a_pattern_are_noticed(site: Site, tmp_path: Path) -> None:
    site.configure("angus", cache=[f"{tmp_path}/stations/*/cache"], rescan_seconds=1)
    with Daemon(site):
        put(site, *FILES)
        names = [file.name for file in FILES]
        until(lambda: site.statuses(*names) == [Status.WAITING] * len(names), "wait for their caches")
        (tmp_path / "stations" / "north" / "cache").mkdir(parents=True)
        south = tmp_path / "stations" / "south"
        shutil.copytree(site.cache, south / "cache.part")
        (south / "cache.part").rename(south / "cache")
        taken(site, *FILES)


def test_a_slow_share_delays_but_loses_nothing_and_the_signs_of_life_go_on(site: Site) -> None:
    alive = site.state.with_name(site.state.name + ".alive")
    longest = 0.0
    with Daemon(site, **hooked(CHAOS_SLOW=mark(site))):
        put(site, *FILES)

        def all_taken() -> bool:
            nonlocal longest
            longest = max(longest, time.time() - alive.stat().st_mtime)
            return site.statuses(*(f.name for f in FILES)) == [Status.TAKEN] * len(FILES)

        until(all_taken, "taken")
    assert longest < 10.0


def test_a_writer_that_is_slow_is_waited_for(site: Site, daemon: Daemon) -> None:
    """A short name that grows with pauses shorter than the time to settle, and the glider's clock."""
    data, path = FILES[0].data, site.folder("angus") / "01330000.sbd"
    part = len(data) // 5 + 1
    with path.open("wb") as file:
        for start in range(0, len(data), part):
            file.write(data[start : start + part])
            file.flush()
            os.utime(path, (86400.0 * start, 86400.0 * start))
            time.sleep(0.3)

    def whole() -> bool:
        file = site.files().get(path.name)
        return file is not None and (file.status, file.size) == (Status.TAKEN, len(data))

    until(whole, "taken as a whole")
