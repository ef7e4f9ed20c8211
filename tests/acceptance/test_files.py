"""The daemon as installed, and whatever may become of the files on a dockserver."""

from __future__ import annotations

import json
import os
import shutil
import sys
import time
from pathlib import Path

import pytest

from acceptance.angus import FILES, SHORT, put, taken
from acceptance.support import (
    Daemon,
    Site,
    command,
    remora,
    results,
    until,
)
from gliderwatch.simulate.delivery import arrivals
from gliderwatch.store.state_file import Status

TAKEN, WAITING, DUPLICATE = Status.TAKEN, Status.WAITING, Status.DUPLICATE


# --------------------------------------------------------------------------- how files come


def test_files_of_long_names_are_taken_as_they_come(site: Site, daemon: Daemon) -> None:
    for file in FILES:
        put(site, file)
        taken(site, file)
    assert len(daemon.log("file taken")) == len(FILES)


def test_files_that_were_there_before_are_taken(site: Site) -> None:
    put(site, *FILES)
    with Daemon(site):
        taken(site, *FILES)


def test_a_file_moved_in_from_elsewhere_is_taken(site: Site, daemon: Daemon, tmp_path: Path) -> None:
    outside = tmp_path / FILES[0].name
    outside.write_bytes(FILES[0].data)
    outside.rename(site.folder("angus") / FILES[0].name)
    taken(site, FILES[0])


def test_a_file_of_a_short_name_is_taken_only_when_still(site: Site, daemon: Daemon) -> None:
    file, written, longest = SHORT[1], 0, 0.0
    begun = last = time.monotonic()
    with (site.folder("angus") / file.name).open("wb") as growing:
        while (now := time.monotonic()) < begun + 3.0:  # three times as long as it has to be still
            longest, last = max(longest, now - last), now
            growing.write(file.data[written : written + 64])
            growing.flush()
            written += 64
            time.sleep(0.1)
        early = site.statuses(file.name)
        growing.write(file.data[written:])
    taken(site, file)
    assert site.files()[file.name].size == len(file.data)
    if longest < 0.9:  # else this machine was too busy to let it grow
        assert early == [None], "taken while it grew"
        assert len(daemon.log("file taken")) == 1


def test_the_same_segment_under_its_long_name_counts_once(site: Site, daemon: Daemon) -> None:
    put(site, *SHORT)
    taken(site, *SHORT)
    before = results(site.state)
    for short, file in zip(SHORT, FILES, strict=True):
        (site.folder("angus") / short.name).rename(site.folder("angus") / file.name)
    names = [file.name for file in FILES]
    until(lambda: site.statuses(*names) == [DUPLICATE] * len(names), "all known")
    assert results(site.state) == before
    assert site.status()["gliders"]["angus"]["segments"] == len(FILES)


def test_a_longer_copy_replaces_a_shorter_one(site: Site, daemon: Daemon) -> None:
    put(site, *FILES[:2])
    cut = FILES[2].data[: len(FILES[2].data) // 2]
    path = site.put("angus", SHORT[2].name, cut)
    taken(site, *FILES[:2], SHORT[2])
    put(site, *FILES[3:])
    taken(site, *FILES[3:])
    half = results(site.state)
    path.rename(path.with_name(FILES[2].name))
    site.put("angus", FILES[2].name, FILES[2].data)
    taken(site, FILES[2])
    out = site.config.with_name("out")
    command("run", "-c", site.config, "--replay", site.root, "--out", out)
    assert half != results(site.state) == results(out / "replay.sqlite")


def test_a_shorter_copy_changes_nothing(site: Site, daemon: Daemon) -> None:
    put(site, *FILES)
    taken(site, *FILES)
    before = results(site.state)
    site.put("angus", FILES[3].name, FILES[3].data[:-2000])
    until(lambda: site.statuses(FILES[3].name) == [DUPLICATE], "seen")
    assert results(site.state) == before


def test_a_new_glider_folder_is_seen_while_it_runs(site: Site) -> None:
    site.configure("angus", "bruce")
    mission = remora(1.0)
    site.caches(mission)
    with Daemon(site):
        files = list(arrivals(mission))
        put(site, *files, glider="bruce")
        taken(site, *files)
        deeper = site.root / "stations" / "north" / "gliders" / "angus" / "from-glider"
        deeper.mkdir(parents=True)
        (deeper / FILES[0].name).write_bytes(FILES[0].data)
        taken(site, FILES[0])


def test_a_root_that_comes_later_is_watched_then(site: Site) -> None:
    shutil.rmtree(site.root)
    site.configure("angus", rescan_seconds=1)
    with Daemon(site) as daemon:
        until(lambda: daemon.log("folder left out"), "the missing root is told")
        put(site, *FILES)
        taken(site, *FILES)


def test_explicit_paths_and_caches_anywhere(site: Site, tmp_path: Path) -> None:
    config = site.configure("angus", cache=[f"{tmp_path}/stations/*/cache"], rescan_seconds=1)
    text = config.read_text(encoding="utf-8").replace(
        '"angus": null', f'"angus": {{"paths": ["{tmp_path}/archive/angus"]}}'
    )
    config.write_text(text, encoding="utf-8")
    (tmp_path / "archive" / "angus").mkdir(parents=True)
    with Daemon(site):
        (tmp_path / "archive" / "angus" / FILES[0].name).write_bytes(FILES[0].data)
        until(lambda: site.statuses(FILES[0].name) == [WAITING], "waits for its cache")
        for cache in list(site.cache.iterdir()):
            place = tmp_path / "stations" / "south" / "cache"
            place.mkdir(parents=True, exist_ok=True)
            shutil.copy(cache, place / cache.name.upper())
        taken(site, FILES[0])


def test_the_polling_observer_sees_what_comes(site: Site) -> None:
    site.configure("angus", observer="polling", rescan_seconds=3600)
    with Daemon(site):
        put(site, *FILES)
        taken(site, *FILES)


def test_what_was_missed_is_found_by_the_rescan(site: Site) -> None:
    site.configure("angus", rescan_seconds=1, roots=[str(site.root.with_name("link"))])
    target = site.root.with_name("elsewhere")
    (target / "angus" / "from-glider").mkdir(parents=True)
    site.root.with_name("link").symlink_to(target)
    with Daemon(site):
        for file in FILES[:3]:
            (target / "angus" / "from-glider" / file.name).write_bytes(file.data)
        taken(site, *FILES[:3])


# --------------------------------------------------------------------------- what waits, what is bad


def test_a_file_waits_for_its_cache_and_is_taken_when_it_comes(site: Site, daemon: Daemon) -> None:
    caches = {path: path.read_bytes() for path in site.cache.iterdir()}
    for path in caches:
        path.unlink()
    put(site, *FILES)
    until(lambda: site.statuses(FILES[0].name) == [WAITING], "waits")
    waiting = {Path(w["path"]).name: w for w in site.status()["waiting"]}
    crc = {path.stem for path in caches}
    assert {w["cache"] for w in waiting.values()} == crc
    assert f"cache file {crc.copy().pop()}.cac is missing" in waiting[FILES[0].name]["reason"]
    for path, content in caches.items():
        path.with_suffix(".part").write_bytes(content)
        path.with_suffix(".part").rename(path)
    taken(site, *FILES)
    assert site.status()["waiting"] == []


def test_a_waiting_file_that_was_renamed_does_not_wait_for_ever(site: Site) -> None:
    site.configure("angus", rescan_seconds=1)
    caches = {path: path.read_bytes() for path in site.cache.iterdir()}
    for path in caches:
        path.unlink()
    with Daemon(site):
        (short,) = put(site, SHORT[0])
        until(lambda: site.statuses(short.name) == [WAITING], "waits")
        short.rename(short.with_name(FILES[0].name))
        until(lambda: site.statuses(FILES[0].name) == [WAITING], "waits under its long name")
        for path, content in caches.items():
            path.write_bytes(content)
        taken(site, FILES[0])
        until(lambda: site.statuses(short.name) == [DUPLICATE], "the old name is settled")


def test_unknown_gliders_are_listed_and_not_guessed(site: Site, daemon: Daemon) -> None:
    mission = remora(0.5)
    site.caches(mission)
    files = list(arrivals(mission))
    put(site, *files, glider="angus")  # in the folder of another: the header tells
    until(lambda: site.statuses(*(f.name for f in files)) == [Status.UNKNOWN] * len(files), "listed")
    told = site.status()
    assert told["unknown_gliders"] == ["bruce"]
    assert told["gliders"]["angus"]["segments"] == 0
    assert "gliders not in the configuration: bruce" in command("status", "-c", site.config).stdout


def test_garbage_is_quarantined_and_the_next_file_goes_on(site: Site, daemon: Daemon) -> None:
    folder = site.folder("angus")
    whole = FILES[1].data
    bad = {
        "cut.sbd": whole[:73],
        "angus-2024-121-0-900.sbd": b"",
        "angus-2024-121-0-901.sbd": b"\x00" * 5000,
        "angus-2024-121-0-902.sbd": whole.replace(b"encoding_ver:    5", b"encoding_ver:    7"),
        "angus-2024-121-0-903.scd": os.urandom(0) + b"\xff\xff" * 4000,
        "angus-2024-121-0-904.sbd": whole.replace(b"sensors_per_cycle:    2", b"sensors_per_cycle:    9"),
    }
    for name, data in bad.items():
        assert data != whole
        (folder / name).write_bytes(data)
    (folder / "angus-2024-121-0-905.sbd").mkdir()
    os.mkfifo(folder / "angus-2024-121-0-906.sbd")
    (folder / "angus-2024-121-0-907.sbd").symlink_to("/dev/zero")
    unspeakable = folder / os.fsdecode(b"angus-\xff\n\x1b[31m.sbd")
    unspeakable.write_bytes(whole)
    put(site, *FILES)
    taken(site, *FILES)
    expected = len(bad) + 4
    until(lambda: len(site.status()["quarantined"]) == expected, "quarantined")
    reasons = {Path(q["path"]).name: q["reason"] for q in site.status()["quarantined"]}
    assert set(bad) < set(reasons)
    assert all(len(reason) > 15 for reason in reasons.values()), reasons
    shown = command("status", "-c", site.config).stdout
    assert f"{expected} quarantined" in shown
    assert "\x1b[31m" not in shown
    for name in bad:
        assert (folder / name).exists()


@pytest.mark.slow
def test_damaged_files_never_end_it(site: Site, daemon: Daemon) -> None:
    """Every file of a mission with some bytes changed at seeded places."""
    whole = b"".join(file.data for file in FILES)
    for number, file in enumerate(FILES):
        data = bytearray(file.data)
        for place in range(400, len(data), 97 + number):
            data[place] ^= whole[place * 31 % len(whole)] | 1
        site.put("angus", file.name, bytes(data))
    names = [file.name for file in FILES]
    until(lambda: None not in site.statuses(*names), "all seen")
    until(lambda: all(s in (TAKEN, Status.QUARANTINED) for s in site.statuses(*names)), "all judged")
    put(site, *FILES)
    taken(site, *FILES)
    out = site.config.with_name("out")
    command("run", "-c", site.config, "--replay", site.root, "--out", out)
    segments = site.status()["gliders"]["angus"]["segments"]
    assert segments == len(FILES)
    assert daemon.alive()


POISON = """
from gliderwatch.service import run
good = run.process
def process(state, segment, *rest):
    if segment.id.name.endswith("-3"):
        raise ZeroDivisionError("unforeseen")
    return good(state, segment, *rest)
run.process = process
from gliderwatch.cli.main import main
main()
"""


def test_a_segment_that_the_core_cannot_bear_does_not_stop_the_others(site: Site) -> None:
    with Daemon(site, (sys.executable, "-c", POISON)) as daemon:
        put(site, *FILES)
        taken(site, *(file for file in FILES if "-3.sbd" not in file.name))
        (bad,) = site.status()["quarantined"]
        assert daemon.alive()
    assert "ZeroDivisionError: unforeseen" in bad["reason"]
    assert Path(bad["path"]).stem.endswith("-3")
    assert "ZeroDivisionError" in daemon.log("file cannot be assessed")[0]["exception"]


def test_nothing_below_the_root_changes(site: Site) -> None:
    site.configure("angus", rescan_seconds=1)
    put(site, *FILES)
    put(site, SHORT[0])
    (site.folder("angus") / "bad.sbd").write_bytes(FILES[0].data[:50])
    site.put("stranger", "stranger-2024-121-0-0.sbd", FILES[0].data.replace(b"angus-", b"stranger-"))
    for folder in [site.root, *site.root.rglob("*")]:
        if folder.is_dir():
            folder.chmod(0o555)
    before, cache = site.tree(), sorted(path.name for path in site.cache.iterdir())
    with Daemon(site) as daemon:
        until(lambda: len(site.files()) == len(FILES) + 3, "all judged")
        daemon.stop()
    assert site.tree() == before
    assert sorted(path.name for path in site.cache.iterdir()) == cache


@pytest.mark.slow
def test_a_glider_whose_folder_is_a_link_is_named_in_status_and_its_cure_works(
    site: Site, tmp_path: Path
) -> None:
    target = tmp_path / "disk2" / "angus" / "from-glider"
    target.mkdir(parents=True)
    shutil.rmtree(site.root / "angus")
    (site.root / "angus").symlink_to(target.parent)
    (target / FILES[0].name).write_bytes(FILES[0].data)
    with Daemon(site):
        shown = command("status", "-c", site.config).stdout
        assert f"angus: {site.root}/angus is a symbolic link, and links are not followed" in shown
        assert f"(write `paths: [{target}]` below the glider)" in shown
        link = {"path": f"{site.root}/angus", "target": str(target)}
        assert site.status()["links"] == {"angus": link}
    text = site.config.read_text(encoding="utf-8")
    assert "angus" in text
    config = json.loads(text)
    config["gliders"]["angus"] = {"paths": [str(target)]}
    site.config.write_text(json.dumps(config), encoding="utf-8")
    with Daemon(site):
        taken(site, FILES[0])
        assert site.status()["links"] == {}
