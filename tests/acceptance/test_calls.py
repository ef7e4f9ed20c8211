"""The log of a call as it grows on a dockserver: the pilot has the mail while the glider is on the line."""

from __future__ import annotations

import time
from datetime import UTC, datetime
from pathlib import Path
from statistics import median

import pytest

from acceptance.support import Daemon, Site, mail_server, until
from gliderwatch.store.state_file import Status


def begin(site: Site, glider: str) -> Path:
    """A call that has just begun; nothing of it is an alarm."""
    now = datetime.now(UTC)
    folder = site.folder(glider).with_name("logs")
    folder.mkdir(exist_ok=True)
    path = folder / f"{glider}_{now:%Y%m%dT%H%M%S}_network_net_0.log"
    path.write_bytes(
        b"Connection Event: Carrier Detect found.263958    Iridium console active and ready...\r\n"
        + f"MissionName:ew33.mi MissionNum:{glider}-2025-022-0-33 (0103.0033)\r\n".encode()
        + f"Vehicle Name: {glider}\r\nCurr Time: {now:%a %b %d %H:%M:%S %Y} MT:  263958\r\n".encode()
        + b"ABORT HISTORY: total since reset: 0\r\n"
    )
    return path


@pytest.mark.parametrize(
    "observer",
    [pytest.param("inotify", marks=pytest.mark.timing), pytest.param("polling", marks=pytest.mark.slow)],
)
def test_abort_is_mailed_while_the_call_is_on(tmp_path: Path, observer: str) -> None:
    gliders = [f"g{k}" for k in range(5)]
    site, begun = Site(tmp_path), {}
    with mail_server() as box:
        site.configure(*gliders, url=box.url, observer=observer)
        for glider in gliders:
            site.folder(glider).with_name("logs").mkdir()
        with Daemon(site):
            logs = [begin(site, glider) for glider in gliders]
            wanted = [Status.TAKEN] * len(logs)
            until(lambda: site.statuses(*(log.name for log in logs)) == wanted, "logs read")
            for n, (glider, log) in enumerate(zip(gliders, logs, strict=True), 1):
                with log.open("ab") as file:
                    file.write(b"62.87 28 behavior ?_-1: abort_the_mission(1): (24)MS_ABORT_LEAK\r\n")
                begun[f"{glider} ABORTED: leak"] = time.monotonic()
                if observer == "inotify":  # else they all wait for the same look at the files
                    until(lambda n=n: len(box.mails) == n, "mail")
            until(lambda: len(box.mails) == len(gliders), "mails")
    waits = sorted(mail.accepted - begun.pop(mail.subject) for mail in box.mails)
    print("seconds from the line in the log to the mail:", [round(wait, 3) for wait in waits])
    assert median(waits) < (1.0 if observer == "inotify" else 12.0)


def test_logs_are_left_alone_where_they_are_not_wanted(tmp_path: Path) -> None:
    site = Site(tmp_path)
    site.configure("electa", logs=False, rescan_seconds=1)
    path = begin(site, "electa")
    with Daemon(site):
        bad = site.put("electa", "electa-2022-308-3-2.sbd", b"no flight data")
        until(lambda: site.statuses(bad.name) == [Status.QUARANTINED], "file seen")
        assert site.statuses(path.name) == [None]
