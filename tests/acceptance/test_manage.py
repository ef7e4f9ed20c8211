"""Incidents, mutes, acknowledgements and copies by command, while the service runs."""

from __future__ import annotations

import json
import time
from functools import cache
from pathlib import Path

import pytest

from acceptance.support import TRACEBACK, Daemon, Mailbox, Site, command, mail_server, remora, results, until
from gliderwatch.simulate.delivery import Arrival, arrivals
from gliderwatch.simulate.scenario import Mission
from gliderwatch.store.state_file import Status, Store


@cache
def mission() -> Mission:
    """One on which a remora takes hold for good: the incident stays open."""
    return remora(3.0)


@cache
def files() -> tuple[Arrival, ...]:
    return tuple(arrivals(mission()))


@pytest.fixture
def site(tmp_path: Path) -> Site:
    site = Site(tmp_path)
    site.caches(mission())
    site.folder("bruce")
    site.configure("bruce")
    return site


def put(site: Site, *some: Arrival) -> None:
    """Let files arrive and wait until they are taken."""
    for file in some:
        site.put("bruce", file.name, file.data)
    taken(site, *some)


def taken(site: Site, *some: Arrival) -> None:
    """Wait until files are taken."""
    wanted = [Status.TAKEN] * len(some)
    until(lambda: site.statuses(*(f.name for f in some)) == wanted, "taken")


def subjects(box: Mailbox) -> list[str]:
    return [mail.subject.split()[1] for mail in box.mails]


def first_alarm(site: Site) -> int:
    """How many files it takes until the incident opens."""
    for n, file in enumerate(files(), 1):
        put(site, file)
        if [i for _, found in results(site.state).values() for i in found]:
            return n
    raise AssertionError("no incident")


def test_incidents_are_listed_and_taken_on(site: Site) -> None:
    with Daemon(site) as daemon:
        until(site.state.exists, "a state")
        empty = command("incidents", "-c", site.config)
        assert (empty.returncode, empty.stdout) == (0, "no open incidents\n")
        put(site, *files())
        shown = command("incidents", "-c", site.config)
        (told,) = json.loads(command("incidents", "-c", site.config, "--json").stdout)
        assert shown.stdout.startswith(told["id"] + "\n")
        assert (told["glider"], told["kind"], told["acknowledged"]) == ("bruce", "anomaly", None)
        assert f"  since {told['since'][:16].replace('T', ' ')} UTC, {told['dives']} dives" in shown.stdout
        assert f"{told['worst']['speed']:.2f} m/s" in shown.stdout

        unknown = command("ack", "bruce/anomaly/1", "-c", site.config)
        assert unknown.returncode == 2
        assert unknown.stderr.splitlines() == [
            "there is no incident bruce/anomaly/1; open are:",
            f"  {told['id']}",
        ]
        note = "on our way with \x1b[31mthe boat " + "and more " * 20
        done = command("ack", told["id"], "--by", "Ann", "--note", note, "-c", site.config)
        assert done.returncode == 0
        again = command("ack", told["id"], "--by", "Ann", "--note", note, "-c", site.config)
        assert again.stdout.splitlines()[0] == "was acknowledged already, nothing changed"
        assert again.stdout.splitlines()[1:] == done.stdout.splitlines()[1:]

        listed = command("incidents", "-c", site.config).stdout
        assert "acknowledged by Ann: on our way with" in listed
        assert "\x1b" not in listed
        assert max(map(len, (listed + shown.stdout).splitlines())) <= 80
        (in_status,) = site.status()["gliders"]["bruce"]["incidents"]
        assert in_status["acknowledged"]["by"] == "Ann"
        assert not in_status["acknowledged"]["worse"]
        assert "acknowledged by Ann" in command("status", "-c", site.config).stdout
        assert TRACEBACK not in daemon.text()


@pytest.mark.parametrize("taken_on", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_nobody_is_reminded_of_what_somebody_took_on(site: Site, taken_on: bool) -> None:
    with mail_server() as box:
        site.configure(
            "bruce",
            url=box.url,
            defaults={"normal_speed": {"min": 0.2, "max": 0.4}, "rules": {"reminder_hours": 6}},
        )
        with Daemon(site):
            n = first_alarm(site)
            if taken_on:
                (told,) = json.loads(command("incidents", "-c", site.config, "--json").stdout)
                assert command("ack", told["id"], "-c", site.config).returncode == 0
            put(site, *files()[n:])
            until(lambda: site.undelivered() == 0, "all told")
        worse = json.loads(command("incidents", "-c", site.config, "--json").stdout)[0]
    assert not taken_on or not worse["acknowledged"]["worse"], "a test of nothing"
    reminders = [s for s in subjects(box) if s == "STILL"]
    assert bool(reminders) is not taken_on, subjects(box)


def test_a_mute_is_heeded_by_the_running_service_and_ends_with_unmute(site: Site) -> None:
    with mail_server() as box:
        site.configure("bruce", url=box.url)
        with Daemon(site, WATCHDOG_USEC="1000000") as daemon:  # a beat each half second
            put(site, files()[0])
            muted = command("mute", "bruce", "--hours", "2", "-c", site.config)
            assert muted.returncode == 0, muted.stderr
            put(site, *files()[1:])
            assert "muted until" in command("status", "-c", site.config).stdout
            assert site.status()["gliders"]["bruce"]["muted_until"] is not None
            assert daemon.log("alert") == []
            assert json.loads(command("incidents", "-c", site.config, "--json").stdout)
            assert command("unmute", "bruce", "-c", site.config).returncode == 0
            until(lambda: box.mails, "the incident that is open is told, without another file")
            assert site.status()["gliders"]["bruce"]["muted_until"] is None


@pytest.mark.slow
def test_what_is_open_is_told_when_a_mute_ends_by_itself(site: Site) -> None:
    with mail_server() as box:
        site.configure("bruce", url=box.url)
        with Daemon(site, WATCHDOG_USEC="1000000"):
            put(site, files()[0])
            assert command("mute", "bruce", "--hours", "0.0015", "-c", site.config).returncode == 0
            put(site, *files()[1:])
            until(lambda: box.mails, "told")
    assert subjects(box)[0] == "SLOW"


@pytest.mark.slow
def test_a_mute_outlives_a_restart_and_a_replay_knows_nothing_of_it(site: Site, tmp_path: Path) -> None:
    with Daemon(site):
        until(site.state.exists, "a state")
        assert command("mute", "bruce", "--until", _day(), "-c", site.config).returncode == 0
    with Daemon(site) as daemon:
        put(site, *files())
        assert daemon.log("alert") == []
    done = command("run", "-c", site.config, "--replay", site.root, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert "anomaly" in (tmp_path / "out" / "alerts.jsonl").read_text(encoding="utf-8")


def _day() -> str:
    return time.strftime("%Y-%m-%d %H:%M", time.gmtime(time.time() + 86400))


def test_a_copy_is_made_while_the_service_writes_and_can_be_gone_on_from(site: Site) -> None:
    target = site.config.with_name("copy.sqlite")
    with Daemon(site) as daemon:
        put(site, files()[0])
        for file in files()[1:]:
            site.put("bruce", file.name, file.data)
        made = command("backup", target, "-c", site.config)
        assert made.returncode == 0, made.stderr
        assert "whole" in made.stdout
        taken(site, *files())
        whole = results(site.state)
        daemon.stop()
    assert command("backup", target, "-c", site.config).returncode == 2
    for side in ("-wal", "-shm"):
        site.state.with_name(site.state.name + side).unlink(missing_ok=True)
    target.rename(site.state)
    with Daemon(site):  # the scan at its start finds all that the copy does not know of
        until(lambda: results(site.state) == whole, "as it was")


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["incidents"], "has the daemon run"),
        (["mute", "bruce", "--hours", "2"], "has the daemon run"),
        (["mute", "bruce"], "--until DATE"),
        (["mute", "elsa", "--hours", "2"], "known are: bruce"),
        (["unmute", "elsa"], "known are: bruce"),
        (["ack", "bruce/anomaly/1"], "has the daemon run"),
        (["backup", "../copy"], "has the daemon run"),
        (["backup", "copy"], "where the dockserver's files are: nothing is written there"),
        (["backup", "../cache/copy"], "where the dockserver's files are: nothing is written there"),
        (["backup", "../link/copy"], "where the dockserver's files are: nothing is written there"),
        (["rebuild", "bruce"], "has the daemon run"),
        (["rebuild", "bruce", "--keep"], "has the daemon run"),
        (["rebuild", "elsa"], "known are: bruce"),
    ],
)
def test_what_cannot_be_done_is_told_and_ends_with_2(site: Site, arguments: list[str], told: str) -> None:
    (site.root.parent / "link").symlink_to(site.root)
    before = site.tree()
    result = command(*arguments, "-c", site.config, cwd=site.root)
    assert result.returncode == 2
    assert site.tree() == before
    assert told in result.stderr
    assert TRACEBACK not in result.stderr
    assert not site.state.parent.exists()
    assert not (site.root / "copy").exists()


# --------------------------------------------------------------------------- rebuild


def set_speed(site: Site, slowest: float, url: str | None = None) -> None:
    site.configure("bruce", url=url, defaults={"normal_speed": {"min": slowest, "max": 0.4}})


def alerts(site: Site) -> list[str]:
    store = Store.reading(site.state)
    try:
        return [alert.id for alert in store.alerts()]
    finally:
        store.close()


def test_made_anew_with_the_same_settings_it_is_the_same(site: Site) -> None:
    """Also where files are gone, and while the service runs."""
    with Daemon(site):
        put(site, *files())
        before = results(site.state)
        whole = command("rebuild", "bruce", "-c", site.config)
        for file in files()[1::3]:
            (site.folder("bruce") / file.name).unlink()
        gone = command("rebuild", "bruce", "-c", site.config)
        refused = command("rebuild", "bruce", "--keep", "-c", site.config)
    n, held, dives = len(files()), len(files()[1::3]), len(before["bruce"][0])
    assert (whole.returncode, gone.returncode) == (0, 0), whole.stdout + gone.stdout
    assert whole.stdout.splitlines()[0] == f"bruce: {dives} dives from {n} files, {dives} before"
    assert f"from {n - held} files and {held} segments held," in gone.stdout
    assert whole.stdout.splitlines()[1:] == ["no dive has another flag or speed, no incident is another"]
    assert refused.returncode == 2
    assert "systemctl stop gliderwatch" in refused.stderr
    assert results(site.state) == before


def test_what_would_change_is_shown_then_kept_and_nobody_is_told_old_things(
    site: Site, tmp_path: Path
) -> None:
    """The range of normal speeds is made narrower: the incident that is open began earlier."""
    with mail_server() as box:
        set_speed(site, 0.2, box.url)
        with Daemon(site) as daemon:
            put(site, *files()[:-1])
            until(lambda: site.undelivered() == 0, "all told")
            daemon.stop()
        before, told = results(site.state), alerts(site)
        set_speed(site, 0.25, box.url)
        shown = command("rebuild", "bruce", "-c", site.config)
        assert shown.returncode == 1, shown.stderr
        assert results(site.state) == before
        kept = command("rebuild", "bruce", "--keep", "-c", site.config)
        assert kept.returncode == 0, kept.stderr
        assert kept.stdout.splitlines()[:-1] == shown.stdout.splitlines()[:-1]
        assert "0 normal -> 1 anomaly" in shown.stdout
        after = results(site.state)
        assert after != before
        replayed = command("run", "-c", site.config, "--replay", site.root, "--out", tmp_path / "out")
        assert replayed.returncode == 0, replayed.stderr
        assert results(tmp_path / "out" / "replay.sqlite") == after
        assert command("rebuild", "bruce", "-c", site.config).returncode == 0
        with Daemon(site) as again:
            put(site, files()[-1])  # it goes on from what was kept
            until(lambda: site.undelivered() == 0, "all told")
            assert again.log("file taken")[-1]["path"].endswith(files()[-1].name)
        assert alerts(site) == told
        assert len(box.mails) == len(told)


def test_what_was_removed_as_too_old_is_not_brought_back(site: Site) -> None:
    """`state.keep_days` removed the first third; what is kept goes on from there, with all files there."""
    with Daemon(site) as daemon:
        put(site, *files())
        daemon.stop()
    store = Store.open(site.state)
    dives = store.assessments("bruce")
    store._db.execute("UPDATE heard SET at = opened_at")  # else they have only just come
    removed = sum(store.remove(dives[len(dives) // 3].t_dive))
    store.close()
    before = results(site.state)
    assert removed
    assert 0 < len(before["bruce"][0]) < len(dives)
    kept = command("rebuild", "bruce", "--keep", "-c", site.config)
    assert kept.returncode == 0, kept.stderr
    assert "no dive has another flag" in kept.stdout
    assert results(site.state) == before
    assert command("rebuild", "bruce", "-c", site.config).stdout.splitlines()[1:] == [
        "no dive has another flag or speed, no incident is another"
    ]
