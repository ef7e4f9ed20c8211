"""Folders that go away and come back, and what an enemy puts into them."""

from __future__ import annotations

import shutil
import sqlite3
from contextlib import closing, suppress

from storm import Kind, Lane, SparedError, Storm

from acceptance.angus import FILES
from acceptance.hostile import fill, shown

_BATCH = 25
_LAST = 0.9
"""The part of the time after which no more hostile files come."""


class Places:
    """What is done to the folders of a dockserver."""

    def __init__(self, storm: Storm) -> None:
        self.storm, self.site, self.between = storm, storm.site, storm.chance.uniform

    def kinds(self) -> list[Kind]:
        """Folders that go away for some seconds."""
        return [
            ("root unmounted, and back", self._root),
            ("folder of caches away, and back", self._caches),
            ("cache files cut or changed, and back", self._bad_caches),
            ("bad cache files beside the good ones", self._more_caches),
        ]

    def _root(self) -> Lane:
        root, away = self.site.root, self.site.root.with_name("away")
        root.rename(away)
        self.storm.is_away = True
        try:
            yield self.between(1.0, 6.0)
            root.mkdir()  # the bare mount point
            yield self.between(0.5, 6.0)
        finally:
            with suppress(FileNotFoundError):
                root.rmdir()
            away.rename(root)
            self.storm.is_away = False

    def _caches(self) -> Lane:
        cache, away = self.site.cache, self.site.cache.with_name("cache-away")
        cache.rename(away)
        try:
            yield self.between(2.0, 12.0)
        finally:
            away.rename(cache)

    def _bad(self, text: bytes) -> bytes:
        """A list as no glider wrote it: empty, cut, or with two sensors in each other's place."""
        exchanged = text.replace(b"m_heading", b"m_x").replace(b"m_pitch ", b"m_heading ")
        return self.storm.chance.choice([b"", text[: len(text) // 2], exchanged.replace(b"m_x", b"m_pitch")])

    def _bad_caches(self) -> Lane:
        good = {path: path.read_bytes() for path in self.site.cache.iterdir()}
        for path, text in good.items():
            path.write_bytes(self._bad(text))
        try:
            yield self.between(2.0, 12.0)
        finally:
            for path, text in good.items():
                path.write_bytes(text)

    def _more_caches(self) -> Lane:
        more = {path.with_name(path.stem.upper() + ".CAC"): path for path in self.site.cache.iterdir()}
        for bad, path in more.items():
            bad.write_bytes(self._bad(path.read_bytes()))
        try:
            yield self.between(2.0, 12.0)
        finally:
            for bad in more:
                bad.unlink()


class Enemy:
    """Puts hostile files into folders of their own, and removes them once each is named in the ledger."""

    def __init__(self, storm: Storm) -> None:
        self.storm, self.site = storm, storm.site
        self.files = self.batches = 0
        self._missing: set[str] = set()

    def kinds(self) -> list[Kind]:
        """What an enemy does."""
        return [(f"{_BATCH} hostile files, named, removed", self._batch)]

    def is_named(self) -> bool:
        """Whether every file of the last batch is in the ledger."""
        folder, state = str(self.site.root / self._name()), f"file:{self.site.state}?mode=ro"
        sql = "SELECT path FROM files WHERE path BETWEEN ? AND ?"
        with suppress(sqlite3.Error), closing(sqlite3.connect(state, uri=True)) as db:
            self._missing -= {row[0] for row in db.execute(sql, (f"{folder}/", f"{folder}0"))}
        return not self._missing

    def remove(self) -> None:
        """Take the last batch away; what was not named by then is wrong."""
        if self._missing:
            names = sorted(self._missing)
            self.storm.wrong.append(f"{len(names)} hostile files are not named, as {names[0]!r}")
        self._missing = set()
        shutil.rmtree(self.site.root / self._name(), ignore_errors=True)

    def _name(self) -> str:
        return f"enemy{self.batches}"

    def _batch(self) -> Lane:
        while self.storm.is_away:
            yield 0.5
        if self.storm.part() > _LAST:
            raise SparedError
        self.batches += 1
        folder = self.site.folder(self._name())
        names = fill(folder, [file.data for file in FILES], _BATCH, self.storm.chance.randrange(1 << 30))
        self._missing = {f"{folder}/{shown(name)}" for name in names}
        self.files += len(names)
        while not self.is_named() or self.storm.is_away:
            yield 0.5
        self.remove()
