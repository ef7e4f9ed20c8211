"""The watch is watched: doctor, numbers, the dead man's switch and messages to the operator, as installed."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import sys
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from acceptance.angus import FILES, put, taken
from acceptance.support import TRACEBACK, Daemon, Site, command, mail_server, notify_socket, until
from gliderwatch.store.state_file import Status

TESTS = Path(__file__).resolve().parents[1]
NOWHERE = "/nonexistent"
"""A PATH without timedatectl: what this machine says of its clock is no part of the test."""
QUICK = """\
import functools, sys
from gliderwatch.service import daemon, heartbeat, runtime
from bad_decode import misbehave
from gliderwatch.cli.main import main
daemon.BEAT, heartbeat.DECODING = 0.2, 1.0
runtime.Decoder = functools.partial(runtime.Decoder, decode=misbehave)
sys.argv[0] = "gliderwatch"
main()
"""
"""The command with short patience, and a decoder that does what the name of a file says."""


@pytest.fixture
def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
    return port


def configure(site: Site, **sections: Any) -> None:
    """Lay sections over the configuration of a site."""
    document = json.loads(site.config.read_text(encoding="utf-8"))
    site.config.write_text(json.dumps(document | sections), encoding="utf-8")


def quick(site: Site, **env: str) -> Daemon:
    path = os.pathsep.join(filter(None, [str(TESTS), os.environ.get("PYTHONPATH")]))
    return Daemon(site, (sys.executable, "-c", QUICK), PYTHONPATH=path, **env)


def scraped(port: int) -> dict[str, float]:
    """The samples that a daemon serves."""
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=10) as answer:
        lines = answer.read().decode().splitlines()
    pairs = (line.rpartition(" ") for line in lines if not line.startswith("#"))
    return {name: float(value) for name, _, value in pairs}


def listening(pid: int) -> set[int]:
    """The TCP ports that a process listens on."""
    fds = Path(f"/proc/{pid}/fd").iterdir()
    own = {
        m[1] for fd in fds if fd.is_symlink() and (m := re.fullmatch(r"socket:\[(\d+)\]", str(fd.readlink())))
    }
    rows = [
        line.split()
        for name in ("tcp", "tcp6")
        for line in Path(f"/proc/{pid}/net/{name}").read_text(encoding="ascii").splitlines()[1:]
    ]
    return {int(row[1].rpartition(":")[2], 16) for row in rows if row[3] == "0A" and row[9] in own}


# --------------------------------------------------------------------------- numbers


def test_numbers_tell_what_happened(site: Site, free_port: int) -> None:
    with mail_server() as box:
        site.configure("angus", url=box.url, surfacing=["angus"])
        configure(site, metrics={"port": free_port})
        with Daemon(site, WATCHDOG_USEC="1000000") as daemon:  # a beat each half second
            put(site, *FILES)
            site.put("angus", "angus-2024-122-0-99.sbd", b"no flight data\n")
            taken(site, *FILES)
            until(lambda: site.statuses("angus-2024-122-0-99.sbd") == [Status.QUARANTINED], "quarantined")
            until(
                lambda: 'gliderwatch_delivery_seconds_count{channel="mail"}' in scraped(free_port),
                "a delivery",
            )
            told = scraped(free_port)
            assert listening(daemon.pid) == {free_port}
    assert told['gliderwatch_files_total{status="taken"}'] == len(FILES)
    assert told['gliderwatch_files_total{status="quarantined"}'] == 1
    assert (
        told["gliderwatch_decode_seconds_count"] == told["gliderwatch_assessment_seconds_count"] == len(FILES)
    )
    assert 0 < told["gliderwatch_decode_seconds_sum"] < 60
    assert sum(n for name, n in told.items() if name.startswith("gliderwatch_flags_total")) >= len(FILES) - 2
    assert told["gliderwatch_healthy"] == 1
    assert told['gliderwatch_open_incidents{glider="angus"}'] == 0
    assert told['gliderwatch_overdue{glider="angus"}'] == 0, "his mission is of 2024: it is over"
    assert told['gliderwatch_last_file_timestamp_seconds{glider="angus"}'] > 1.7e9
    assert told['gliderwatch_delivery_seconds_count{channel="mail"}'] == len(box.mails) > 0
    assert TRACEBACK not in daemon.text()


def test_nothing_listens_unless_configured_and_a_reload_changes_it(site: Site, free_port: int) -> None:
    with Daemon(site) as daemon:
        assert listening(daemon.pid) == set()
        configure(site, metrics={"port": free_port})
        daemon.reload()
        until(lambda: listening(daemon.pid) == {free_port}, "it listens")
        configure(site, metrics={})
        daemon.reload()
        until(lambda: listening(daemon.pid) == set(), "it listens no more")
        configure(site, metrics={"port": free_port, "address": "0.0.0.0"})
        daemon.reload()
        until(lambda: daemon.log("configuration refused.*"), "refused")
        assert listening(daemon.pid) == set()
    assert TRACEBACK not in daemon.text()


# --------------------------------------------------------------------------- the dead man's switch


def workers(pid: int) -> Iterator[int]:
    """The processes that a daemon has started and that decode."""
    for task in Path(f"/proc/{pid}/task").iterdir():
        for child in map(int, (task / "children").read_text(encoding="ascii").split()):
            if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes():
                yield child


@pytest.mark.slow
def test_signs_of_life_stop_while_the_decoder_is_stuck(site: Site, tmp_path: Path) -> None:
    sign = tmp_path / "sign"
    configure(site, heartbeat={"file": str(sign), "minutes": 0.001})
    with notify_socket(tmp_path) as (address, told), quick(site, NOTIFY_SOCKET=address) as daemon:
        until(sign.exists, "a sign")
        first = sign.stat().st_mtime_ns
        until(lambda: sign.stat().st_mtime_ns > first, "another one")
        put(site, *FILES)
        taken(site, *FILES)
        before = len(daemon.log("decoder is stuck.*"))  # a busy machine may have been slow to start
        site.put("angus", "hang.sbd", FILES[0].data.replace(b"angus-2024-121-0-0", b"angus-2024-121-9-9"))
        until(lambda: len(daemon.log("decoder is stuck.*")) > before, "stuck")
        last, fed, beats = (
            sign.stat().st_mtime_ns,
            told.count("WATCHDOG=1"),
            len(daemon.log("decoder is stuck.*")),
        )
        until(lambda: len(daemon.log("decoder is stuck.*")) >= beats + 5, "five beats later")
        assert sign.stat().st_mtime_ns == last
        assert told.count("WATCHDOG=1") == fed
        for worker in workers(daemon.pid):
            os.kill(worker, signal.SIGKILL)
        until(lambda: sign.stat().st_mtime_ns > last, "all is well again")
        until(lambda: told.count("WATCHDOG=1") > fed, "the watchdog is fed again")
    assert TRACEBACK not in daemon.text()


def test_a_url_that_fails_is_told_without_its_secrets_and_ends_nothing(site: Site, free_port: int) -> None:
    url = f"http://127.0.0.1:{free_port}/ping/${{PING_SECRET}}"
    configure(site, heartbeat={"url": url, "minutes": 0.001})
    with Daemon(site, PING_SECRET="s3cr3t-of-the-switch") as daemon:
        until(lambda: daemon.log("heartbeat not given"), "told")
        put(site, *FILES)
        taken(site, *FILES)
    assert "refused" in daemon.log("heartbeat not given")[0]["reason"]
    assert "s3cr3t" not in daemon.text()


def test_a_heartbeat_without_its_secret_is_told_at_the_start(site: Site) -> None:
    configure(site, heartbeat={"url": "https://h.org/${NOT_THERE_AT_ALL}"})
    done = command("run", "-c", site.config)
    assert done.returncode == 2
    assert "heartbeat.url" in done.stderr
    assert "NOT_THERE_AT_ALL is not set" in done.stderr
    assert TRACEBACK not in done.stderr


# --------------------------------------------------------------------------- the operator


def test_the_others_tell_that_a_channel_fails_and_that_it_works_again(site: Site) -> None:
    with mail_server() as good, mail_server() as bad:
        bad.refusing = True
        site.configure("angus", surfacing=["angus"])
        configure(
            site,
            channels={"good": {"url": good.url}, "bad": {"url": bad.url}},
            recipients={
                "pilot": {"channels": ["bad"], "surfacing": ["angus"]},
                "technician": {"channels": ["good"], "operator": True},
            },
            operator={"channel_hours": 0.0001, "free_mb": None},
        )
        with quick(site) as daemon:
            put(site, *FILES)
            until(lambda: len(good.mails) == 1, "the operator is told")
            assert "channel bad has not delivered for" in good.mails[0].subject
            assert "451 come back later" in good.mails[0].text
            bad.refusing = False
            until(lambda: len(good.mails) == 2, "the operator is told that it is over")
            assert "channel bad does not fail any more" in good.mails[1].subject
            assert daemon.stop() == 0
        with quick(site) as daemon:
            until(lambda: len(daemon.log("watching")) == 2, "a second life")
            site.put("angus", "angus-2024-122-0-99.sbd", b"no flight data\n")
            until(lambda: site.statuses("angus-2024-122-0-99.sbd") == [Status.QUARANTINED], "it works")
        assert [m.subject for m in good.mails[2:]] == []
        assert [m.subject for m in bad.mails if "GLIDERWATCH" in m.subject] == []
    assert TRACEBACK not in daemon.text()


def test_the_operator_is_told_of_files_that_stay_away_and_that_they_come_again(site: Site) -> None:
    with mail_server() as box:
        site.configure("angus", url=box.url)
        configure(site, operator={"silent_hours": 0.001, "free_mb": None})
        with quick(site):
            until(lambda: len(box.mails) == 1, "told")
            assert "no file of any glider" in box.mails[0].subject
            put(site, *FILES)
            until(lambda: any("files of the gliders come" in mail.subject for mail in box.mails), "over")


# --------------------------------------------------------------------------- doctor


def test_doctor_is_content_with_a_good_set_up(site: Site) -> None:
    put(site, *FILES)
    with mail_server() as box:
        site.configure("angus", url=box.url)
        with Daemon(site):
            taken(site, *FILES)
            done = command("doctor", "-c", site.config, "--send", PATH=NOWHERE)
        assert len(box.mails) == 1
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
    assert done.stdout.splitlines()[-1] == "0 errors, 0 warnings"
    assert max(map(len, done.stdout.splitlines())) <= 80


def test_doctor_names_what_is_wrong_with_the_cure(site: Site) -> None:
    put(site, *FILES)
    for cache in site.cache.iterdir():
        cache.unlink()
    site.configure("angus", "bruce", url="mailto://127.0.0.1:1?from=a@b.org&to=c@d.org")
    done = command("doctor", "-c", site.config, "--send", PATH=NOWHERE)
    assert (done.returncode, done.stderr) == (2, "")
    flat = " ".join(done.stdout.split())
    for part in (
        "gliders.bruce: no folder bruce/from-glider below the roots -> wait for",
        f".cac is missing for {len(FILES)} files",
        "mail cannot be used: mail server 127.0.0.1:1:",
        "service: does not run -> systemctl start gliderwatch",
    ):
        assert part in flat
    assert max(map(len, done.stdout.splitlines())) <= 80
    told = json.loads(command("doctor", "-c", site.config, "--json", PATH=NOWHERE).stdout)
    assert told["result"] == "errors"
    assert {f["topic"] for f in told["findings"] if f["level"] == "error"} == {"caches", "channels"}
    assert all(f["cure"] for f in told["findings"] if f["level"] in {"warning", "error"})


@pytest.mark.parametrize("content", [b"", b"\xff\x00", b"dockserver: [", b"dockserver: {roots: [/none]}"])
def test_doctor_shows_no_traceback_whatever_the_configuration(site: Site, content: bytes) -> None:
    site.config.write_bytes(content)
    done = command("doctor", "-c", site.config)
    assert done.returncode == 2
    assert TRACEBACK not in done.stdout + done.stderr
    assert "ERROR" in done.stdout
