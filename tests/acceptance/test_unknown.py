"""The service is blind: files come that wait for a cache, and the pilots hear why, and that it is over."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from acceptance.support import TRACEBACK, Daemon, Site, command, lines, mail_server, until
from gliderwatch.simulate.delivery import arrivals, cache, write_cache
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Mission, Scenario
from gliderwatch.slocum.caches import checksum
from gliderwatch.slocum.header import parse_header
from gliderwatch.store.state_file import Status

pytestmark = pytest.mark.slow  # integration/test_unknown has the same without a service

DAY = 86400.0
GLIDER = "cora"
HEALTHY = 42
"""Files before somebody changed the sbd list."""


def changed(made: Mission) -> tuple[str, bytes]:
    """The sensor list after the change, and its checksum: another unit of a sensor that is not sent."""
    text = cache(made)[f"{parse_header(next(iter(arrivals(made))).data).crc}.cac"]
    unsent = next(line for line in text.splitlines(keepends=True) if line.split()[3] == b"-1")
    other = text.replace(unsent, unsent.rstrip() + b"2\n")
    return checksum(other), other


def other_list(data: bytes, number: int, crc: str) -> bytes:
    """A file as it came; after the change its header names another cache file."""
    at = data.lower().index(parse_header(data).crc.encode())
    return data if number < HEALTHY else data[:at] + crc.encode() + data[at + 8 :]


def mission(end: float) -> Mission:
    """Seventeen healthy days until a time (s): some forty dives, and ten days more."""
    return simulate(Scenario(seed=5, glider=GLIDER, days=17.0, start=end - 17.0 * DAY))


def test_pilots_hear_that_nothing_can_be_judged_and_that_it_can_again(tmp_path: Path) -> None:
    site, made = Site(tmp_path), mission(time.time())
    crc, text = changed(made)
    site.caches(made)
    with mail_server() as box:
        site.configure(GLIDER, url=box.url, defaults={})
        for number, file in enumerate(arrivals(made)):
            site.put(GLIDER, file.name, other_list(file.data, number, crc))
        with Daemon(site) as daemon:
            until(lambda: box.mails, "the pilot is told")
            assert [f.status for f in site.files().values()].count(Status.WAITING) > 60
            (mail,) = box.mails
            assert "cora CANNOT BE JUDGED for " in mail.subject
            assert f"cache file {crc}.cac is missing: not in {site.cache}" in mail.text
            assert f"opy {crc}.cac from the dockserver" in " ".join(mail.text.split())
            (site.cache / f"{crc}.cac").write_bytes(text)
            until(lambda: len(box.mails) == 2, "the pilot is told that it is over")
            until(lambda: Status.WAITING not in {f.status for f in site.files().values()}, "all is taken")
    assert "cora ALL CLEAR: its dives can be judged again" in box.mails[1].subject
    assert len(box.mails) == 2 and TRACEBACK not in daemon.text()


def test_the_replay_command_says_the_same(tmp_path: Path) -> None:
    """Of a mission of years ago, at the time of its data."""
    made = mission(Scenario().start)
    write_cache(tmp_path / "cache", made)
    for number, file in enumerate(arrivals(made)):
        path = tmp_path / "gliders" / file.name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(other_list(file.data, number, "deadbeef"))
    result = command("run", "--replay", tmp_path / "gliders", "--out", tmp_path / "out")
    assert result.returncode == 0, result.stderr
    told = lines(tmp_path / "out" / "alerts.jsonl")
    assert [a["kind"] for a in told] == ["unknown", *["reminder"] * (len(told) - 1)]
    assert {a["severity"] for a in told} == {"warning"} and 4 <= len(told) <= 5
    assert "missing: not in" in told[0]["body"] and str(tmp_path / "cache") in told[0]["body"]
