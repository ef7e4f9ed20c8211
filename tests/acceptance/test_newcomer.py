"""What a newcomer sees: help, tables, links, samples, and the end by Ctrl-C."""

from __future__ import annotations

import os
import pty
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import click
import pytest

from acceptance.support import GLIDERWATCH, PATIENCE, TRACEBACK, Site, command, mail_server, remora, until
from gliderwatch.cli.look import SAMPLES as OFFERED
from gliderwatch.cli.main import main
from gliderwatch.messages.formatting import map_link
from gliderwatch.messages.samples import SAMPLES
from gliderwatch.model import Kind
from gliderwatch.simulate.delivery import write_mission

ROOT = Path(__file__).resolve().parents[2]
USUAL = "/etc/gliderwatch/gliderwatch.yml"


# --------------------------------------------------------------------------- help


@pytest.mark.parametrize("columns", ["80", "50"])
def test_help_is_not_cut(columns: str) -> None:
    shown = command("--help", COLUMNS=columns).stdout
    words = " ".join(shown.split())
    for found in main.commands.values():
        sentence = (found.help or "").strip().split("\n\n")[0]
        assert " ".join(sentence.split()) in words, found.name
    assert "..." not in shown.partition("Commands:")[2] and max(map(len, shown.splitlines())) <= int(columns)


LEAVES = [
    (name, *sub)
    for name, found in main.commands.items()
    for sub in (((each,) for each in found.commands) if isinstance(found, click.Group) else [()])
]


@pytest.mark.parametrize("names", LEAVES, ids=" ".join)
def test_every_command_has_an_example_that_can_be_typed(names: tuple[str, ...]) -> None:
    found: click.Command = main
    for name in names:
        assert isinstance(found, click.Group)
        found = found.commands[name]
    shown = command(*names, "-h", COLUMNS="80").stdout
    examples = [line.strip() for line in shown.partition("Example")[2].splitlines()[1:] if line.strip()]
    assert examples, shown
    assert max(map(len, shown.splitlines())) <= 80
    for line in examples:
        words = shlex.split(line)
        words = words[words.index("gliderwatch") + 1 :] if words[0] == "gliderwatch" else words[4:]
        assert tuple(words[: len(names)]) == names
        found.make_parser(click.Context(found)).parse_args(args=words[len(names) :])


@pytest.mark.parametrize(
    "name", [n for n in main.commands if n not in ("simulate", "score", "layers", "hindcast")]
)
def test_the_usual_configuration_is_that_of_every_command(name: str) -> None:
    (option,) = (p for p in main.commands[name].params if "-c" in p.opts)
    assert USUAL in " ".join(command(name, "-h").stdout.split())
    if Path(USUAL).exists():
        pytest.skip("this machine has one")
    needed = {"mute": ["electa", "--hours", "1"], "unmute": ["electa"], "ack": ["x"], "rebuild": ["electa"]}
    needed |= {"field": ["upper", "--out", "upper.nc"], "export": ["--format", "csv"]}
    result = command(name, *needed.get(name, ["copy.sqlite"] if name == "backup" else []))
    assert result.returncode == 2 and USUAL in " ".join((result.stderr + result.stdout).split())
    assert option.name == "config_path"


# --------------------------------------------------------------------------- tables


@pytest.fixture(scope="module")
def mission(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A glider with a remora, of which one dive has a reason that is long."""
    folder = tmp_path_factory.mktemp("mission")
    write_mission(folder, folder / "cache", remora(2.5))
    files = sorted(folder.rglob("*.sbd"))
    files[6].unlink()
    return folder


def on_terminal(*words: object, columns: int = 80) -> str:
    """What a command shows on a terminal of so many columns."""
    main_end, terminal = pty.openpty()
    shown = b""
    process = subprocess.Popen(
        [GLIDERWATCH, *map(str, words)],
        stdout=terminal,
        stderr=subprocess.DEVNULL,
        env=os.environ | {"COLUMNS": str(columns), "TERM": "xterm"},
    )
    os.close(terminal)
    try:
        while piece := os.read(main_end, 65536):
            shown += piece
    except OSError:  # the other end is closed
        pass
    finally:
        os.close(main_end)
    process.wait()
    return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown.decode()).replace("\r", "")


def test_a_replay_fits_a_terminal_and_its_reasons_are_whole(mission: Path) -> None:
    piped = command("run", "--replay", mission).stdout
    shown = on_terminal("run", "--replay", mission)
    assert max(map(len, shown.splitlines())) <= 80
    assert "…" not in shown + piped
    reasons = re.findall(r"^\d\d-\d\d \d\d:\d\d +[\d.]+ +((?![012] )\D.*?)  ", piped, re.M)
    assert any(len(reason) > 14 for reason in reasons), "one has to be wrapped on a terminal"
    for word in {word for reason in reasons for word in reason.split()}:
        assert word in shown
    for text in (piped, shown):
        for name in ("h: hours", "own:", "DAC:", "p_E:", "±:"):
            assert name in text, "a legend"


def test_the_link_to_the_map_is_in_one_piece(mission: Path) -> None:
    links = re.findall(r"https://\S+", on_terminal("run", "--replay", mission))
    assert links and all(
        re.fullmatch(r"https://\S+mlat=-?\d+\.\d{5}&mlon=-?\d+\.\d{5}&zoom=9", x) for x in links
    )
    longest = f"Map: {map_link(-89.12345, -179.12345)}"
    assert len(longest) <= 76, "it fits a frame on 80 columns"


def test_problems_are_marked(tmp_path: Path) -> None:
    site = Site(tmp_path)
    site.folder("stranger")
    config = site.configure("angus", cache=["/nowhere/cache"])
    shown = command("check", "-c", config).stdout.splitlines()[:-1]
    assert all(re.match(rf"{re.escape(str(config))}:\d+: (error|warning): ", line) for line in shown), shown
    assert sum(": error: " in line for line in shown) == 1 and "/nowhere/cache" in shown[0]


# --------------------------------------------------------------------------- samples


def test_there_is_a_sample_of_every_kind_of_message() -> None:
    assert set(SAMPLES) == set(Kind) == set(map(Kind, OFFERED))


def test_samples_arrive_whole_and_are_marked(tmp_path: Path) -> None:
    site = Site(tmp_path)
    with mail_server() as box:
        config = site.configure("angus", url=box.url)
        for kind in OFFERED:
            result = command("test-alert", "-c", config, "--sample", kind)
            assert (result.returncode, result.stdout) == (0, "mail: accepted\n"), result
        wrong = command("test-alert", "-c", config, "--sample", "catastrophe")
    assert wrong.returncode == 2 and "anomaly" in wrong.stderr
    assert len({mail.id for mail in box.mails}) == len(box.mails) == len(OFFERED)
    for mail in box.mails:
        assert mail.subject.strip().startswith("SAMPLE ") and mail.text.startswith("This is a sample")
    anomaly, overdue = (box.mails[OFFERED.index(kind)].text for kind in ("anomaly", "overdue"))
    for part in ("0.11 m/s", "Likeliest cause", "Next call", "What to do", "Map: https://", "Take it on"):
        assert part in anomaly, anomaly
    for part in ("is overdue", "What to do", "Map: https://"):
        assert part in overdue, overdue
    assert not site.state.exists()


# --------------------------------------------------------------------------- Ctrl-C


def interrupted(words: list[object], ready: Path, folder: Path) -> tuple[int, str]:
    """Ctrl-C as a terminal sends it: to a command and all that it started, once something is `ready`."""
    with (folder / "said").open("w+", encoding="utf-8") as said:
        process = subprocess.Popen(
            list(map(str, words)),
            stdout=said,
            stderr=said,
            cwd=folder,
            env=os.environ | {"TMPDIR": str(folder)},
            start_new_session=True,
        )
        until(lambda: any(ready.parent.glob(ready.name)) or process.poll() is not None, "begun")
        time.sleep(0.5)
        os.killpg(process.pid, signal.SIGINT)
        try:
            code = process.wait(PATIENCE)
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
        said.seek(0)
        return code, said.read()


def test_a_score_that_is_stopped_says_so_without_a_traceback(tmp_path: Path) -> None:
    code, said = interrupted([GLIDERWATCH, "score", "--out", "out"], tmp_path / "out" / "cells", tmp_path)
    assert code == 1 and "Aborted" in said
    assert TRACEBACK not in said and "KeyboardInterrupt" not in said, said


STOPPED_AT_THE_THIRD_TASK = """
import os, signal
from gliderwatch.cli.main import main
from distributed import Client

class Hands(Client):
    def submit(self, *args, given=[], **named):
        given.append(args)
        if len(given) == 3:
            os.kill(os.getpid(), signal.SIGINT)
        return super().submit(*args, **named)

import distributed
distributed.Client = Hands
main(["score", "--out", "out"])
"""


@pytest.mark.slow
def test_a_score_that_is_stopped_while_it_hands_out_tasks_ends_as_well(tmp_path: Path) -> None:
    """There Ctrl-C came outside what ends the workers, and the command ran all its cells to the end."""
    words = [sys.executable, "-c", STOPPED_AT_THE_THIRD_TASK]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert done.returncode == 1 and "Aborted" in done.stderr
    assert TRACEBACK not in done.stderr and "KeyboardInterrupt" not in done.stderr, done.stderr


@pytest.mark.slow
def test_a_demo_that_is_stopped_says_so_and_leaves_nothing(tmp_path: Path) -> None:
    demo = ROOT / "demo" / "demo.py"
    begun = tmp_path / "gliderwatch-demo-*"
    code, said = interrupted([sys.executable, demo], begun, tmp_path)
    assert code == 130 and "stopped" in said
    assert TRACEBACK not in said and "KeyboardInterrupt" not in said, said
    assert not list(tmp_path.glob("gliderwatch-demo-*"))
