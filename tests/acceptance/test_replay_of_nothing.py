"""A replay that assessed nothing says why in a line, with the cure, and ends with 1."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from acceptance.support import GLIDERWATCH, TRACEBACK, Site, command, healthy, lines
from gliderwatch.service.replay import WRITTEN
from gliderwatch.simulate.delivery import write_mission

README = Path(__file__).resolve().parents[2] / "README.md"


@pytest.fixture(scope="module")
def dockserver(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The usual tree: gliders/NAME/from-glider, and the cache beside `gliders`."""
    folder = tmp_path_factory.mktemp("dockserver")
    write_mission(folder / "gliders", folder / "cache", healthy(0.6))
    return folder


def nothing(result: subprocess.CompletedProcess[str]) -> str:
    assert result.returncode == 1, result.stdout + result.stderr
    (told,) = result.stderr.strip().splitlines()
    assert told.startswith("nothing was assessed: ")
    return told


def test_the_cache_two_levels_up_is_found_and_named_as_one_would_type_it(dockserver: Path) -> None:
    here = dockserver / "gliders" / "angus" / "from-glider"
    result = command("run", "--replay", ".", cwd=here)
    told = nothing(result)
    n = len(list(here.glob("*.sbd")))
    assert re.search(rf"{n} files wait for \w+\.cac: add --cache (\S+)$", told), told
    assert told.endswith("--cache ../../../cache")
    assert len([line for line in result.stdout.splitlines() if "is missing" in line]) == 1, "told once"
    cured = command("run", "--replay", ".", *shlex.split(told.partition(": add ")[2]), cwd=here)
    assert cured.returncode == 0 and f"files: {n} taken" in cured.stdout


def test_a_cache_that_is_nowhere(dockserver: Path, tmp_path: Path) -> None:
    folder = tmp_path / "a" / "b" / "c" / "d" / "e"
    folder.mkdir(parents=True)
    (folder / "x.sbd").write_bytes(next((dockserver / "gliders").rglob("*.sbd")).read_bytes())
    (folder.parent / "cache").mkdir()
    (folder.parent / "cache" / "00000000.cac").write_text("another", encoding="utf-8")
    assert nothing(command("run", "--replay", folder)).endswith("name its folder: --cache FOLDER")


def test_a_cache_that_is_cut_is_named_whole_with_its_cure(dockserver: Path, tmp_path: Path) -> None:
    for path in (dockserver / "gliders").rglob("*.sbd"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    for path in (dockserver / "cache").glob("*.cac"):
        (tmp_path / path.name).write_bytes(path.read_bytes()[:500])
    told = nothing(command("run", "--replay", tmp_path))
    assert "it is cut or changed" in told
    assert told.endswith("copy it from the glider or the dockserver again; then replay again")


def test_only_garbage(tmp_path: Path) -> None:
    for n in range(25):
        (tmp_path / f"{n}.sbd").write_text("to whom it may concern\n" * 9, encoding="utf-8")
    result = command("run", "--replay", tmp_path)
    assert "25 files cannot be used (not a Slocum data file" in nothing(result)
    assert "name a folder with flight data" in result.stderr
    assert len(result.stdout.splitlines()) == 2, result.stdout


def test_gliders_that_are_not_in_the_configuration(dockserver: Path, tmp_path: Path) -> None:
    config = Site(tmp_path).configure("bruce")
    result = command("run", "-c", config, "--replay", dockserver)
    assert re.search(r"\d+ files of angus, not in the configuration: add the name under", nothing(result))
    assert len(result.stdout.splitlines()) == 2, result.stdout


def test_what_was_assessed_is_no_failure_whatever_else_was_there(dockserver: Path, tmp_path: Path) -> None:
    (tmp_path / "junk.sbd").write_text("junk", encoding="utf-8")
    result = command("run", "--replay", dockserver, "--replay", tmp_path)
    assert result.returncode == 0 and not result.stderr


def test_a_second_replay_into_the_same_folder_says_so_and_names_all_that_is_written(
    dockserver: Path, tmp_path: Path
) -> None:
    first, second = (command("run", "--replay", dockserver, "--out", tmp_path / "out") for _ in range(2))
    said = "holds an earlier replay: this one takes its place"
    assert said not in first.stdout and said in second.stdout
    assert sorted(WRITTEN) == sorted(path.name for path in (tmp_path / "out").iterdir())
    told = " ".join(README.read_text(encoding="utf-8").split())
    for name in WRITTEN:
        assert name in first.stdout.splitlines()[-1] and f"`{name}`" in told


def test_links_are_treated_as_the_service_treats_them(dockserver: Path, tmp_path: Path) -> None:
    real = sorted((dockserver / "gliders").rglob("*.sbd"))
    folder = tmp_path / "files"
    folder.mkdir()
    (folder / real[0].name).write_bytes(real[0].read_bytes())
    (folder / "link.sbd").symlink_to(real[1])
    (folder / "loop.sbd").symlink_to("loop.sbd")
    (folder / "of-another").symlink_to(dockserver / "gliders")
    (tmp_path / "way").symlink_to(folder)
    for way in (folder, tmp_path / "way"):
        result = command("run", "--replay", way, "--cache", dockserver / "cache", "--out", tmp_path / "out")
        assert "files: 2 quarantined, 1 taken" in result.stdout, result.stdout
        assert "2 files: not a regular file" in result.stdout and TRACEBACK not in result.stderr


# --------------------------------------------------------------------------- README


@pytest.fixture
def shell(tmp_path: Path) -> Iterator[dict[str, str]]:
    """An environment in which the installed command is found, in an empty folder."""
    yield os.environ | {"PATH": f"{GLIDERWATCH.parent}:{os.environ['PATH']}"}


def test_the_two_commands_of_the_readme_run_by_themselves(shell: dict[str, str], tmp_path: Path) -> None:
    blocks = re.findall(r"^```sh\n(.*?)^```", README.read_text(encoding="utf-8"), re.M | re.S)
    (two,) = (block for block in blocks if "gliderwatch simulate" in block)
    assert len(two.splitlines()) == 2
    for line in two.splitlines():
        done = subprocess.run(
            line, shell=True, cwd=tmp_path, env=shell, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
    assert "sim-01 SLOW" in done.stdout
    assert lines(tmp_path / "results" / "alerts.jsonl")
