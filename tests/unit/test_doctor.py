"""What the doctor finds: each finding on a set-up that is broken in one way, and none on a good one."""

from __future__ import annotations

import os
import stat
import subprocess
import time
from collections import namedtuple
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

import dinkum
from alert_support import alert
from gliderwatch.cli import doctor, doctor_checks
from gliderwatch.cli.doctor_checks import (
    Finding,
    Level,
    as_lines,
    error,
    exit_code,
    note,
    ok,
    report,
    warning,
)
from gliderwatch.config import load
from gliderwatch.delivery import channels
from gliderwatch.service.liveness import PidLock, alive_path
from gliderwatch.service.preconditions import check
from gliderwatch.slocum.folders import find_places, scan
from gliderwatch.slocum.sensors import SENSORS
from gliderwatch.store import outbox
from gliderwatch.store.state_file import Store

TEXT = """\
dockserver:
  roots: [gliders]
  cache: [cache]
state: {path: state/s.sqlite}
gliders: {electa: }
channels:
  hook: {url: json://127.0.0.1:1/x}
recipients:
  pilot: {channels: [hook]}
"""
NOW = 1_800_000_000.0
Usage = namedtuple("Usage", "total used free")
Doctor = Callable[..., list[Finding]]
ALL = tuple(
    (names[0], 4, "m")
    for table in (doctor_checks.NEEDED, doctor_checks.WANTED, doctor_checks.USEFUL)
    for names in table
)
SENSORS_OF_ALL = tuple(dict.fromkeys(ALL))


def put(
    tree: Path,
    lacking: tuple[str, ...] = (),
    name: str = "electa-2026-1-0-0",
    crc: str = "0abc12ef",
    **tags: Any,
) -> Path:
    """A file of electa, and its cache file; without some sensors."""
    sensors = tuple(s for s in SENSORS_OF_ALL if s[0] not in lacking)
    (tree / "cache" / f"{crc}.cac").write_bytes(dinkum.sensor_list(sensors, crc))
    path = tree / "gliders" / "electa" / "from-glider" / f"{name}.sbd"
    path.write_bytes(dinkum.header(name, crc=crc, n_held=len(sensors), **tags))
    return path


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A set-up on which nothing is wrong; the machine too is as it should be."""
    for folder in ("gliders/electa/from-glider", "cache", "state"):
        (tmp_path / folder).mkdir(parents=True)
    put(tmp_path)
    Store.open(tmp_path / "state" / "s.sqlite").close()
    monkeypatch.setattr(doctor, "_ntp", lambda: "yes")
    monkeypatch.setattr(doctor, "_limit", lambda name: 8192)
    monkeypatch.setattr(doctor, "_file_system", lambda path: "ext4")
    return tmp_path


def files(tree: Path) -> list[Path]:
    """All that is there, but for what SQLite puts beside a state file to read it."""
    return sorted(path for path in tree.rglob("*") if path.suffix not in {".sqlite-shm", ".sqlite-wal"})


@pytest.fixture
def examined(tree: Path) -> Doctor:
    """What is found, but for what is well or only a note; all with `all_`."""

    def _examined(
        text: str = TEXT, *, all_: bool = False, runs: bool = True, send: bool = False
    ) -> list[Finding]:
        path = tree / "c.yml"
        path.write_text(text, encoding="utf-8")
        life = PidLock(tree / "state" / "s.sqlite") if runs else None
        if life is not None:
            life.beat()
        before = files(tree)
        found = list(doctor.examine(path, send=send))
        assert files(tree) == before, "a doctor leaves nothing behind"
        if life is not None:
            life.end()
        lines = [line for f in found for line in as_lines(f)]
        assert max(map(len, lines)) <= 80
        return [f for f in found if all_ or f.level > Level.NOTE]

    return _examined


def one(found: list[Finding], level: Level, topic: str, *parts: str) -> bool:
    """Whether this is all that was found, and it has a cure."""
    assert [(f.level, f.topic) for f in found] == [(level, topic)], found
    assert found[0].cure
    return all(part in found[0].text for part in parts)


def test_nothing_is_wrong_with_a_good_set_up(examined: Doctor) -> None:
    assert examined() == []
    topics = list(dict.fromkeys(f.topic for f in examined(all_=True)))
    assert topics == [
        *("program", "configuration", "folders", "user", "inotify", "files", "caches", "sensors", "clock"),
        *("disk", "state", "channels", "service"),
    ]


def test_the_worst_decides_how_it_ends() -> None:
    fine, worse = [ok("a", "b"), note("a", "b")], warning("a", "b", "c")
    assert (exit_code([]), exit_code(fine), exit_code([*fine, worse])) == (0, 0, 1)
    assert exit_code([worse, error("a", "b", "c")]) == 2
    assert report([worse])["result"] == "warnings"
    assert report(fine)["findings"][0] == {"level": "ok", "topic": "a", "text": "b", "cure": None}


def test_lines_fit_and_hold_nothing_that_is_no_text() -> None:
    lines = as_lines(error("files", "/data/" + "x" * 300 + "\x1b[31m\n", "c" * 90))
    assert max(map(len, lines)) == 80
    assert "\x1b" not in "".join(lines)


def test_a_configuration_that_cannot_be_read(examined: Doctor, tree: Path) -> None:
    found = examined("dockserver: {rots: [x]}\n", runs=False)
    assert one(found[:1], Level.ERROR, "configuration", "c.yml:1", "roots: is missing")
    (only,) = (f for f in doctor.examine(tree / "none.yml") if f.level == Level.ERROR)
    assert "none.yml" in only.text


def test_what_check_finds_is_told_under_its_topic(examined: Doctor) -> None:
    assert one(
        examined(TEXT.replace("[gliders]", "[gliders, no]")),
        Level.ERROR,
        "folders",
        "line 2",
        "no is not there",
    )
    assert one(
        examined(TEXT.replace("json://127.0.0.1:1/x", "nonsense://x")),
        Level.ERROR,
        "channels",
        "not an Apprise",
    )
    found = examined(TEXT.replace("state/s.sqlite", "gliders/s.sqlite"), runs=False)
    assert [(f.level, f.topic) for f in found] == [(Level.ERROR, "state"), (Level.WARNING, "service")]


def test_an_old_python(examined: Doctor, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "PYTHON", (4, 0))
    assert one(examined(), Level.ERROR, "program", "gliderwatch ")


@pytest.fixture
def closed(examined: Doctor, tree: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[Finding]]:
    """What is found where a user, of no group of the cache folder's, is shut out of it."""
    real_access, real_stat, cache = os.access, Path.stat, tree / "cache"
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != cache and real_access(path, mode))
    monkeypatch.setattr(os, "geteuid", lambda: 4_000_001)
    monkeypatch.setattr(os, "getegid", lambda: 4_000_001)

    def _closed(
        *, uid: int = 0, gid: int = 4_000_002, mode: int = 0o750, mine: Sequence[int] = (), late: bool = False
    ) -> list[Finding]:
        def stat_(self: Path, **how: Any) -> os.stat_result:
            true = list(real_stat(self, **how))
            if self == cache:
                true[0], true[4], true[5] = stat.S_IFDIR | mode, uid, gid
            return os.stat_result(true) if self == cache else real_stat(self, **how)

        with monkeypatch.context() as patch:
            patch.setattr(os, "getgroups", lambda: list(mine))
            patch.setattr(os, "getgrouplist", lambda name, own: [own, gid] if late else [own])
            patch.setattr(Path, "stat", stat_)
            return [f for f in examined() if f.topic == "user"]

    return _closed


def test_a_group_that_is_missing(closed: Callable[..., list[Finding]]) -> None:
    found = closed()
    assert one(found, Level.ERROR, "user", "4000001 is not in group 4000002", "cache")
    assert "SupplementaryGroups=4000002" in found[0].cure
    assert one(closed(late=True), Level.ERROR, "user", "but not yet here")


def test_a_folder_that_is_closed_to_its_owner_or_its_group(closed: Callable[..., list[Finding]]) -> None:
    found = closed(mode=0o700, mine=[4_000_002])
    assert one(found, Level.ERROR, "user", "closed to its group")
    assert found[0].cure.startswith("chmod g+rx ")
    found = closed(mode=0o070, uid=4_000_001)
    assert found[0].cure.startswith("chmod u+rx ")


@pytest.mark.parametrize(
    ("gid", "mode", "group"),
    [(0, 0o700, "root"), (0, 0o750, "root"), (4_000_002, 0o700, "4000002"), (4_000_002, 0o750, "docker")],
)
def test_the_cure_of_a_closed_folder_is_never_a_privilege(
    closed: Callable[..., list[Finding]], monkeypatch: pytest.MonkeyPatch, gid: int, mode: int, group: str
) -> None:
    monkeypatch.setattr(doctor, "_group", lambda gid: group)
    (finding,) = closed(gid=gid, mode=mode)
    assert f"(root:{group}, mode {mode:04o}) is closed to 4000001" in finding.text
    assert finding.cure.startswith("setfacl -R -m u:4000001:rX ")
    assert "usermod" not in finding.cure
    assert "SupplementaryGroups" not in finding.cure


def test_a_folder_that_went_is_no_raw_exception(
    examined: Doctor, tree: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tree / "dangling").symlink_to(tree / "nowhere")
    monkeypatch.setattr(os, "geteuid", lambda: 4_000_001)
    found = examined(TEXT.replace("[cache]", f"[cache, {tree}/dangling]"))
    assert not [f for f in found if "Error" in f.text]
    assert any("dangling cannot be looked at: No such file" in f.text for f in found if f.topic == "user")


def test_a_cache_that_is_closed_is_no_raw_exception(
    closed: Callable[..., list[Finding]], examined: Doctor, tree: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = os.listdir

    def shut(folder: Path) -> list[str]:
        if Path(folder) == tree / "cache":
            raise PermissionError(13, "Permission denied", str(folder))
        return real(folder)

    monkeypatch.setattr(os, "listdir", shut)
    found = examined(all_=True)
    assert not [f for f in found if "could not be looked at" in f.text]
    assert any("cache cannot be read: Permission denied" in f.text for f in found if f.topic == "caches")


def test_root_is_told_that_it_sees_too_much(examined: Doctor, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    assert any(f.topic == "user" and "root may read everything" in f.text for f in examined(all_=True))


@pytest.mark.parametrize(("allowed", "level"), [(3, Level.ERROR), (4, Level.WARNING), (8, None)])
def test_too_few_watches(
    examined: Doctor, monkeypatch: pytest.MonkeyPatch, allowed: int, level: Level | None
) -> None:
    monkeypatch.setattr(doctor, "_limit", lambda name: allowed)  # gliders, two below it, the cache
    found = examined()
    if level is None:
        assert found == []
    else:
        assert one(found, level, "inotify", "4 folders to watch")
        assert "max_user_watches" in found[0].cure
    assert examined(TEXT.replace("cache: [cache]", "cache: [cache]\n  observer: polling")) == []


def test_a_share_on_which_inotify_sees_nothing(examined: Doctor, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "_file_system", lambda path: "nfs4")
    found = examined()
    assert one(found, Level.WARNING, "inotify", "nfs4")
    assert "polling" in found[0].cure


def test_the_file_system_of_a_path_is_that_of_the_nearest_mount(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mounts = tmp_path / "mountinfo"
    mounts.write_text(
        "1 0 8:1 / / rw - ext4 /dev/sda rw\n2 1 0:5 / /mnt/my\\040share rw shared:1 - nfs4 host:/x rw\n"
    )
    monkeypatch.setattr(doctor, "_MOUNTS", mounts)
    assert doctor._file_system(Path("/mnt/my share/gliders")) == "nfs4"
    assert doctor._file_system(Path("/mnt/other")) == "ext4"


def test_cache_files_that_are_missing(examined: Doctor, tree: Path) -> None:
    for i in range(3):
        put(tree, name=f"electa-2025-1-0-{i}", crc="deadbeef")
    (tree / "cache" / "deadbeef.cac").unlink()
    found = examined()
    assert one(found, Level.ERROR, "caches", "deadbeef.cac is missing for 3 files", "electa-2025-1-0-")
    assert str(tree / "cache") in found[0].cure


def test_only_the_newest_headers_are_read(
    examined: Doctor, tree: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(doctor_checks, "MOST_READ", 1)
    old = put(tree, name="electa-2025-1-0-0", crc="deadbeef")
    (tree / "cache" / "deadbeef.cac").unlink()
    os.utime(old, (0, 0))
    assert examined() == []
    assert any("headers of the newest 1 files read" in f.text for f in examined(all_=True))


def test_files_that_are_no_use_are_named(examined: Doctor, tree: Path) -> None:
    path = put(tree, name="electa-2025-1-0-0")
    path.write_bytes(b"junk\n")
    told = [f.text for f in examined(all_=True) if f.level == Level.NOTE and f.topic == "files"]
    assert told == [f"{path}: not a Slocum data file, or damaged at its start"]


@pytest.mark.parametrize(
    ("lacking", "level", "parts"),
    [
        (("m_present_time",), Level.ERROR, ("m_present_time", "nothing can be assessed")),
        (("m_gps_lon",), Level.ERROR, ("m_gps_lon", "nothing can be assessed")),
        (("m_water_vx", "m_water_vy"), Level.WARNING, ("m_water_vx or m_initial_water_vx", "flag 2")),
        (("m_water_vy",), Level.WARNING, ("m_water_vy or m_initial_water_vy (no current", "flag 2")),
        (("m_depth",), Level.WARNING, ("m_depth or m_pressure (drift is told",)),
        (("m_pitch",), Level.WARNING, ("m_pitch (no asymmetry",)),
        (("m_roll",), Level.WARNING, ("m_roll (no sign of a lost wing",)),
        (("m_lon",), Level.NOTE, ("m_lon (the way of a dive",)),
        (("m_heading",), Level.ERROR, ("m_heading or c_heading",)),
        (("m_depth", "m_roll"), Level.WARNING, ("m_depth", "m_roll")),
        (("m_gps_mag_var",), Level.NOTE, ("m_gps_mag_var", "World Magnetic Model")),
    ],
)
def test_sensors_that_are_left_out(
    examined: Doctor, tree: Path, lacking: tuple[str, ...], level: Level, parts: tuple[str, ...]
) -> None:
    put(tree, lacking)
    found = [f for f in examined(all_=True) if f.topic == "sensors"]
    assert found[0].level == level
    assert "electa-2026-1-0-0" in found[0].text
    assert all(part in found[0].text for part in parts)
    assert "sbdlist" in found[0].cure


@pytest.mark.real
def test_a_real_glider_in_a_folder_of_another_name(shared_data: Path, tmp_path: Path) -> None:
    """The folder of maria holds the files of maria-997: with that name alone nothing would be taken."""
    mission = shared_data / "maria-2022"
    folders = f"{{roots: [{mission}], cache: [{mission / 'cache'}]}}"
    config = tmp_path / "c.yml"
    paths = f"{{paths: [{mission / 'from-glider'}]}}"
    config.write_text(f"dockserver: {folders}\nstate: {{path: s.sqlite}}\ngliders: {{maria: {paths}}}\n")
    (told,) = (f for f in doctor.examine(config) if f.topic == "files" and f.level == Level.ERROR)
    assert told.text.startswith("69 files in the folder of maria are of maria-997")
    assert "name the glider maria-997" in told.cure


@pytest.mark.real
def test_sensors_that_a_real_glider_leaves_out(shared_data: Path, tmp_path: Path) -> None:
    """Depth, pitch, roll and current are in its files: of these nothing is said."""
    mission = shared_data / "maria-2022"
    folders = f"{{roots: [{mission}], cache: [{mission / 'cache'}]}}"
    glider = f"{{maria-997: {{paths: [{mission / 'from-glider'}]}}}}"
    config = tmp_path / "c.yml"
    config.write_text(f"dockserver: {folders}\nstate: {{path: s.sqlite}}\ngliders: {glider}\n")
    (told,) = (f.text for f in doctor.examine(config) if f.topic == "sensors")
    assert told == (
        "maria-997 (maria-997-2022-165-0-36) lacks m_final_water_vx, m_final_water_vy (the current of a dive "
        "stays provisional until the next file); m_gps_mag_var (declination from the World Magnetic Model); "
        "m_avg_speed or m_speed (no speed of the glider's own to compare with)"
    )


def test_the_newest_sbd_tells_the_sensors(examined: Doctor, tree: Path) -> None:
    put(tree, ("m_depth",), name="electa-2025-1-0-0", crc="00000001", opened_at=dinkum.OPENED_AT - 1000)
    put(
        tree,
        ("m_depth",),
        name="electa-2027-1-0-0",
        crc="00000001",
        filename_extension="mbd",
        opened_at=dinkum.OPENED_AT + 9,
    )
    assert examined() == []


def test_a_file_that_holds_its_own_sensor_list(examined: Doctor, tree: Path) -> None:
    path = put(tree, factored=False)
    sensors = tuple(s for s in SENSORS_OF_ALL if s[0] != "m_roll")
    head = dinkum.header("electa-2026-1-0-0", factored=False, n_held=len(sensors))
    path.write_bytes(head + dinkum.sensor_list(sensors))
    assert one(examined(), Level.WARNING, "sensors", "m_roll")


def test_the_sensors_asked_for_are_those_that_are_read() -> None:
    asked = {
        name
        for table in (doctor_checks.NEEDED, doctor_checks.WANTED, doctor_checks.USEFUL)
        for names in table
        for name in names
    }
    assert asked <= set(SENSORS)


def test_the_clock(examined: Doctor, tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert [f.level for f in doctor.clock({}, 1e9)] == [Level.ERROR]
    path = put(tree)
    os.utime(path, (time.time() + 7200, time.time() + 7200))
    assert one(examined(), Level.WARNING, "clock", path.name, "2.0 h in the future")
    os.utime(path)
    monkeypatch.setattr(doctor, "_ntp", lambda: "no")
    assert one(examined(), Level.WARNING, "clock", "not synchronised")
    monkeypatch.setattr(doctor, "_ntp", lambda: None)
    assert examined() == []


@pytest.mark.parametrize(("output", "told"), [("yes\n", "yes"), ("no\n", "no"), ("", None)])
def test_timedatectl_is_asked(monkeypatch: pytest.MonkeyPatch, output: str, told: str | None) -> None:
    monkeypatch.setattr(
        subprocess, "run", lambda command, **_: subprocess.CompletedProcess(command, 0, output, "")
    )
    assert doctor._ntp() == told


def test_a_disk_nearly_full(examined: Doctor, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shutil.disk_usage", lambda _: Usage(1e9, 0.7e9, 0.3e9))
    assert one(examined(), Level.WARNING, "disk", "300 MB free", "less than 500 MB")


def test_a_file_system_that_cannot_be_written(examined: Doctor, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor.shutil, "disk_usage", lambda _: Usage(9e9, 1e9, 8e9))
    status = namedtuple("status", "f_flag f_files f_favail")
    monkeypatch.setattr(os, "statvfs", lambda _: status(os.ST_RDONLY, 10, 10))
    assert one(examined(), Level.ERROR, "disk", "read-only")
    monkeypatch.setattr(os, "statvfs", lambda _: status(0, 10, 0))
    assert one(examined(), Level.ERROR, "disk", "inodes")


def test_no_room_for_temporary_files(examined: Doctor, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(doctor.tempfile, "TemporaryFile", full)
    assert one(examined(), Level.ERROR, "disk", "No space left")


def test_a_state_file_that_is_damaged(examined: Doctor, tree: Path) -> None:
    path = tree / "state" / "s.sqlite"
    with closing(Store.open(path)) as store:
        store.post(alert("a"), ["hook"], NOW)
    content = bytearray(path.read_bytes())
    content[4096 : 3 * 4096] = b"\xff" * (2 * 4096)
    path.write_bytes(bytes(content))
    found = [f for f in examined() if f.topic == "state"]
    assert one(found, Level.ERROR, "state", "damaged")


def test_a_state_file_that_is_none(examined: Doctor, tree: Path) -> None:
    other = tree / "state" / "other"
    other.write_bytes(b"not a database" * 1000)
    other.replace(tree / "state" / "s.sqlite")
    assert one([f for f in examined() if f.topic == "state"], Level.ERROR, "state", "a text file")


def test_a_state_file_of_a_newer_gliderwatch(examined: Doctor, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gliderwatch.store.database.SCHEMA", 0)
    assert one([f for f in examined() if f.topic == "state"], Level.ERROR, "state", "has schema")


def test_no_state_file_yet(examined: Doctor, tree: Path) -> None:
    (tree / "state" / "s.sqlite").unlink()
    assert one(examined(runs=False), Level.WARNING, "service", "does not run")


def test_messages_that_wait_for_a_channel(examined: Doctor, tree: Path) -> None:
    path = tree / "state" / "s.sqlite"
    with closing(Store.open(path)) as store, closing(outbox.Outbox(path)) as rows:
        store.post(alert("a"), ["hook"], time.time() - 7200)
        assert examined() == [], "not tried yet"
        rows.failed(1, "451 come back later", 0.0)
    assert one(
        examined(),
        Level.WARNING,
        "channels",
        "hook: 1 messages not delivered",
        "2.0 h",
        "451 come back later",
    )


def test_a_test_message_goes_through_each_channel_only_when_asked(
    examined: Doctor, monkeypatch: pytest.MonkeyPatch
) -> None:
    sent: list[str] = []
    monkeypatch.setattr(channels.Channel, "send", lambda self, alert: sent.append(self.name))
    assert examined() == []
    assert sent == []
    assert examined(send=True) == []
    assert sent == ["hook"]

    def refuse(*_: object) -> None:
        raise doctor_checks.DeliveryError("550 no")

    monkeypatch.setattr(channels.Channel, "send", refuse)
    assert one(examined(send=True), Level.ERROR, "channels", "550 no")


def test_the_server_of_a_mail_channel_is_asked_without_sending(
    examined: Doctor, monkeypatch: pytest.MonkeyPatch
) -> None:
    sent: list[str] = []
    monkeypatch.setattr(channels.Channel, "send", lambda self, alert: sent.append(self.name))
    text = TEXT.replace("json://127.0.0.1:1/x", "'mailto://127.0.0.1:9?from=a@b.org&to=c@d.org'")
    assert one(examined(text), Level.ERROR, "channels", "hook cannot be used: mail server 127.0.0.1:9")
    assert sent == []


@pytest.mark.parametrize(
    ("settings", "level", "parts"),
    [
        ("{url: 'ftp://h.org/x'}", Level.ERROR, ("line 10", "http")),
        ("{url: 'https://h.org/${NOT_SET_ANYWHERE}'}", Level.ERROR, ("NOT_SET_ANYWHERE is not set",)),
        ("{url: 'https://h.org/${credential:x}'}", Level.WARNING, ("credential x",)),
        ("{file: none/sign}", Level.ERROR, ("none/sign cannot be written",)),
    ],
)
def test_a_heartbeat_that_cannot_be_given(
    examined: Doctor, monkeypatch: pytest.MonkeyPatch, settings: str, level: Level, parts: tuple[str, ...]
) -> None:
    monkeypatch.delenv("CREDENTIALS_DIRECTORY", raising=False)
    assert one(examined(TEXT + f"heartbeat: {settings}\n"), level, "heartbeat", *parts)


def test_a_heartbeat_that_can_be_given(examined: Doctor) -> None:
    found = examined(TEXT + "heartbeat: {file: state/sign, minutes: 2}\n", all_=True)
    assert [(f.level, f.text) for f in found if f.topic == "heartbeat"] == [
        (Level.OK, "every 2 min while all is well")
    ]


def test_a_service_that_does_not_run_or_is_stuck(examined: Doctor, tree: Path) -> None:
    assert one(examined(runs=False), Level.WARNING, "service", "does not run")
    path = tree / "state" / "s.sqlite"
    life = PidLock(path)
    os.utime(alive_path(path), (0, time.time() - 500))
    assert one(examined(runs=False), Level.ERROR, "service", "no sign of life for 8 min")
    life.end()


def test_what_nobody_foresaw_hides_nothing_of_the_rest(
    examined: Doctor, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(doctor, "user", lambda config: 1 / 0)
    found = examined(runs=False)
    assert [(f.level, f.topic) for f in found] == [(Level.ERROR, "user"), (Level.WARNING, "service")]
    assert "ZeroDivisionError" in found[0].text


# --------------------------------------------------------------------------- check looks where the scan looks


def texts(tree: Path, text: str = TEXT) -> list[str]:
    path = tree / "c.yml"
    path.write_text(text, encoding="utf-8")
    return [p.text for p in check(load(path), path)]


@pytest.mark.parametrize("above", ["", "coastal/gliders", "a/b/c/d/e"])
def test_check_finds_gliders_as_deep_as_the_scan_does(tree: Path, above: str) -> None:
    (tree / "gliders" / above).mkdir(parents=True, exist_ok=True)
    if above:
        (tree / "gliders" / "electa").rename(tree / "gliders" / above / "electa")
    assert len(list(scan(find_places([tree / "gliders"], {}), []))) == 1
    assert texts(tree) == []


def test_check_finds_none_deeper_than_the_scan_does(tree: Path) -> None:
    (tree / "gliders" / "a/b/c/d/e/f").mkdir(parents=True)
    (tree / "gliders" / "electa").rename(tree / "gliders" / "a/b/c/d/e/f" / "electa")
    assert list(scan(find_places([tree / "gliders"], {}), [])) == []
    assert texts(tree) == ["gliders.electa: no folder electa/from-glider below the roots"]


@pytest.mark.parametrize("name", ["archive", "Archive", "unknown", "lost+found"])
def test_an_archive_is_no_glider(tree: Path, name: str) -> None:
    (tree / "gliders" / name / "from-glider").mkdir(parents=True)
    assert texts(tree) == []


def test_a_link_is_not_followed_by_check_either(tree: Path) -> None:
    (tree / "gliders" / "electa").rename(tree / "elsewhere")
    (tree / "gliders" / "electa").symlink_to(tree / "elsewhere")
    link = tree / "gliders" / "electa"
    assert texts(tree) == [
        f"gliders.electa: {link} is a symbolic link, and links are not followed: its files are not seen"
    ]
