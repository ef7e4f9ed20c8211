"""Pages of the installed command: written beside the watch, never in its way; and of a past mission."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path

import httpx

from acceptance.angus import FILES, put, taken
from acceptance.support import Daemon, Site, command, until
from gliderwatch.store.state_file import Store


def with_pages(site: Site) -> Path:
    """The site's configuration with pages; their folder."""
    folder = site.config.with_name("pages")
    document = json.loads(site.config.read_text()) | {"pages": {"folder": str(folder)}}
    site.config.write_text(json.dumps(document))
    return folder


def drawing(daemon: Daemon) -> list[int]:
    """The processes that write pages: children of the daemon that yield to all others."""
    children = Path(f"/proc/{daemon.pid}/task/{daemon.pid}/children").read_text().split()
    usual = os.getpriority(os.PRIO_PROCESS, daemon.pid)
    return [int(pid) for pid in children if os.getpriority(os.PRIO_PROCESS, int(pid)) > usual]


def test_pages_follow_each_file_and_a_stopped_drawer_holds_up_nothing(site: Site) -> None:
    folder = with_pages(site)
    with Daemon(site) as daemon:
        put(site, *FILES[:4])
        taken(site, *FILES[:4])
        until((folder / "angus.html").exists, "page of angus")
        until(lambda: "angus" in (folder / "index.html").read_text(), "page of all")
        assert "<h1>angus" in (folder / "angus.html").read_text()
        until((folder / "angus.nc").exists, "NetCDF of angus")
        assert {"angus-sheet.html", "angus.geojson", "angus.kml", "angus.csv"} <= {
            path.name for path in folder.iterdir()
        }
        until(lambda: drawing(daemon), "the process that draws")
        for pid in drawing(daemon):
            os.kill(pid, signal.SIGSTOP)
        put(site, *FILES[4:6])
        taken(site, *FILES[4:6])
        for pid in drawing(daemon):
            os.kill(pid, signal.SIGKILL)
        before = (folder / "index.html").stat().st_mtime_ns
        put(site, *FILES[6:7])
        taken(site, *FILES[6:7])
        until(lambda: (folder / "index.html").stat().st_mtime_ns > before, "written again")


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
