"""Pages of the installed command: written beside the watch, never in its way; and of a past mission."""

from __future__ import annotations

import json
import os
import signal
import time
from contextlib import suppress
from pathlib import Path

import httpx

from acceptance.angus import FILES, put, taken
from acceptance.support import Daemon, Site, command, mail_server, until
from gliderwatch.service.mail_pictures import LIMIT
from gliderwatch.store.state_file import Store


def with_pages(site: Site) -> Path:
    """The site's configuration with pages; their folder."""
    folder = site.config.with_name("pages")
    document = json.loads(site.config.read_text()) | {"pages": {"folder": str(folder)}}
    site.config.write_text(json.dumps(document))
    return folder


def children(daemon: Daemon) -> list[int]:
    """The processes that the threads of the daemon began."""
    threads = Path(f"/proc/{daemon.pid}/task").glob("*/children")
    return [int(pid) for thread in threads for pid in thread.read_text().split()]


def writing(daemon: Daemon) -> list[int]:
    """The processes that write pages: they yield to all others."""
    usual = os.getpriority(os.PRIO_PROCESS, daemon.pid)
    return [pid for pid in children(daemon) if os.getpriority(os.PRIO_PROCESS, pid) > usual]


def painting(daemon: Daemon) -> list[int]:
    """The processes that make the pictures of mails: they alone have matplotlib loaded."""
    return [pid for pid in children(daemon) if "/matplotlib/" in Path(f"/proc/{pid}/maps").read_text()]


def signalled(pids: list[int], number: int) -> None:
    """Send a signal to processes, of which there is one."""
    assert pids
    for pid in pids:
        os.kill(pid, number)


def times(folder: Path) -> dict[str, int]:
    """When each file of a folder was written, those that are under way as well (ns)."""
    found = {}
    for path in folder.iterdir():
        with suppress(FileNotFoundError):  # what is under way gets its own name at any moment
            found[path.name] = path.stat().st_mtime_ns
    return found


def broken(folder: Path) -> list[str]:
    """What of the files that a web server would give out is not whole."""
    ends = {".html": "</html>", ".kml": "</kml>", ".geojson": "}"}
    shown = [path for path in folder.iterdir() if path.suffix in ends and path.name[0] != "."]
    assert len(shown) > len(ends)
    return [path.name for path in shown if not path.read_text().rstrip().endswith(ends[path.suffix])]


def test_alerts_are_on_time_beside_drawings_that_hang_and_pages_are_whole_after_a_kill(site: Site) -> None:
    """Who writes pages and who makes pictures are stopped in the middle: a mail without pictures comes as
    ever, one with them 2 s later. Then all are killed while they write."""
    folder = with_pages(site)
    with mail_server() as plain, mail_server() as shown:
        document = json.loads(site.config.read_text())
        document["channels"] = {"plain": {"url": plain.url}, "shown": {"url": shown.url, "pictures": True}}
        document["recipients"] = {"pilot": {"channels": ["plain", "shown"], "surfacing": ["angus"]}}
        site.config.write_text(json.dumps(document))
        with Daemon(site) as daemon:
            put(site, *FILES[:4])
            taken(site, *FILES[:4])
            until((folder / "angus.nc").exists, "the pages of angus")
            assert "angus" in (folder / "index.html").read_text()
            assert "<h1>angus" in (folder / "angus.html").read_text()
            assert {"angus-sheet.html", "angus.geojson", "angus.kml", "angus.csv"} <= {
                path.name for path in folder.iterdir()
            }
            until(lambda: site.undelivered() == 0 and painting(daemon), "mails with pictures")
            hung = [*writing(daemon), *painting(daemon)]
            signalled(writing(daemon), signal.SIGSTOP)
            signalled(painting(daemon), signal.SIGSTOP)
            sent = len(plain.mails)
            put(site, *FILES[4:5])
            begun = time.monotonic()
            until(lambda: len(plain.mails) > sent and len(shown.mails) > sent, "both mails")
            waits = [box.mails[sent].accepted - begun for box in (plain, shown)]
            print(f"mails beside drawings that hang: {waits[0]:.2f} s, with pictures {waits[1]:.2f} s")
            assert waits[1] - waits[0] < LIMIT + 2.0  # the most that a mail waits, and a busy machine
            assert daemon.log("mail goes without pictures")
            signalled(hung, signal.SIGKILL)
            before = times(folder)
            put(site, *FILES[5:6])
            until(lambda: times(folder) != before, "pages are written again: in the middle of them")
            signalled(writing(daemon), signal.SIGKILL)
            daemon.kill()
    assert broken(folder) == []


def test_pages_of_a_replay_are_written_by_command(site: Site, tmp_path: Path) -> None:
    put(site, *FILES)
    out = tmp_path / "out"
    command("run", "--replay", site.root, "--cache", site.cache, "--out", out)
    result = command("pages", "--state", out / "replay.sqlite", "--out", out / "pages")
    assert result.returncode == 0, result.stderr
    assert result.stdout == f"{out}/pages/index.html: 1 glider\n"
    page = (out / "pages" / "angus.html").read_text()
    assert "NORMAL" in page
    assert page.count("<svg") > 5


def test_pages_are_not_written_on_the_dockserver(site: Site) -> None:
    site.state.parent.mkdir()
    Store.open(site.state).close()
    for words in (("pages",), ("export", "--format", "csv")):
        result = command(*words, "-c", site.config, "--out", site.root / "new" / "pages")
        assert result.returncode == 2
        assert "nothing is written there" in result.stderr
        assert not (site.root / "new").exists()
    document = json.loads(site.config.read_text()) | {"pages": {"folder": str(site.root / "pages")}}
    site.config.write_text(json.dumps(document))
    result = command("run", "-c", site.config)
    assert result.returncode == 2
    assert "pages.folder: lies below the root" in result.stderr


def test_what_is_known_is_exported_by_command(site: Site, tmp_path: Path) -> None:
    put(site, *FILES)
    out = tmp_path / "out"
    command("run", "--replay", site.root, "--cache", site.cache, "--out", out)
    state = ("--state", out / "replay.sqlite")
    found = command("export", "--format", "geojson", *state)
    assert json.loads(found.stdout)["type"] == "FeatureCollection"
    assert command("export", "angus", "--format", "netcdf", "--out", out / "a.nc", *state).returncode == 0
    assert (out / "a.nc").read_bytes().startswith(b"\x89HDF")
    for form, name in (("csv", "new/dives.csv"), ("netcdf", "newer/dives.nc")):
        done = command("export", "angus", "--format", form, "--out", out / name, *state)
        assert done.returncode == 0 and (out / name).stat().st_size, done.stderr
    told = command("where", "angus", *state)
    assert "95 % within" in told.stdout
    told = command("where", "nobody", *state)
    assert told.stderr.startswith("nothing is known of a glider nobody; known are: angus")
    assert command("where", "angus", "--ais", "992441234", *state).stdout.startswith("!AIVDM,1,1,")
    assert command("where", "--ais", "992441234", *state).returncode == 2


def answers(url: str) -> bool:
    """Whether a server answers."""
    try:
        return httpx.get(url, timeout=60).status_code == 200
    except httpx.TransportError:
        return False
