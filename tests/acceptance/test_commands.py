"""The commands around the daemon: check, status, test-alert; what they say, and what they never say."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from acceptance.support import (
    PASSWORD,
    TRACEBACK,
    Daemon,
    Site,
    command,
    healthy,
    installed,
    mail_server,
    until,
)
from gliderwatch.simulate.delivery import arrivals


@pytest.fixture
def site(tmp_path: Path) -> Site:
    return Site(tmp_path)


def secretive(port: int) -> str:
    """The URL of a mail channel whose password is in the environment."""
    return f"mailto://watch:${{SECRET}}@127.0.0.1:{port}?from=gliderwatch@ship.local&to=pilot@ship.local"


# --------------------------------------------------------------------------- arguments


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["fly"], "No such command"),
        (["run"], "-c"),
        (["run", "--fast"], "No such option"),
        (["run", "-c", "nowhere.yml"], "nowhere.yml"),
        (["run", "--replay", "nowhere"], "nowhere"),
        (["run", "--replay", ".", "--cache", "nowhere"], "nowhere"),
        (["run", "--replay", "."], "no flight data files"),
        (["run", "--replay", "packed"], "unpack packed/mission.ZIP first"),
        (["run", "--replay", "packed/mission.ZIP"], "unpack packed/mission.ZIP first"),
        (["run", "--replay", ".", "--send"], "--send"),
        (["run", "--replay", ".", "--out", "a-file"], "a-file"),
        (["check"], "-c"),
        (["check", "-c", "nowhere.yml"], "nowhere.yml"),
        (["check", "-c", "."], "."),
        (["status", "-c", "nowhere.yml"], "nowhere.yml"),
        (["test-alert", "-c", "nowhere.yml"], "nowhere.yml"),
    ],
)
def test_wrong_arguments_are_told_in_a_line_and_end_with_2(
    arguments: list[str], told: str, tmp_path: Path
) -> None:
    (tmp_path / "a-file").write_text("", encoding="utf-8")
    (tmp_path / "packed").mkdir()
    (tmp_path / "packed" / "mission.ZIP").write_bytes(b"PK")
    result = command(*arguments, cwd=tmp_path)
    assert result.returncode == 2
    assert told in result.stderr.strip().splitlines()[-1]
    assert TRACEBACK not in result.stderr
    assert not result.stdout


@pytest.mark.parametrize(
    "arguments",
    [
        ["--version"],
        ["check", "-h"],
        pytest.param(["status", "-c", "nowhere.yml"], marks=pytest.mark.slow),
        pytest.param(["test-alert", "-c", "gliderwatch.yml"], marks=pytest.mark.slow),
    ],
)
def test_commands_of_these_tests_do_what_the_installed_program_does(
    site: Site, arguments: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(site.configure("angus", url="json://127.0.0.1:9/${SECRET}").parent)
    one, other = command(*arguments, SECRET=PASSWORD), installed(*arguments, SECRET=PASSWORD)
    assert (one.returncode, one.stdout, one.stderr) == (other.returncode, other.stdout, other.stderr)
    assert one.stdout + one.stderr


@pytest.mark.parametrize("option", [["--cache", "."], ["--glider", "electa"], ["--out", "out"], ["--send"]])
def test_options_of_a_replay_are_refused_without_it(site: Site, option: list[str]) -> None:
    result = command("run", "-c", site.configure("angus"), *option, cwd=site.root)
    assert result.returncode == 2
    assert "go with --replay" in result.stderr
    assert not site.state.exists()


@pytest.mark.parametrize("name", ["run", "check", "status", "test-alert"])
def test_a_bad_configuration_is_told_with_its_line(site: Site, name: str) -> None:
    site.config.write_text("dockserver:\n  roots: [/tmp]\n  settle_secnds: 3\n", encoding="utf-8")
    result = command(name, "-c", site.config)
    assert result.returncode == 2
    assert f"{site.config}:3: dockserver.settle_secnds: unknown key" in result.stderr
    assert "settle_seconds" in result.stderr
    assert TRACEBACK not in result.stderr


def test_a_state_file_that_cannot_be_is_told_in_a_line(site: Site) -> None:
    site.state.parent.write_text("not a folder", encoding="utf-8")
    result = command("run", "-c", site.configure("angus"))
    assert result.returncode == 2
    assert len(result.stderr.strip().splitlines()) == 1
    assert "state.path" in result.stderr


def test_a_state_file_that_is_none_is_told_in_a_line(site: Site) -> None:
    site.state.parent.mkdir()
    site.state.write_text("some other text, long enough to be read as a database" * 100, encoding="utf-8")
    result = command("status", "-c", site.configure("angus"))  # `run` sets it aside: test_power.py
    assert result.returncode == 2
    assert str(site.state) in result.stderr
    assert TRACEBACK not in result.stderr


# --------------------------------------------------------------------------- check


def test_check_is_content_with_a_good_site(site: Site) -> None:
    mission = healthy(0.3)
    site.caches(mission)
    site.folder("angus")
    with mail_server() as box:
        result = command("check", "-c", site.configure("angus", url=box.url))
    assert result.returncode == 0
    assert "0 errors, 0 warnings; gliders: angus" in result.stdout
    assert not result.stderr


def test_check_names_every_problem_with_its_line_and_writes_nothing(site: Site) -> None:
    site.folder("stranger")
    config = site.configure("angus", url="mailto://127.0.0.1:1?to=nobody", cache=["/nowhere/cache"])
    result = command("check", "-c", config)
    assert result.returncode == 1
    said = [line for line in result.stdout.splitlines() if line.startswith(f"{config}:")]
    for words in ("/nowhere/cache is not there", "stranger", "channels.mail.url", "no folder angus"):
        assert sum(words in line for line in said) == 1, (words, said)
    text = config.read_text(encoding="utf-8").splitlines()
    number = next(line for line in said if "/nowhere/cache" in line).split(":")[1]
    assert "/nowhere/cache" in text[int(number) - 1]
    assert not site.state.parent.exists()


# --------------------------------------------------------------------------- status


def test_status_without_a_state_says_what_to_do(site: Site) -> None:
    result = command("status", "-c", site.configure("angus"))
    assert result.returncode == 2
    assert "has the daemon run with this configuration?" in result.stderr
    assert not site.state.parent.exists()


def test_status_tells_a_running_daemon_from_a_stopped_and_from_a_killed_one(site: Site) -> None:
    config = site.configure("angus")
    for end in (Daemon.stop, Daemon.kill):
        with Daemon(site) as daemon:
            until(lambda: site.state.exists() and site.status()["alive"], "alive")
            assert command("status", "-c", config).returncode == 0
            end(daemon)
            result = command("status", "-c", config)
            assert result.returncode == 1
            assert "NOT RUNNING" in result.stdout
            assert site.status()["alive"] is False


def test_status_tells_gliders_and_files(site: Site) -> None:
    mission = healthy(1.0)
    site.caches(mission)
    config = site.configure("angus", "bruce")
    files = list(arrivals(mission))
    for file in files:
        site.put("angus", file.name, file.data)
    with Daemon(site):
        until(lambda: len(site.files()) == len(files), "all taken")
        told = site.status()
        shown = command("status", "-c", config).stdout
    assert told["files"] == {"taken": len(files)}
    angus, bruce = told["gliders"]["angus"], told["gliders"]["bruce"]
    assert angus["segments"] == len(files)
    assert angus["latest"]["flag"] == 0
    assert angus["latest"]["t_surface"].endswith("Z")
    empty = {"configured": True, "segments": 0, "dives": 0, "latest": None, "incidents": []}
    empty |= {"irregularities": [], "announced_and_not_come": [], "last_call": None, "open": []}
    silence = dict.fromkeys(("expected", "heard", "overdue_at", "muted_until"))
    assert bruce == empty | silence | {"overdue": False, "ended": False, "recovered": False}
    assert angus["ended"] and not angus["overdue"] and angus["expected"]["t"] > angus["latest"]["t_surface"]
    assert f"{angus['latest']['speed']:.2f}" in next(
        line for line in shown.splitlines() if line.startswith("angus")
    )
    assert "no dive yet" in next(line for line in shown.splitlines() if line.startswith("bruce"))
    assert "bruce: not missed while it is silent, no dive yet" in shown.splitlines()
    assert max(map(len, shown.splitlines())) <= 80


# --------------------------------------------------------------------------- test-alert


def test_test_alert_reaches_the_channel(site: Site) -> None:
    with mail_server() as box:
        result = command("test-alert", "-c", site.configure("angus", url=box.url))
    assert (result.returncode, result.stdout) == (0, "mail: accepted\n")
    assert len(box.mails) == 1
    assert "the channel mail of gliderwatch works" in box.mails[0].text


def test_test_alert_tells_a_failure_and_ends_with_1(site: Site) -> None:
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))
        config = site.configure("angus", url=secretive(nobody.getsockname()[1]))
        result = command("test-alert", "-c", config, SECRET=PASSWORD)
    assert result.returncode == 1
    assert "mail: FAILED" in result.stdout
    assert "refused" in result.stdout


def test_test_alert_knows_its_channels(site: Site) -> None:
    with mail_server() as box:
        config = site.configure("angus", url=box.url)
        assert command("test-alert", "-c", config, "--channel", "mail").returncode == 0
        wrong = command("test-alert", "-c", config, "--channel", "male")
    assert wrong.returncode == 2
    assert "there is no channel male; known are: mail" in wrong.stderr
    none = command("test-alert", "-c", site.configure("angus"))
    assert none.returncode == 2
    assert "no channels" in none.stderr


def test_a_missing_secret_is_named_by_every_command(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    config = site.configure("angus", url=secretive(25))
    monkeypatch.delenv("SECRET", raising=False)
    for name, code in (("run", 2), ("check", 1), ("test-alert", 1)):
        result = command(name, "-c", config)
        assert result.returncode == code, result
        assert "environment variable SECRET is not set" in result.stdout + result.stderr
        assert TRACEBACK not in result.stderr


# --------------------------------------------------------------------------- secrets


def test_no_command_tells_a_secret(site: Site) -> None:
    mission = healthy(0.5)
    site.caches(mission)
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))
        port = nobody.getsockname()[1]
        config = site.configure("angus", url=secretive(port), surfacing=["angus"])
        for file in arrivals(mission):
            site.put("angus", file.name, file.data)
        with Daemon(site, SECRET=PASSWORD) as daemon:
            until(lambda: daemon.log("alert not delivered"), "a mail was tried")
            daemon.reload()
            until(lambda: daemon.log("configuration read again"), "reloaded")
            said = [
                command(name, "-c", config, *more, SECRET=PASSWORD)
                for name, more in (("check", []), ("status", []), ("status", ["--json"]), ("test-alert", []))
            ]
            daemon.stop()
    told = daemon.text() + "".join(result.stdout + result.stderr for result in said)
    assert "127.0.0.1" in told
    assert PASSWORD not in told
    for kept in site.state.parent.iterdir():
        assert PASSWORD.encode() not in kept.read_bytes(), kept
