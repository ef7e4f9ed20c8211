"""Faults that only tests make happen: Python loads this at start where PYTHONPATH leads here.

``CHAOS_KILL=before:3`` ends the process by SIGKILL just before its third commit, ``after:3`` just after it.
``CHAOS_STATE`` names a file: while it says ``readonly``, SQLite writes nothing. ``CHAOS_CLOCK`` names a file
with seconds by which the clock is wrong.
"""

from __future__ import annotations

import os
import signal
import sqlite3
import sys
import time
from pathlib import Path
from typing import Any

_WRITES = ("INSERT", "UPDATE", "DELETE")
_real_connect, _real_time = sqlite3.connect, time.time
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


if "--multiprocessing-fork" not in sys.orig_argv:
    if "CHAOS_KILL" in os.environ or "CHAOS_STATE" in os.environ:
        sqlite3.connect = _connect  # type: ignore[assignment]
    if "CHAOS_CLOCK" in os.environ:
        time.time = lambda: _real_time() + float(_told("CHAOS_CLOCK") or 0.0)
