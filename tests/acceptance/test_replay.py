"""The replay by the installed command: past missions, real and simulated, through the same path."""

from __future__ import annotations

import os
import pty
import re
import subprocess
import threading
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest

from acceptance.support import (
    GLIDERWATCH,
    TRACEBACK,
    Daemon,
    Site,
    command,
    healthy,
    lines,
    mail_server,
    remora,
    until,
)
from gliderwatch.simulate.delivery import FileForm, Names, write_mission
from gliderwatch.simulate.dinkum import Generation

FLIGHT = {".sbd", ".scd", ".mbd", ".mcd", ".dbd", ".dcd"}
NUMBERS = ("lat", "lon", "speed", "flow_u", "flow_v", "reference_u", "reference_v", "p_e", "clle_max")
KINDS = {"anomaly", "overdue", "false_alarm", "unknown", "all_clear", "reminder", "correction", "surfacing"}


def counts(text: str) -> dict[str, int]:
    """What became of files, from the last lines of a replay."""
    told = re.search(r"^files: (.*)$", text, re.MULTILINE)
    assert told is not None, text
    return {name: int(n) for n, name in (part.split() for part in told[1].split(", "))}


def check_time(text: str) -> float:
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z", text), text
    return datetime.fromisoformat(text).timestamp()


def check_assessment(line: dict[str, Any]) -> None:
    """That a line has the fields promised, and values that can be."""
    assert line["glider"] == line["glider"].lower() != ""
    assert line["segment"].lower().startswith(line["glider"])
    assert check_time(line["t_dive"]) < check_time(line["t_surface"])
    assert line["flag"] in (0, 1, 2, None)
    assert line["flag"] == 0 or line["reason"]
    for name in NUMBERS:
        assert line[name] is None or isinstance(line[name], int | float), name
    assert line["lat"] is None or abs(line["lat"]) <= 90
    assert line["flag"] is None or line["lat"] is not None
    assert (
        line["flag"] is None or line["speed"] is not None or "by depth rate and pitch alone" in line["reason"]
    )
    assert (line["reference_u"] is None) <= (line["p_e"] is None)
    assert line["p_e"] is None or 0 <= line["p_e"] <= 1
    assert 0 <= line["speed_min"] < line["speed_max"]
    assert isinstance(line["n_samples"], int)
    assert isinstance(line["notes"], list)


def check_alert(line: dict[str, Any]) -> None:
    """The same of an alert."""
    check_time(line["time"])
    assert line["kind"] in KINDS
    assert line["severity"] in ("info", "warning", "critical")
    assert line["glider"] in line["title"] + line["body"]
    assert line["title"]
    assert line["body"]
    assert bool(line["incident"]) == (line["kind"] != "surfacing")


# --------------------------------------------------------------------------- real missions


@pytest.mark.real
@pytest.mark.parametrize(
    ("mission", "glider", "left_out"),
    [
        ("electa-2022", "electa", {"waiting": 1}),
        ("usf-sam-2019", "usf-sam", {}),
        pytest.param("george-2024", "george", {}, marks=pytest.mark.slow),
        pytest.param("osu-2025", "osu684", {}, marks=pytest.mark.slow),
        pytest.param("maria-2022", "maria-997", {}, marks=pytest.mark.slow),
    ],
)
def test_a_real_mission_replays_and_every_file_is_accounted_for(
    shared_data: Path, tmp_path: Path, mission: str, glider: str, left_out: dict[str, int]
) -> None:
    folder = shared_data / mission
    result = command("run", "--replay", folder, "--out", tmp_path / "out", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert TRACEBACK not in result.stdout + result.stderr
    files = [path for path in folder.rglob("*") if path.suffix.lower() in FLIGHT]
    told = counts(result.stdout)
    assert sum(told.values()) == len(files)
    assert {name: n for name, n in told.items() if name not in ("taken", "duplicate")} == left_out
    dives = lines(tmp_path / "out" / "assessments.jsonl")
    assert {dive["glider"] for dive in dives} == {glider}
    assert any(dive["flag"] == 0 for dive in dives)
    for dive in dives:
        check_assessment(dive)
    for alert in lines(tmp_path / "out" / "alerts.jsonl"):
        check_alert(alert)
        assert alert["glider"] == glider


@pytest.mark.real
def test_a_file_without_its_cache_is_named_with_it(shared_data: Path) -> None:
    result = command("run", "--replay", shared_data / "electa-2022")
    assert "00920000.sbd: cache file 18531aa2.cac is missing" in result.stdout


@pytest.mark.real
def test_the_cache_may_lie_anywhere(shared_data: Path, tmp_path: Path) -> None:
    files = tmp_path / "some" / "where"
    files.mkdir(parents=True)
    for path in (shared_data / "usf-sam-2019" / "from-glider").glob("*.sbd"):
        (files / path.name).write_bytes(path.read_bytes())
    without = command("run", "--replay", files)
    assert counts(without.stdout) == {"waiting": len(list(files.iterdir()))}
    cache = shared_data / "usf-sam-2019" / "cache"
    given = command("run", "--replay", files, "--cache", cache, "--cache", tmp_path)
    assert counts(given.stdout) == {"taken": len(list(files.iterdir()))}


# --------------------------------------------------------------------------- what it tells


@pytest.fixture
def mission(tmp_path: Path) -> Path:
    """The folder of a mission with a remora, cache beside the files."""
    write_mission(tmp_path / "mission", tmp_path / "mission" / "cache", remora(2.5))
    return tmp_path / "mission"


def test_alerts_are_shown_and_written(mission: Path, tmp_path: Path) -> None:
    result = command("run", "--replay", mission, "--out", tmp_path / "out")
    alerts = lines(tmp_path / "out" / "alerts.jsonl")
    assert [alert["kind"] for alert in alerts][:1] == ["anomaly"]
    assert alerts[0]["severity"] == "critical"
    for alert in alerts:
        check_alert(alert)
        assert alert["title"][:30] in result.stdout
    dives = lines(tmp_path / "out" / "assessments.jsonl")
    assert [dive["t_dive"] for dive in dives] == sorted(dive["t_dive"] for dive in dives)
    assert {dive["flag"] for dive in dives} >= {0, 1}
    assert not result.stderr


def test_it_is_the_same_every_time(mission: Path, tmp_path: Path) -> None:
    for name in ("one", "two"):
        command("run", "--replay", mission, "--out", tmp_path / name)
        command("run", "--replay", mission, "--out", tmp_path / name)  # over what is there
    for name in ("assessments.jsonl", "alerts.jsonl"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


def test_all_forms_of_the_same_files_lead_to_the_same(mission: Path, tmp_path: Path) -> None:
    command("run", "--replay", mission, "--out", tmp_path / "out")
    expected = lines(tmp_path / "out" / "assessments.jsonl")
    forms = (
        FileForm(Names.SHORT),
        FileForm(compressed=True),
        FileForm(factored=False, generation=Generation.G2),
    )
    for number, form in enumerate(forms):
        folder = tmp_path / str(number)
        write_mission(folder, folder / "cache", remora(2.5), form)
        command("run", "--replay", folder, "--out", folder / "out")
        assert lines(folder / "out" / "assessments.jsonl") == expected, form


def test_copies_under_other_names_and_in_other_folders_count_once(mission: Path, tmp_path: Path) -> None:
    write_mission(mission / "again", mission / "cache", remora(2.5), FileForm(Names.SHORT))
    result = command("run", "--replay", mission, "--replay", mission / "again", "--out", tmp_path / "out")
    told = counts(result.stdout)
    assert told["taken"] == told["duplicate"]
    command("run", "--replay", mission / "bruce", "--cache", mission / "cache", "--out", tmp_path / "once")
    assert lines(tmp_path / "out" / "alerts.jsonl") == lines(tmp_path / "once" / "alerts.jsonl")


def test_one_glider_of_several(mission: Path, tmp_path: Path) -> None:
    write_mission(mission, mission / "cache", healthy(0.5))
    both = counts(command("run", "--replay", mission).stdout)
    one = command("run", "--replay", mission, "--glider", "Angus", "--out", tmp_path / "out")
    told = counts(one.stdout)
    assert told["taken"] + told["unknown"] == both["taken"]
    assert {dive["glider"] for dive in lines(tmp_path / "out" / "assessments.jsonl")} == {"angus"}
    assert "of bruce, not of angus" in one.stdout
    wrong = command("run", "--replay", mission, "--glider", "nessie")
    assert (wrong.returncode, wrong.stderr) == (2, "no files of glider nessie, but of: angus, bruce\n")


def test_bad_files_do_not_stop_the_others(mission: Path, tmp_path: Path) -> None:
    folder = mission / "bruce" / "from-glider"
    good = sorted(folder.glob("*.sbd"))
    (folder / "cut.sbd").write_bytes(good[3].read_bytes()[:73])
    (folder / "empty.sbd").touch()
    (folder / "text.sbd").write_text("to whom it may concern\n" * 100, encoding="utf-8")
    (folder / "folder.sbd").mkdir()
    os.mkfifo(folder / "fifo.sbd")
    (folder / "broken-link.sbd").symlink_to("/nowhere/at/all")
    (folder / os.fsdecode(b"not-\xff-utf8.sbd")).write_bytes(good[0].read_bytes())
    result = command("run", "--replay", mission, "--out", tmp_path / "out")
    assert result.returncode == 0, result.stderr
    assert counts(result.stdout) == {"taken": len(good), "quarantined": 6}
    for name in ("cut.sbd: cut or damaged", "empty.sbd: the file is empty", "text.sbd: not a Slocum data"):
        assert name in result.stdout
    for name in ("fifo.sbd", "broken-link.sbd"):
        assert f"{name}: not a regular file" in result.stdout
    assert "utf8.sbd: its name is not UTF-8" in result.stdout


def drained(terminal: int) -> None:
    """Read until the other end is closed."""
    with suppress(OSError):
        while os.read(terminal, 65536):
            pass


def test_what_is_piped_holds_the_alerts_also_while_a_bar_is_on_the_terminal(mission: Path) -> None:
    main, terminal = pty.openpty()
    reader = threading.Thread(target=drained, args=(main,))  # a terminal that nobody reads gets full
    reader.start()
    try:
        result = subprocess.run(
            [GLIDERWATCH, "run", "--replay", mission], stdout=subprocess.PIPE, stderr=terminal, check=True
        )
    finally:
        os.close(terminal)
        reader.join()
        os.close(main)
    assert b"bruce SLOW" in result.stdout


def test_tables_fit_a_terminal(mission: Path) -> None:
    result = command("run", "--replay", mission, COLUMNS="80")
    table = [line for line in result.stdout.splitlines() if re.match(r"\d\d-\d\d \d\d:\d\d", line)]
    assert len(table) > 10
    for line in table:
        assert len(line) <= 80
        assert "…" not in line, "a number was cut"


# --------------------------------------------------------------------------- what it leaves alone


def test_a_replay_sends_nothing_and_leaves_the_daemon_alone(mission: Path, tmp_path: Path) -> None:
    site = Site(tmp_path / "site")
    with mail_server() as box:
        config = site.configure("bruce", "angus", url=box.url, surfacing=["bruce"])
        with Daemon(site) as daemon:
            until(lambda: site.state.exists() and site.status()["alive"], "alive")
            before = site.state.read_bytes()
            result = command("run", "-c", config, "--replay", mission, "--out", tmp_path / "out")
            assert result.returncode == 0, result.stderr
            assert site.state.read_bytes() == before
            assert site.status()["gliders"]["bruce"]["segments"] == 0
            assert daemon.alive()
        kinds = [alert["kind"] for alert in lines(tmp_path / "out" / "alerts.jsonl")]
        assert "surfacing" in kinds
        assert "anomaly" in kinds
        assert box.mails == []


def test_the_folder_of_a_daemon_is_not_taken_for_results(mission: Path, tmp_path: Path) -> None:
    site = Site(tmp_path / "site")
    site.configure("bruce")
    with Daemon(site):
        until(lambda: site.state.exists() and site.status()["alive"], "alive")
    before = site.state.read_bytes()
    for arguments in ([], ["-c", site.config]):
        result = command("run", *arguments, "--replay", mission, "--out", site.state.parent)
        assert result.returncode == 0, result.stderr
        assert site.state.read_bytes() == before
    site.state = site.state.with_name("replay.sqlite")
    site.configure("bruce")
    with Daemon(site):
        until(lambda: site.state.exists() and site.status()["alive"], "alive")
        result = command("run", "--replay", mission, "--out", site.state.parent)
    assert result.returncode == 2
    assert "is the state of a daemon" in result.stderr


def test_nothing_is_written_below_what_is_replayed(mission: Path, tmp_path: Path) -> None:
    site = Site(tmp_path / "site")
    site.root = mission
    before = site.tree()
    command("run", "--replay", mission, cwd=tmp_path)
    assert site.tree() == before


def test_with_send_alerts_go_out_once_and_the_end_waits_for_them(mission: Path, tmp_path: Path) -> None:
    site = Site(tmp_path / "site")
    with mail_server() as box:
        config = site.configure("bruce", url=box.url)
        result = command("run", "-c", config, "--replay", mission, "--out", tmp_path / "out", "--send")
        assert result.returncode == 0, result.stderr
        alerts = lines(tmp_path / "out" / "alerts.jsonl")
        assert [mail.subject for mail in box.mails] == [alert["title"] for alert in alerts]
        assert len(alerts) > 0
        assert max(box.times().values()) == 1
    assert not site.state.exists()
