"""Folders for scratch files: removed by the next start where a kill left them."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from gliderwatch.slocum.caches import Scratch

HOLD = "from gliderwatch.slocum.caches import Scratch; print(Scratch().name, flush=True); input()"
KILLED = """
import multiprocessing, os, signal, sys
from gliderwatch.slocum.decode import _prepare
multiprocessing.get_context("spawn").Process(target=_prepare, args=(sys.argv[1], 1 << 40)).start()
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    return tmp_path


def test_what_a_kill_left_is_removed_and_what_lives_is_not(folder: Path) -> None:
    (folder / "gliderwatch-chaos-1").mkdir()  # not of this kind
    command = [sys.executable, "-c", HOLD]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None
        theirs = Path(other.stdout.readline().strip())
        (theirs / "staged").write_text("", encoding="utf-8")
        mine = Scratch()
        assert theirs.is_dir() and Path(mine.name).is_dir()
        other.kill()
        other.wait()
    another = Scratch()
    assert not theirs.exists() and Path(mine.name).is_dir()
    mine.cleanup()
    mine.cleanup()
    another.cleanup()
    assert [path.name for path in folder.iterdir()] == ["gliderwatch-chaos-1"]


def test_a_link_is_not_followed(folder: Path) -> None:
    (folder / "precious").mkdir()
    (folder / "precious" / "file").write_text("", encoding="utf-8")
    (folder / "gliderwatch-scratch-x").symlink_to(folder / "precious")
    Scratch().cleanup()
    assert (folder / "precious" / "file").exists()


def test_a_worker_that_starts_while_its_daemon_is_killed_ends_without_a_word(folder: Path) -> None:
    """The next daemon has removed the folder of the one before by then."""
    gone = folder / "gliderwatch-scratch-gone"
    command = [sys.executable, "-c", KILLED, str(gone)]
    ended = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert ended.returncode < 0
    assert ended.stderr == ""  # all of it: it is closed by the worker, whose it is as well
