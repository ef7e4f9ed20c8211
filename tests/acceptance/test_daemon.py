"""The daemon as installed: signals, the service manager, and the messages that people get."""

from __future__ import annotations

import os
import re
import signal
import socket
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from acceptance.angus import FILES, plenty, put, taken
from acceptance.chaos import hooked
from acceptance.support import (
    GLIDERWATCH,
    TRACEBACK,
    Daemon,
    Site,
    command,
    lines,
    mail_server,
    notify_socket,
    remora,
    results,
    until,
)
from gliderwatch.simulate.delivery import arrivals
from gliderwatch.simulate.scenario import Mission
from gliderwatch.store.state_file import Status

# --------------------------------------------------------------------------- signals


@pytest.mark.parametrize(
    "program",
    [pytest.param((GLIDERWATCH,), id="installed", marks=pytest.mark.slow), pytest.param((), id="forked")],
)
def test_sigterm_ends_it_cleanly(site: Site, program: Sequence[object]) -> None:
    with Daemon(site, program) as daemon:
        put(site, *FILES)
        taken(site, *FILES)
        workers = children(daemon.pid)
        assert workers
        assert daemon.stop() == 0
        until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in workers), "no process is left")
        assert daemon.log("stopped")
        assert list(daemon.scratch.iterdir()) == []
    assert TRACEBACK not in daemon.text()


def test_no_process_is_left_after_sigkill(site: Site) -> None:
    plenty(site, 10)
    with Daemon(site) as daemon:
        until(lambda: len(site.files()) > 3, "at work")
        workers = children(daemon.pid)
        assert workers
        daemon.kill()
        until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in workers), "no process is left")


def children(pid: int) -> list[int]:
    """The processes started by a process."""
    tasks = Path(f"/proc/{pid}/task").iterdir()
    return [int(child) for task in tasks for child in (task / "children").read_text().split()]


@pytest.mark.timing
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_it_within_5_s_also_in_the_middle_of_a_backlog(
    site: Site, number: signal.Signals
) -> None:
    files = plenty(site)
    with Daemon(site) as daemon:
        until(lambda: len(site.files()) > 20, "at work")
        begun = time.monotonic()
        os.kill(daemon.pid, number)
        assert daemon.wait() == 0
        assert time.monotonic() - begun < 5.0
    assert len(site.files()) < files, "it did all of its work first: a test of nothing"
    assert TRACEBACK not in daemon.text()


@pytest.mark.timing
def test_sigterm_ends_it_within_5_s_on_a_share_that_is_slow_to_open_each_file(site: Site) -> None:
    slow = site.config.with_name("slow")
    slow.touch()
    files = plenty(site)
    with Daemon(site, **hooked(CHAOS_SLOW=slow)) as daemon:
        until(lambda: daemon.log("watching"), "it watches")
        time.sleep(1.0)  # it is opening the first of so many, or this test proves nothing: see its end
        begun = time.monotonic()
        os.kill(daemon.pid, signal.SIGTERM)
        assert daemon.wait() == 0
        assert time.monotonic() - begun < 5.0
    assert len(site.files()) < files


@pytest.mark.timing
def test_sigterm_ends_it_within_5_s_while_a_mail_server_hangs(site: Site) -> None:
    with socket.socket() as hanging:
        hanging.bind(("127.0.0.1", 0))
        hanging.listen()
        url = f"mailto://127.0.0.1:{hanging.getsockname()[1]}?from=a@b.org&to=c@d.org"
        site.configure("angus", url=url, surfacing=["angus"])
        with Daemon(site) as daemon:
            put(site, *FILES)
            hanging.settimeout(60)
            connection, _ = hanging.accept()
            begun = time.monotonic()
            assert daemon.stop() == 0
            assert time.monotonic() - begun < 5.0
            connection.close()
    assert site.undelivered() > 0


def test_sighup_takes_a_new_glider_into_account(site: Site, daemon: Daemon) -> None:
    mission = remora(0.5)
    site.caches(mission)
    files = list(arrivals(mission))
    put(site, *files, glider="bruce")
    put(site, *FILES)
    taken(site, *FILES)
    until(lambda: site.statuses(files[0].name) == [Status.UNKNOWN], "unknown")
    site.configure("angus", "bruce")
    daemon.reload()
    taken(site, *files)
    (entry,) = daemon.log("configuration read again")
    assert entry["gliders"] == ["angus", "bruce"]
    assert len(daemon.log("file taken")) == len(FILES) + len(files)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('"settle_seconds": 1', '"settle_seconds": "often"', "settle_seconds"),
        ('"dockserver"', '"dokserver"', "dockserver"),
        ("}", "", "gliderwatch.yml:"),
        ("state.sqlite", "another.sqlite", "restart"),
        ('"channels": {', '"channels": {"new": {"url": "${NOT_THERE}"}, ', "NOT_THERE"),
    ],
)
def test_sighup_with_a_bad_configuration_is_refused(site: Site, old: str, new: str, told: str) -> None:
    with mail_server() as box, Daemon(site) as daemon:
        config = site.configure("angus", url=box.url)
        text = config.read_text(encoding="utf-8")
        assert old in text
        config.write_text(text.replace(old, new), encoding="utf-8")
        daemon.reload()
        until(lambda: daemon.log("configuration refused.*"), "refused")
        assert told in daemon.log("configuration refused.*")[0]["reason"]
        put(site, *FILES)
        taken(site, *FILES)
        assert TRACEBACK not in daemon.text()


@pytest.mark.slow
def test_sighup_in_the_middle_of_a_backlog_loses_nothing(site: Site, tmp_path: Path) -> None:
    files = plenty(site)
    with Daemon(site) as daemon:
        for part in (1, 2, 3):
            until(lambda n=part: len(site.files()) >= n * files // 5, "at work")
            daemon.reload()
        until(lambda: len(site.files()) == files, "all taken")
        until(lambda: len(daemon.log("configuration read again")) == 3, "all heard")
        assert daemon.stop() == 0
    assert TRACEBACK not in daemon.text()
    command("run", "-c", site.config, "--replay", site.root, "--out", tmp_path / "out")
    assert results(site.state) == results(tmp_path / "out" / "replay.sqlite")


def test_sighup_changes_where_mail_goes(site: Site) -> None:
    with mail_server() as old, mail_server() as new:
        site.configure("angus", url=old.url, surfacing=["angus"])
        with Daemon(site) as daemon:
            put(site, *FILES[:3])
            until(lambda: len(old.mails) == 1, "a notice by the old way")
            site.configure("angus", url=new.url, surfacing=["angus"])
            daemon.reload()
            until(lambda: daemon.log("configuration read again"), "reloaded")
            put(site, *FILES[3:])
            until(lambda: new.mails, "a notice by the new way")
            assert len(old.mails) == 1


# --------------------------------------------------------------------------- alone, and seen to live


def test_a_second_daemon_on_one_state_is_refused(site: Site, daemon: Daemon) -> None:
    second = command("run", "-c", site.config)
    assert second.returncode == 2
    assert f"another gliderwatch uses the state file {site.state}" in second.stderr
    assert len(second.stderr.splitlines()) == 1
    put(site, FILES[0])
    taken(site, FILES[0])


def test_the_service_manager_is_told(site: Site, tmp_path: Path) -> None:
    with notify_socket(tmp_path) as (address, told):
        with Daemon(site, NOTIFY_SOCKET=address, WATCHDOG_USEC="1000000") as daemon:
            until(lambda: "READY=1" in told, "ready")
            put(site, *FILES)
            (site.folder("angus") / "bad.sbd").write_bytes(b"garbage")
            until(lambda: told.count("WATCHDOG=1") >= 3, "watchdog")
            until(lambda: any(re.search("^STATUS=.* 1 quarantined", line) for line in told), "status")
            assert "RELOADING=1" not in told
            daemon.reload()
            until(lambda: "RELOADING=1" in told, "reloading")
            until(lambda: told.count("READY=1") == 2, "ready again")
            assert any(re.fullmatch(r"MONOTONIC_USEC=\d+", line) for line in told)
            assert daemon.stop() == 0
        until(lambda: "STOPPING=1" in told, "stopping")
    assert told[0] == "READY=1"


@pytest.mark.slow
def test_the_watchdog_is_served_while_there_is_much_to_do(site: Site, tmp_path: Path) -> None:
    files = plenty(site)
    with (
        notify_socket(tmp_path) as (address, told),
        Daemon(site, NOTIFY_SOCKET=address, WATCHDOG_USEC="400000"),
    ):
        until(lambda: len(site.files()) == files, "all taken")
        assert told.count("WATCHDOG=1") >= 4


# --------------------------------------------------------------------------- what people get


def test_the_same_alert_as_in_a_replay(site: Site, tmp_path: Path) -> None:
    mission: Mission = remora(2.5)
    site.caches(mission)
    with mail_server() as box:
        site.configure("bruce", url=box.url)
        with Daemon(site):
            for file in arrivals(mission):
                put(site, file, glider="bruce")
                taken(site, file)
            command("run", "-c", site.config, "--replay", site.root, "--out", tmp_path / "out")
            alerts: list[dict[str, Any]] = lines(tmp_path / "out" / "alerts.jsonl")
            assert alerts[0]["kind"] == "anomaly"
            until(lambda: len(box.mails) >= len(alerts), "all mails")
            until(lambda: site.undelivered() == 0, "all marked")
    assert [mail.subject for mail in box.mails] == [alert["title"] for alert in alerts]
    assert max(box.times().values()) == 1


def test_mail_that_is_refused_is_sent_later(site: Site) -> None:
    with mail_server() as box:
        box.refusing = True
        site.configure("angus", url=box.url, surfacing=["angus"])
        with Daemon(site) as daemon:
            put(site, *FILES[:3])
            until(lambda: daemon.log("alert not delivered"), "refused")
            (waiting,) = site.status()["undelivered"]
            assert "451 come back later" in waiting["error"]
            assert "undelivered" in command("status", "-c", site.config).stdout
            box.refusing = False
            until(lambda: box.mails, "sent")
            until(lambda: site.undelivered() == 0, "marked")
    assert max(box.times().values()) == 1
