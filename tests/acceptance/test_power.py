"""Power cuts and a damaged state file: every copy opens and goes on, damage is found and made good."""

from __future__ import annotations

import os
import shutil
import sqlite3
import zlib
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from acceptance.angus import FILES, MISSION, put, taken
from acceptance.support import (
    TRACEBACK,
    Daemon,
    Site,
    command,
    mail_server,
    remora,
    results,
    until,
)
from gliderwatch.simulate.delivery import arrivals
from gliderwatch.store.maintenance import asides
from gliderwatch.store.state_file import Store

PAGE = 4096


def copied(state: Path, folder: Path) -> Path:
    """A state as a power cut would leave it: file, log and index, one after the other."""
    folder.mkdir()
    for path in sorted(state.parent.glob(state.name + "*")):
        shutil.copy(path, folder)
    return folder / state.name


@pytest.mark.slow
def test_a_copy_of_any_moment_opens_is_whole_and_goes_on(site: Site, tmp_path: Path) -> None:
    copies = []
    with Daemon(site) as daemon:
        for number, file in enumerate(FILES):
            put(site, file)
            if number % 2:
                taken(site, file)
            copies.append(copied(site.state, tmp_path / f"copy-{number}"))
        taken(site, *FILES)
        assert daemon.stop() == 0
    whole = results(site.state)
    for copy in copies:
        with closing(sqlite3.connect(copy)) as db:
            assert db.execute("PRAGMA integrity_check").fetchone()[0] == "ok"
    for copy in (copies[0], copies[len(copies) // 2]):
        site.state = copy
        site.configure("angus")
        with Daemon(site) as daemon:
            taken(site, *FILES)
            assert daemon.stop() == 0
        assert results(copy) == whole
        assert asides(copy) == []


# --------------------------------------------------------------------------- damage


def overwritten(path: Path) -> None:
    """The pages of the second quarter hold something else."""
    size = path.stat().st_size
    with path.open("r+b") as file:
        file.seek(size // 4 // PAGE * PAGE)
        file.write(b"\xa5" * (size // 4))


def truncated(path: Path) -> None:
    os.truncate(path, path.stat().st_size // 2 + 100)


def zeroed(path: Path) -> None:
    with path.open("r+b") as file:
        file.write(bytes(100))


def emptied(path: Path) -> None:
    os.truncate(path, 0)


@pytest.fixture
def bruce(tmp_path: Path) -> Site:
    """A dockserver for a glider who catches a remora."""
    site = Site(tmp_path)
    site.caches(MISSION, remora(3.0))
    return site


@pytest.mark.parametrize(
    "harm",
    [overwritten, *(pytest.param(harm, marks=pytest.mark.slow) for harm in (truncated, zeroed, emptied))],
)
def test_damage_is_set_aside_and_made_good_from_the_files(bruce: Site, harm: Callable[[Path], None]) -> None:
    site, files = bruce, list(arrivals(remora(3.0)))
    with mail_server() as box:
        site.configure("bruce", url=box.url)
        with Daemon(site) as daemon:
            put(site, *files, glider="bruce")
            taken(site, *files)
            until(lambda: box.mails and site.undelivered() == 0, "told")
            assert daemon.stop() == 0
        before, whole = box.times(), results(site.state)
        harm(site.state)
        with daemon:
            taken(site, *files)
            until(lambda: len(daemon.log("state file is damaged.*")) == 1, "said")
            until(lambda: any("state file was damaged" in mail.subject for mail in box.mails), "told")
            until(lambda: site.undelivered() == 0, "delivered")
            assert daemon.stop() == 0
        (aside,) = asides(site.state)
    assert results(site.state) == whole
    assert TRACEBACK not in daemon.text()
    told = [mail for mail in box.mails if "damaged" in mail.subject]
    assert len(told) == 1 and aside.name in told[0].text and "dockserver" in told[0].text
    again = {id_: n for id_, n in box.times().items() if n > 1}
    # the incident is open: told again where the message could not be saved, then under its Message-ID
    assert again.keys() <= before.keys() and (not again or harm is not overwritten)
    assert box.times().keys() - before.keys() == {told[0].id}


@pytest.mark.slow
def test_damage_found_while_it_runs_ends_it_in_words_and_the_next_start_makes_it_good(site: Site) -> None:
    """A checkpoint that no check of SQLite can see: pages are right, the record in one is not."""
    early, late = FILES[:4], FILES[4:]
    with Daemon(site) as daemon:
        put(site, *early)
        taken(site, *early)
        assert daemon.stop() == 0
        with closing(sqlite3.connect(site.state)) as db:
            db.execute("UPDATE segments SET checkpoint = x'00112233'")
            db.commit()
        daemon.start().ready()
        put(site, *late)
        assert daemon.wait() == 2
        daemon.start().ready()
        taken(site, *FILES)
        assert daemon.stop() == 0
    assert TRACEBACK not in daemon.text() and len(asides(site.state)) == 1
    out = site.config.with_name("out")
    assert command("run", "-c", site.config, "--replay", site.root, "--out", out).returncode == 0
    assert results(site.state) == results(out / "replay.sqlite")


@pytest.mark.slow
def test_a_record_of_a_type_that_is_not_known_is_no_damage_and_sets_nothing_aside(site: Site) -> None:
    """A mistake of a release: the file stays, the service says so, and the release that wrote it goes on."""
    early, late = FILES[:4], FILES[4:]
    with Daemon(site) as daemon:
        put(site, *early)
        taken(site, *early)
        assert daemon.stop() == 0
        with closing(sqlite3.connect(site.state)) as db:
            good = db.execute("SELECT checkpoint, name FROM segments").fetchall()
            odd = zlib.compress(
                zlib.decompress(good[0][0]).replace(b'"navigation":{', b'"navigation":3,"x":{', 1)
            )
            db.execute("UPDATE segments SET checkpoint = ?", (odd,))
            db.commit()
        daemon.start().ready()
        put(site, *late)
        until(lambda: daemon.log("state cannot be used, tried again"), "said")
        assert asides(site.state) == [] and daemon.stop() == 0
        with closing(sqlite3.connect(site.state)) as db:
            db.executemany("UPDATE segments SET checkpoint = ? WHERE name = ?", good)
            db.commit()
        daemon.start().ready()
        taken(site, *FILES)
        assert daemon.stop() == 0
    assert TRACEBACK not in daemon.text()


@pytest.mark.slow
def test_a_message_that_waited_in_a_damaged_file_is_sent(bruce: Site) -> None:
    site, files = bruce, list(arrivals(remora(3.0)))
    with mail_server() as box:
        box.refusing = True
        site.configure("bruce", url=box.url)
        with Daemon(site) as daemon:
            put(site, *files, glider="bruce")
            taken(site, *files)
            until(lambda: daemon.log("alert not delivered"), "refused for now")
            assert daemon.stop() == 0
        with closing(Store.reading(site.state)) as store:
            waiting = {alert.title for alert in store.alerts()}
        with closing(sqlite3.connect(site.state)) as db:
            (record,) = db.execute("SELECT segment FROM segments").fetchone()
        page = site.state.read_bytes().index(record[:64]) // PAGE
        with site.state.open("r+b") as file:
            file.seek(page * PAGE)
            file.write(b"\xa5" * PAGE)
        for path in site.folder("bruce").iterdir():
            path.unlink()  # nothing can be made anew: what arrives was saved
        box.refusing = False
        with daemon:
            until(lambda: waiting <= {mail.subject for mail in box.mails}, "told")
            assert daemon.stop() == 0
