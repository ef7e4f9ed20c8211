"""The process that writes pages: whatever it does, pages are whole and the others are written."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path
from queue import SimpleQueue

import pytest

from bad_pages import misbehave, sign
from gliderwatch.config import load
from gliderwatch.service.page_writer import FLEET_EVERY, PageWriter

GLIDERS = ["dies", "fails", "hangs", "well"]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "pages"


def configured(folder: Path) -> Path:
    path = folder.with_name("gliderwatch.yml")
    path.write_text(
        f"dockserver: {{roots: [{folder.parent}]}}\nstate: {{path: {folder.parent}/state.sqlite}}\n"
        f"pages: {{folder: {folder}}}\ngliders: {{well: , hangs: , dies: , fails: }}\n"
    )
    return path


@pytest.mark.timing
def test_what_hangs_dies_or_fails_holds_up_no_other_page(folder: Path) -> None:
    news: SimpleQueue[object] = SimpleQueue()
    writer = PageWriter(news.put, misbehave, limit=1.0)
    writer.use(load(configured(folder)))
    slowest = 0.0
    try:
        for _ in range(1 + len(GLIDERS)):  # the one of all, then each
            begun = time.monotonic()
            writer.turn(GLIDERS, monotonic=0.0)
            slowest = max(slowest, time.monotonic() - begun)
            news.get(timeout=60)
        assert sorted(path.name for path in folder.iterdir()) == ["all", "well"]
        # all were begun: nothing is tried again before there is news, or its time has come
        writer.turn(GLIDERS, monotonic=1.0)
        assert writer.is_idle
        (folder / "all").unlink()
        writer.turn(GLIDERS, monotonic=FLEET_EVERY)
        news.get(timeout=60)
        assert (folder / "all").exists()
        (folder / "well").unlink()
        writer.changed("well")
        for _ in range(2):
            writer.turn(GLIDERS, monotonic=FLEET_EVERY + 1.0)
            news.get(timeout=60)
        assert (folder / "well").exists()
    finally:
        writer.stop()
    print(f"longest turn of the daemon's thread: {1000 * slowest:.0f} ms")


def test_what_was_given_to_a_process_that_had_died_is_written_by_the_next(folder: Path) -> None:
    news: SimpleQueue[object] = SimpleQueue()
    writer = PageWriter(news.put, sign)
    writer.use(load(configured(folder)))
    before = "nobody"
    try:
        for _ in range(8):
            writer.changed("")
            while not writer.is_idle:
                writer.turn([], monotonic=0.0)
                news.get(timeout=60)
            assert (folder / "all").read_text() != before
            before = (folder / "all").read_text()
            os.kill(int(before), signal.SIGKILL)
    finally:
        writer.stop()


def test_without_a_folder_no_process_is_made(tmp_path: Path) -> None:
    path = tmp_path / "gliderwatch.yml"
    path.write_text(f"dockserver: {{roots: [{tmp_path}]}}\n")
    writer = PageWriter(lambda _: None)
    writer.use(load(path))
    writer.changed("electa")
    writer.turn(["electa"], 0.0)
    assert not writer.is_idle  # it would begin, were there a folder
    writer.stop()


@pytest.mark.slow
def test_a_reader_never_sees_half_a_page_though_the_writer_is_killed(tmp_path: Path) -> None:
    path, chance = tmp_path / "index.html", random.Random(1)
    seen: set[str] = set()
    path.write_text("0" * 400_000)
    for _ in range(6):
        before = path.stat().st_mtime_ns
        command = [sys.executable, str(Path(__file__).parents[1] / "bad_pages.py"), str(path)]
        with subprocess.Popen(command) as process:
            deadline = time.monotonic() + 30.0
            while path.stat().st_mtime_ns == before and time.monotonic() < deadline:
                seen.add(whole(path))
            end = time.monotonic() + chance.uniform(0.05, 0.25)
            while time.monotonic() < end:
                seen.add(whole(path))
            os.kill(process.pid, signal.SIGKILL)
        seen.add(whole(path))
    assert len(seen) > 2
    assert len(list(tmp_path.iterdir())) > 1  # a kill in the middle leaves a part, which no reader opens


def whole(path: Path) -> str:
    """The letter of a page, which is of one letter and has its length."""
    text = path.read_text()
    assert text == text[0] * 400_000
    return text[0]
