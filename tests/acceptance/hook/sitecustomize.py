"""Faults that only tests make happen: Python loads this at start where PYTHONPATH leads here.

``CHAOS_KILL=before:3`` ends the process by SIGKILL just before its third commit, ``after:3`` just after it.
The others name a file. While that of ``CHAOS_STATE`` says ``readonly``, SQLite writes nothing; that of
``CHAOS_CLOCK`` holds seconds by which the clock is wrong; while that of ``CHAOS_OBSERVER`` is there, the next
reading of inotify ends by an error; while that of ``CHAOS_SLOW`` is there, files of data open slowly.
"""

from __future__ import annotations

import errno
import os
import signal
import sqlite3
import sys
import threading
import time
from pathlib import Path
from typing import Any

_WRITES = ("INSERT", "UPDATE", "DELETE")
_real_connect, _real_time, _real_open = sqlite3.connect, time.time, os.open
_when, _, _number = os.environ.get("CHAOS_KILL", "").partition(":")
_left = int(_number or 0)


class Connection(sqlite3.Connection):
    """Counts what is committed, and can be made unable to write."""

    def execute(self, sql: str, *values: Any) -> sqlite3.Cursor:
        _make_readonly(self)
        commits = sql == "COMMIT" or (sql.startswith(_WRITES) and not self.in_transaction)
        if commits:
            _pass("before")
        cursor = super().execute(sql, *values)
        if commits:
            _pass("after")
        return cursor


def _pass(when: str) -> None:
    global _left  # noqa: PLW0603 (one process, one count)
    if when == _when:
        _left -= 1
        if not _left:
            os.kill(os.getpid(), signal.SIGKILL)


def _make_readonly(connection: sqlite3.Connection) -> None:
    if "CHAOS_STATE" in os.environ:
        broken = _told("CHAOS_STATE") == "readonly"
        sqlite3.Connection.execute(connection, f"PRAGMA query_only = {int(broken)}")


def _told(name: str) -> str:
    try:
        return Path(os.environ[name]).read_text(encoding="utf-8").strip()
    except OSError:
        return ""


def _connect(*arguments: Any, **options: Any) -> sqlite3.Connection:
    return _real_connect(*arguments, **options | {"factory": Connection})


def _open(path: Any, *more: Any, **names: Any) -> int:
    if str(path).endswith(".sbd") and Path(os.environ["CHAOS_SLOW"]).exists():
        time.sleep(0.3)
    return _real_open(path, *more, **names)


def _let_observer_die() -> None:
    from watchdog.observers import inotify_c

    real, mark = inotify_c.InotifyFD.read_events, Path(os.environ["CHAOS_OBSERVER"])

    def read_events(self: Any, **more: Any) -> Any:
        events = real(self, **more)
        if mark.exists():
            mark.unlink()
            threading.excepthook = lambda _: None
            raise OSError(errno.EIO, "the reader dies")
        return events

    inotify_c.InotifyFD.read_events = read_events  # type: ignore[method-assign]


if "--multiprocessing-fork" not in sys.orig_argv:
    if "CHAOS_OBSERVER" in os.environ:
        _let_observer_die()
    if "CHAOS_SLOW" in os.environ:
        os.open = _open
    if "CHAOS_KILL" in os.environ or "CHAOS_STATE" in os.environ:
        sqlite3.connect = _connect  # type: ignore[assignment]
    if "CHAOS_CLOCK" in os.environ:
        time.time = lambda: _real_time() + float(_told("CHAOS_CLOCK") or 0.0)
