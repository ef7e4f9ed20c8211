"""What `run` refuses, `check` and `doctor` call an error in the same words, and the other way round."""

from __future__ import annotations

import gzip
import json
import os
import re
import sqlite3
import subprocess
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from acceptance.support import TRACEBACK, Daemon, Site, command, until
from gliderwatch.config import load
from gliderwatch.service import preconditions
from gliderwatch.store.state_file import Store

GOLDEN = Path(__file__).resolve().parents[1] / "golden" / "schema-1.sqlite.gz"
Break = Callable[[Site, dict[str, Any]], None]


def state(make: Callable[[Path], object]) -> Break:
    """Something else where the state file is to be."""

    def broken(site: Site, _: dict[str, Any]) -> None:
        site.state.parent.mkdir()
        make(site.state)

    return broken


def execute(*statements: str) -> Break:
    def make(path: Path) -> None:
        with closing(sqlite3.connect(path)) as db:
            for statement in statements:
                db.execute(statement)
            db.commit()

    return state(make)


def newer(path: Path) -> None:
    Store.open(path).close()
    with closing(sqlite3.connect(path)) as db:
        db.execute("PRAGMA user_version = 99")


def polluted(path: Path) -> None:
    path.write_bytes(gzip.decompress(GOLDEN.read_bytes()))
    with closing(sqlite3.connect(path)) as db:
        db.execute("CREATE TABLE contacts (name)")


def settings(section: str, **values: object) -> Break:
    return lambda _, document: document.setdefault(section, {}).update(values)


def below_a_root(site: Site, document: dict[str, Any]) -> None:
    document["state"]["path"] = str(site.root / "state.sqlite")


def in_a_file(site: Site, _: dict[str, Any]) -> None:
    site.state.parent.write_text("not a folder", encoding="utf-8")


def read_only(site: Site, _: dict[str, Any]) -> None:
    """As on a disk that is mounted so; who may not mount may not write in a closed folder either."""
    site.state.parent.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "ro", "gliderwatch-test", str(site.state.parent)]
    if os.getuid() != 0:
        site.state.parent.chmod(0o555)
    elif subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("root writes everywhere, and may not mount here")


def pages_below_a_root(site: Site, document: dict[str, Any]) -> None:
    document["pages"] = {"folder": str(site.root / "pages")}


REFUSED: dict[str, tuple[Break, str, str]] = {
    "pages below a root": (pages_below_a_root, "pages.folder", "lies below the root"),
    "a state of a newer gliderwatch": (state(newer), "state.path", "has schema 99"),
    "another program's database": (execute("CREATE TABLE contacts (name)"), "state.path", "contacts"),
    "a database with another's number": (
        execute("PRAGMA application_id = 7"),
        "state.path",
        "another program",
    ),
    "another's database with our tables in it": (state(polluted), "state.path", "contacts"),
    "a text file": (state(lambda p: p.write_text("dear diary\n" * 99)), "state.path", "a text file"),
    "bytes": (state(lambda p: p.write_bytes(bytes(range(256)) * 99)), "state.path", "not a database"),
    "a folder": (state(lambda p: p.mkdir()), "state.path", "is a folder"),
    "a folder for the sign of life": (
        state(lambda p: (p.parent / f"{p.name}.alive").mkdir()),
        "state.path",
        "alive",
    ),
    "a file for the folder": (in_a_file, "state.path", "not a folder"),
    "a disk that is read-only": (read_only, "state.path", "cannot be written"),
    "a state below a root": (below_a_root, "state.path", "lies below the root"),
    "no web address": (settings("heartbeat", url="file:///etc/passwd"), "heartbeat.url", "http or https"),
    "no address at all": (settings("heartbeat", url="http://[::1"), "heartbeat.url", "no URL"),
    "a secret of the heartbeat": (
        settings("heartbeat", url="https://a/${NOT_SET}"),
        "heartbeat.url",
        "NOT_SET",
    ),
    "a secret of a channel": (
        settings("channels", mail={"url": "mailto://a:${NOT_SET}@localhost?to=b@c.d"}),
        "channels.mail.url",
        "NOT_SET",
    ),
    "no broker": (settings("relays", broker="http://broker", name="a"), "relays.broker", "mqtt"),
    "a credential": (
        settings("channels", mail={"url": "mailto://a:${credential:pw}@localhost?to=b@c.d"}),
        "channels.mail.url",
        "credential pw",
    ),
}


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Site]:
    made = Site(tmp_path)
    made.folder("angus")
    yield made
    if os.path.ismount(made.state.parent):
        subprocess.run(["umount", "--lazy", made.state.parent], check=True)


def broken(site: Site, case: str) -> None:
    site.configure("angus")
    document = json.loads(site.config.read_text(encoding="utf-8"))
    REFUSED[case][0](site, document)
    site.config.write_text(json.dumps(document, indent=1), encoding="utf-8")


def left(site: Site) -> list[tuple[str, bytes]]:
    """All that is there, but for what SQLite makes to read."""
    files = (
        p for p in site.config.parent.rglob("*") if p.is_file() and not p.name.endswith(("-shm", "-wal"))
    )
    return sorted((str(p), p.read_bytes()) for p in files)


@pytest.mark.parametrize("case", REFUSED)
def test_run_check_and_doctor_refuse_the_same(site: Site, case: str) -> None:
    broken(site, case)
    _, key, words = REFUSED[case]
    before = left(site)
    ran, checked, doctored = (command(name, "-c", site.config) for name in ("run", "check", "doctor"))
    assert left(site) == before, "nothing is made, renamed or written"
    assert (ran.returncode, ran.stdout) == (2, "")
    (told,) = ran.stderr.strip().splitlines()
    line = re.fullmatch(rf"{re.escape(str(site.config))}:(\d+): {re.escape(key)}: (.*)", told)
    assert line is not None and words in line[2], told
    assert (
        f'"{key.rpartition(".")[2]}"'
        in site.config.read_text(encoding="utf-8").splitlines()[int(line[1]) - 1]
    )
    is_here_only = case == "a credential"
    severity = "warning" if is_here_only else "error"
    assert checked.returncode == (0 if is_here_only else 1), checked.stdout
    said = [text for text in checked.stdout.splitlines() if words in text]
    assert len(said) == 1 and said[0].startswith(f"{site.config}:{line[1]}: {severity}: {key}: "), (
        checked.stdout
    )
    assert doctored.returncode == (1 if is_here_only else 2)
    text = " ".join(doctored.stdout.split())
    assert "could not be looked at" not in text
    assert f"{severity.upper()} " in text and words in text and f"line {line[1]}: {key}" in text
    assert TRACEBACK not in ran.stderr + checked.stderr + doctored.stderr


def test_every_precondition_has_a_case(site: Site) -> None:
    """A list with a part that nothing breaks would not be tested."""
    idle = set(preconditions.PRECONDITIONS)
    for number, case in enumerate(REFUSED):
        other = Site(site.root.parent / str(number))
        other.folder("angus")
        if case == "a disk that is read-only":  # a disk of its own: it has its own test
            continue
        broken(other, case)
        config = load(other.config)
        idle -= {part for part in idle if list(part(config))}
    assert idle == set()


@pytest.mark.parametrize("name", ["status", "incidents", "backup", "mute", "rebuild", "ack", "unmute"])
@pytest.mark.parametrize("case", ["another program's database", "a text file"])
def test_every_other_command_refuses_anothers_file(site: Site, name: str, case: str) -> None:
    broken(site, case)
    before = left(site)
    arguments = {
        "backup": [site.root.parent / "copy"],
        "mute": ["angus", "--hours", "1"],
        "rebuild": ["angus"],
        "ack": ["angus/anomaly/1"],
        "unmute": ["angus"],
    }
    result = command(name, "-c", site.config, *arguments.get(name, []))
    assert (result.returncode, result.stdout) == (2, "")
    assert "is not gliderwatch's" in result.stderr and TRACEBACK not in result.stderr
    assert left(site) == before


def test_a_replay_leaves_anothers_file_alone(site: Site, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    other = tmp_path / "out" / "replay.sqlite"
    other.write_text("dear diary\n" * 99, encoding="utf-8")
    site.put("angus", "a.sbd", b"junk")
    result = command("run", "--replay", site.root, "--out", tmp_path / "out")
    assert result.returncode == 2 and "choose another folder for --out" in result.stderr.lower()
    assert other.read_text(encoding="utf-8").startswith("dear diary")


def test_a_service_that_runs_is_no_error(site: Site) -> None:
    """That another gliderwatch uses the state file is of the moment: `run` refuses, the others look on."""
    site.configure("angus")
    with Daemon(site):
        until(lambda: site.status()["alive"], "alive")
        assert command("check", "-c", site.config).returncode == 0
        second = command("run", "-c", site.config)
    assert second.returncode == 2 and "another gliderwatch uses the state file" in second.stderr


def test_a_reload_refuses_what_a_start_refuses(site: Site) -> None:
    site.configure("angus")
    with Daemon(site) as daemon:
        document = json.loads(site.config.read_text(encoding="utf-8"))
        document["heartbeat"] = {"url": "file:///etc/passwd"}
        site.config.write_text(json.dumps(document), encoding="utf-8")
        daemon.reload()
        until(lambda: daemon.log("configuration refused.*"), "refused")
        (told,) = daemon.log("configuration refused.*")
        assert str(site.config) in told["reason"] and "heartbeat.url" in told["reason"]
        assert daemon.alive()


def test_a_state_of_an_earlier_release_is_told_by_status(site: Site) -> None:
    """It is migrated at the next start: until then commands that look into it say so."""
    site.configure("angus")
    site.state.parent.mkdir()
    site.state.write_bytes(gzip.decompress(GOLDEN.read_bytes()))
    result = command("status", "-c", site.config)
    assert result.returncode == 2 and "takes on a file of an earlier release" in result.stderr
    assert TRACEBACK not in result.stderr


def test_check_for_machines(site: Site) -> None:
    broken(site, "no web address")
    result = command("check", "-c", site.config, "--json")
    told = json.loads(result.stdout)
    assert (result.returncode, told["result"], told["gliders"]) == (1, "errors", ["angus"])
    error = next(p for p in told["problems"] if p["severity"] == "error")
    assert error["file"] == str(site.config) and error["text"].startswith("heartbeat.url: ") and error["cure"]
    assert "file:///etc/passwd" in site.config.read_text(encoding="utf-8").splitlines()[error["line"] - 1]

    site.config.write_text("dockserver:\n  roots: [/tmp]\n  settle_secnds: 3\n", encoding="utf-8")
    result = command("check", "-c", site.config, "--json")
    told = json.loads(result.stdout)
    assert (result.returncode, told["result"], told["problems"][0]["line"]) == (2, "errors", 3)
