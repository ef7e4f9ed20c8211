"""Cache files as people leave them, live and in a replay: cut, misnamed, changed, only inside of a file."""

from __future__ import annotations

import json
import shutil
from contextlib import closing
from pathlib import Path

import pytest

import dinkum
from acceptance.angus import FILES, MISSION, put, taken
from acceptance.support import Daemon, Site, command, until
from acceptance.test_replay import counts
from gliderwatch.model import SegmentId
from gliderwatch.simulate.delivery import FileForm, arrivals
from gliderwatch.store.state_file import Status, Store
from integration.test_science import NAME, NO_DEPTH, OTHER, SCIENCE, flight, science

WHOLE = list(arrivals(MISSION, FileForm(factored=False)))
WAITING = Status.WAITING


def one_cache(site: Site) -> Path:
    """The cache file of all files of the glider, the only one."""
    (path,) = site.cache.iterdir()
    return path


def exchanged(text: bytes) -> bytes:
    """A list in which heading and pitch have each other's place; of the same length."""
    return text.replace(b"m_heading", b"m_x").replace(b"m_pitch ", b"m_heading ").replace(b"m_x", b"m_pitch")


def test_the_list_of_one_whole_file_serves_all_that_leave_it_out(site: Site, daemon: Daemon) -> None:
    one_cache(site).unlink()
    put(site, *FILES[1:])
    until(lambda: site.statuses(FILES[-1].name) == [WAITING], "waits")
    put(site, WHOLE[0])
    taken(site, WHOLE[0], *FILES[1:])
    assert site.status()["waiting"] == []
    assert len(list(Path(f"{site.state}.lists").iterdir())) == 1


def test_the_list_is_there_after_a_restart_when_the_file_that_held_it_is_gone(site: Site) -> None:
    one_cache(site).unlink()
    with Daemon(site):
        (path,) = put(site, WHOLE[0])
        taken(site, WHOLE[0])
    path.unlink()
    put(site, *FILES[1:])
    with Daemon(site):
        taken(site, *FILES[1:])


def test_a_list_that_is_not_the_one_its_name_says_is_named_and_not_used(site: Site, daemon: Daemon) -> None:
    cache = one_cache(site)
    good = cache.read_bytes()
    cache.write_bytes(exchanged(good))
    assert cache.read_bytes() != good
    put(site, FILES[0])
    until(lambda: site.statuses(FILES[0].name) == [WAITING], "waits")
    (waiting,) = site.status()["waiting"]
    assert f"cache file {cache} cannot be used: it is cut or changed, or is another list" in waiting["reason"]
    report = json.loads(command("doctor", "--json", "-c", site.config).stdout)
    (found,) = [f for f in report["findings"] if f["topic"] == "caches"]
    assert found["level"] == "error"
    assert str(cache) in found["text"]
    assert f"not {cache.stem}" in found["text"]
    (cache.with_name(cache.stem.upper() + ".Cac")).write_bytes(good)  # beside it
    taken(site, FILES[0])


def test_a_replay_takes_the_list_out_of_any_of_its_files(site: Site, tmp_path: Path) -> None:
    one_cache(site).unlink()  # a replay would find it beside the mission
    folder = tmp_path / "mission"
    folder.mkdir()
    for file in (*FILES[:-1], WHOLE[-1]):
        (folder / file.name).write_bytes(file.data)
    run = command("run", "--replay", folder)
    assert run.returncode == 0, run.stderr
    assert counts(run.stdout + run.stderr) == {"taken": len(FILES)}


def test_a_replay_names_the_cache_file_that_is_another(site: Site, tmp_path: Path) -> None:
    folder = tmp_path / "mission"
    folder.mkdir()
    shutil.move(site.cache, folder / "cache")
    cache = next((folder / "cache").iterdir())
    cache.write_bytes(exchanged(cache.read_bytes()))
    (folder / FILES[0].name).write_bytes(FILES[0].data)
    run = command("run", "--replay", folder)
    assert counts(run.stdout + run.stderr) == {"waiting": 1}
    assert "cannot be used: it is cut or changed" in " ".join((run.stdout + run.stderr).split())


def depths(site: Site) -> int:
    """How many samples of the depth are known of the segment of `flight`."""
    with closing(Store.reading(site.state)) as store:
        identity = SegmentId(dinkum.OPENED_AT, "unit_7", NAME)
        return len(store.segments.get(identity).get("depth"))


def test_the_science_file_that_comes_after_its_flight_file_gives_the_depth(site: Site) -> None:
    site.configure("unit_7")
    site.cache.joinpath(f"{dinkum.CRC}.cac").write_bytes(dinkum.sensor_list(NO_DEPTH))
    site.cache.joinpath(f"{OTHER}.cac").write_bytes(dinkum.sensor_list(SCIENCE, OTHER))
    with Daemon(site) as daemon:
        site.put("unit_7", f"{NAME}.sbd", flight())
        until(lambda: site.statuses(f"{NAME}.sbd") == [Status.TAKEN], "taken")
        assert depths(site) == 0
        site.put("unit_7", f"{NAME}.tbd", science())
        until(lambda: depths(site) > 30, "the depth is there")
        site.put("unit_7", f"{NAME}.tcd", b"no data")  # looked at, and of no use
        site.put("unit_7", "unit_7-2024-250-1-4.sbd", b"no data")
        until(lambda: site.statuses("unit_7-2024-250-1-4.sbd") == [Status.QUARANTINED], "gone on")
        assert site.statuses(f"{NAME}.sbd") == [Status.TAKEN]
        assert len(daemon.log("file taken")) == 2


@pytest.mark.slow
def test_a_science_file_that_came_while_nobody_watched_gives_the_depth(site: Site) -> None:
    site.configure("unit_7")
    site.cache.joinpath(f"{dinkum.CRC}.cac").write_bytes(dinkum.sensor_list(NO_DEPTH))
    site.cache.joinpath(f"{OTHER}.cac").write_bytes(dinkum.sensor_list(SCIENCE, OTHER))
    with Daemon(site):
        site.put("unit_7", f"{NAME}.sbd", flight())
        until(lambda: site.statuses(f"{NAME}.sbd") == [Status.TAKEN], "taken")
    assert depths(site) == 0
    site.put("unit_7", f"{NAME}.tbd", science())
    for _ in range(2):  # at the second start there is nothing to do any more
        with Daemon(site) as daemon:
            until(lambda: depths(site) > 30, "the depth is there")
    assert len(daemon.log("file taken")) == 2  # of all three lives
