"""The daemon as installed, and some hundreds of hostile files: each is named, and the good ones are taken.

`benchmarks/chaos_files.py` does the same with thousands.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from pathlib import Path

import pytest

from acceptance.angus import FILES, put, taken
from acceptance.hostile import fill, peak, program, shown, workers
from acceptance.support import TRACEBACK, Daemon, Site, command, remora, results, until
from gliderwatch.simulate.delivery import arrivals
from gliderwatch.store.state_file import Status

N = 200
DAEMON_MB, WORKERS_MB = 400.0, 2500.0
"""Far above what was seen, far below what a leak, a copy of a 1 GB file or a bomb would take."""

BRUCE = remora(1.0)
GOOD = list(arrivals(BRUCE))


@pytest.fixture
def site_of_two(site: Site) -> Site:
    """Angus, whose files are hostile, and bruce, whose files are good."""
    site.caches(BRUCE)
    site.configure("angus", "bruce", rescan_seconds=2)
    return site


@pytest.mark.slow
def test_hundreds_of_hostile_files_are_named_and_good_ones_are_taken(site_of_two: Site) -> None:
    site = site_of_two
    names = fill(site.folder("angus"), [file.data for file in FILES], N, seed=1)
    most = 0.0
    with Daemon(site, (sys.executable, "-c", program())) as daemon:
        put(site, *GOOD, glider="bruce")
        taken(site, *GOOD)
        missing = set(map(shown, names))

        def named() -> bool:
            nonlocal missing, most
            most = max(most, workers(daemon.pid))
            missing -= site.files().keys()
            return not missing

        until(named, f"all named but {sorted(missing)[:5]}")
        assert daemon.alive()
        assert peak(daemon.pid) < DAEMON_MB
        assert most < WORKERS_MB
        ledger = site.files()
        reasons = [file.reason for file in ledger.values() if file.status == Status.QUARANTINED]
        assert len(reasons) > N / 3
        assert all(reason.isprintable() and len(reason) > 10 for reason in reasons)
        for misdeed in ("took longer than", "crashed on it (SIGSEGV)", "takes more memory", "larger than"):
            assert any(misdeed in reason for reason in reasons), misdeed
        daemon.stop()
    assert TRACEBACK not in daemon.text()
    alone = site.config.with_name("alone")
    command("run", "-c", site.config, "--replay", site.folder("bruce"), "--out", alone)
    assert results(site.state)["bruce"] == results(alone / "replay.sqlite")["bruce"]


def test_whatever_is_no_file_is_refused_with_a_reason_and_never_opened(site: Site, tmp_path: Path) -> None:
    secret = tmp_path / "secret.sbd"
    secret.write_bytes(FILES[0].data)
    folder = site.folder("angus")
    site.configure("angus", rescan_seconds=1)
    before = {"early.sbd": "a FIFO", "out.sbd": "a symbolic link", "gone.sbd": "a symbolic link"}
    before |= {"loop.sbd": "a symbolic link", "folder.sbd": "a folder", "zero.sbd": "a symbolic link"}
    os.mkfifo(folder / "early.sbd")
    (folder / "out.sbd").symlink_to(secret)
    (folder / "gone.sbd").symlink_to(tmp_path / "nowhere.sbd")
    (folder / "loop.sbd").symlink_to("loop.sbd")
    (folder / "folder.sbd").mkdir()
    (folder / "zero.sbd").symlink_to("/dev/zero")
    writer = threading.Thread(target=_write, args=(folder / "early.sbd",), daemon=True)
    writer.start()
    with Daemon(site) as daemon:
        until(lambda: set(before) <= site.files().keys(), "what was there is named")
        os.mkfifo(folder / "angus-2024-121-0-906.sbd")
        (folder / "angus-2024-121-0-907.sbd").symlink_to(secret)
        later = {"angus-2024-121-0-906.sbd": "a FIFO", "angus-2024-121-0-907.sbd": "a symbolic link"}
        until(lambda: set(later) <= site.files().keys(), "what came is named")
        ledger = site.files()
        for name, kind in (before | later).items():
            assert ledger[name].status == Status.QUARANTINED, name
            assert f"not a regular file but {kind}" in ledger[name].reason
        assert writer.is_alive(), "a FIFO was opened: whoever writes to it was let go on"
        put(site, *FILES)
        taken(site, *FILES)
        assert daemon.alive()
    (folder / "early.sbd").open("rb").close()
    writer.join(5.0)


def _write(fifo: Path) -> None:
    try:
        fifo.write_bytes(b"x" * 100_000)
    except BrokenPipeError:
        return


def test_a_link_that_takes_the_place_of_a_file_is_not_followed(site: Site, tmp_path: Path) -> None:
    secret = tmp_path / "secret.sbd"
    secret.write_bytes(FILES[1].data)
    site.configure("angus", rescan_seconds=1)
    with Daemon(site):
        (path,) = put(site, FILES[0])
        taken(site, FILES[0])
        link = path.with_name("next")
        link.symlink_to(secret)
        link.rename(path)
        until(lambda: site.statuses(path.name) == [Status.QUARANTINED], "refused")
        put(site, FILES[2])
        taken(site, FILES[2])
        assert site.status()["gliders"]["angus"]["segments"] == 2


def test_a_file_that_takes_the_place_of_a_link_is_taken(site: Site, tmp_path: Path) -> None:
    site.configure("angus", rescan_seconds=1)
    link = site.folder("angus") / FILES[0].name
    link.symlink_to(tmp_path / "nowhere")
    with Daemon(site):
        until(lambda: site.statuses(link.name) == [Status.QUARANTINED], "refused")
        put(site, FILES[0])
        taken(site, FILES[0])


def test_a_folder_of_thousands_delays_nobody(site_of_two: Site) -> None:
    """Entries that are named one by one while good files come; the signs of life go on."""
    site, n = site_of_two, 1000
    folder = site.folder("angus")
    for number in range(n):
        (folder / f"angus-2024-121-9-{number}.sbd").touch()
    alive = site.state.with_name(site.state.name + ".alive")
    with Daemon(site) as daemon:
        begun = time.monotonic()
        put(site, *GOOD, glider="bruce")
        taken(site, *GOOD)
        until(lambda: len(site.files()) == n + len(GOOD), "all named")
        assert time.time() - alive.stat().st_mtime < max(15.0, time.monotonic() - begun)
        assert peak(daemon.pid) < DAEMON_MB
    assert {file.reason for file in site.files().values()} == {"", "the file is empty"}


def test_the_root_is_left_as_it_was(site: Site) -> None:
    names = fill(site.folder("angus"), [file.data for file in FILES], 60, seed=2)
    before = {p: (p.lstat().st_mtime_ns, p.lstat().st_mode) for p in site.root.rglob("*")}
    with Daemon(site, (sys.executable, "-c", program())):
        until(lambda: set(map(shown, names)) <= site.files().keys(), "all named")
    after = {p: (p.lstat().st_mtime_ns, p.lstat().st_mode) for p in site.root.rglob("*")}
    assert after == before
