"""The disk is full, or the state cannot be written: it is said, tried again, and nothing is lost."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from acceptance.angus import FILES, MISSION, put, taken
from acceptance.chaos import hooked
from acceptance.disk import Disk
from acceptance.support import (
    GLIDERWATCH,
    TRACEBACK,
    Daemon,
    Mailbox,
    Site,
    command,
    mail_server,
    notify_socket,
    results,
    until,
)
from gliderwatch.service.liveness import seconds_silent
from gliderwatch.service.state_outage import PAUSE
from gliderwatch.store.state_file import Store

EARLY, LATE = FILES[:3], FILES[3:]


@contextmanager
def disk(site: Site, *, limited: bool) -> Iterator[Disk]:
    made = Disk(site.state.parent)
    if limited and made.is_real:
        made.end()
        made.is_real = False
    try:
        yield made
    finally:
        made.end()


def told(daemon: Daemon) -> str:
    return "".join(entry["reason"] for entry in daemon.log("state cannot be used, tried again"))


def check(site: Site, box: Mailbox, daemon: Daemon) -> None:
    """All is there as if nothing had been."""
    until(lambda: site.undelivered() == 0, "all delivered")
    with closing(Store.reading(site.state)) as store:
        assert sum(box.times().values()) == len(store.alerts())
    assert set(box.times().values()) == {1}
    assert daemon.stop() == 0
    assert TRACEBACK not in daemon.text()
    out = site.config.with_name("out")
    assert command("run", "-c", site.config, "--replay", site.root, "--out", out).returncode == 0
    assert results(site.state) == results(out / "replay.sqlite")


@pytest.mark.parametrize("limited", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_full_disk_is_said_and_when_there_is_room_all_is_taken(site: Site, limited: bool) -> None:
    with mail_server() as box, disk(site, limited=limited) as small:
        site.configure("angus", url=box.url, surfacing=["angus"])
        with Daemon(site) as daemon:
            put(site, *EARLY)
            taken(site, *EARLY)
            until(lambda: box.mails and site.undelivered() == 0, "first mail")
            small.fill(daemon)
            put(site, *LATE)
            until(lambda: told(daemon), "it says so")
            time.sleep(2 * PAUSE + 0.5)  # it tries more than once
            assert len(daemon.log("state cannot be used, tried again")) == 1
            assert not daemon.log("state can be used again")
            assert daemon.alive() and site.statuses(*(f.name for f in LATE)) == [None] * len(LATE)
            small.free(daemon)
            taken(site, *FILES)
            until(lambda: daemon.log("state can be used again"), "well again")
            check(site, box, daemon)
        cure = "full" if small.is_real else "dmesg"
        assert "What to do: " in told(daemon) and cure in told(daemon)


@pytest.mark.slow
def test_a_state_that_becomes_read_only_is_said_and_no_sign_of_life_given(site: Site) -> None:
    switch = site.config.with_name("switch")
    with mail_server() as box:
        site.configure("angus", url=box.url, surfacing=["angus"])
        with Daemon(site, WATCHDOG_USEC="2000000", **hooked(CHAOS_STATE=switch)) as daemon:  # a beat a second
            put(site, *EARLY)
            taken(site, *EARLY)
            until(lambda: box.mails and site.undelivered() == 0, "first mail")
            switch.write_text("readonly", encoding="utf-8")
            put(site, *LATE)
            until(lambda: told(daemon), "it says so")
            since = time.monotonic()
            until(lambda: time.monotonic() - since > 3.0, "longer than a beat")
            still = seconds_silent(site.state)
            assert still is not None and still > 2.9
            assert site.statuses(*(f.name for f in LATE)) == [None] * len(LATE)
            switch.write_text("", encoding="utf-8")
            taken(site, *FILES)
            check(site, box, daemon)
    assert "let the user of the service write there" in told(daemon)


def test_a_mail_that_was_taken_while_the_disk_is_full_is_not_sent_again(site: Site) -> None:
    """It is marked when there is room: the daemon remembers what it could not write down."""
    switch = site.config.with_name("switch")

    class Filling(Mailbox):
        async def handle_DATA(self, *arguments: object) -> str:  # noqa: N802 (aiosmtpd)
            switch.write_text("readonly", encoding="utf-8")
            return await Mailbox.handle_DATA(self, *arguments)

    with mail_server(Filling()) as box:
        site.configure("angus", url=box.url, surfacing=["angus"])
        with Daemon(site, **hooked(CHAOS_STATE=switch)) as daemon:
            put(site, *FILES[:1])
            until(lambda: daemon.log("outbox cannot be read or written"), "it says so")
            time.sleep(3.0)
            assert len(box.mails) == 1 and site.undelivered() == 1
            switch.write_text("", encoding="utf-8")
            until(lambda: site.undelivered() == 0, "marked")
            assert len(box.mails) == 1
            assert daemon.stop() == 0


def test_a_folder_that_never_could_be_written_ends_the_start_in_words(tmp_path: Path) -> None:
    """As root too: nobody makes folders in /proc. The service manager starts it again and again."""
    site = Site(tmp_path)
    site.caches(MISSION)
    site.state = Path("/proc/gliderwatch/state.sqlite")
    site.configure("angus")
    ended = command("run", "-c", site.config)
    assert ended.returncode == 2 and TRACEBACK not in ended.stderr
    assert "cannot be written" in ended.stderr and "state.path" in ended.stderr


def test_a_log_that_cannot_be_written_ends_nothing(site: Site) -> None:
    """Every line meets a full disk."""
    with_full_log = ["/bin/sh", "-c", 'exec "$@" 2> /dev/full', "sh", GLIDERWATCH]
    with notify_socket(site.config.parent) as (address, said):
        daemon = Daemon(site, with_full_log, NOTIFY_SOCKET=address).start()
        try:
            until(lambda: "READY=1" in said, "ready")
            put(site, *EARLY)
            taken(site, *EARLY)
            assert daemon.stop() in (0, 120)  # 120: Python could not flush standard error at its end
        finally:
            daemon.__exit__()
