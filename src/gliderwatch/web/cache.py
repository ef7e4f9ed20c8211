"""Pages that are made once for all who look at them, and anew when the state file has changed."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

Stamp = tuple[tuple[int, int], ...]
LOOKED_AT = 600.0
"""Seconds after which a page that nobody asked for is not made anew."""


@dataclass(slots=True)
class _Page:
    text: str
    stamp: Stamp
    made: float
    asked: float


def stamp_of(state: Path) -> Stamp:
    """What changes with every change of a state file: time and size of it and of its log."""
    found = []
    for path in (state, state.with_name(f"{state.name}-wal")):
        try:
            status = path.stat()
            found.append((status.st_mtime_ns, status.st_size))
        except OSError:
            found.append((0, 0))
    return tuple(found)


class PageCache:
    """Pages by their path; used by several threads. `make` is slow: nobody waits for it who can have the page
    as it was a moment ago. `keep` are the seconds for which a page holds without any change."""

    def __init__(
        self,
        make: Callable[[str], str],
        stamp: Callable[[], Stamp],
        keep: Callable[[str], float],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._make, self._stamp, self._keep, self._clock = make, stamp, keep, clock
        self._pages: dict[str, _Page] = {}
        self._drawing = threading.Lock()

    def held(self, path: str) -> str | None:
        """A page that is there; None where it has to be made first. At once: for the thread that answers."""
        page, now = self._pages.get(path), self._clock()
        if page is None or now - page.made >= 2 * self._keep(path):
            return None
        page.asked = now
        return page.text

    def get(self, path: str) -> str:
        """A page, made if need be. Raises what `make` raises, KeyError where there is no such page."""
        before = self._pages.get(path)
        if (text := self.held(path)) is not None:
            return text
        with self._drawing:
            again = self._pages.get(path)
            if again is not None and again is not before:
                return again.text  # somebody else made it meanwhile
            return self._anew(path, self._clock()).text

    def refresh(self) -> bool:
        """Make those anew that somebody looks at and that are out of date; whether there were any."""
        now, stamp = self._clock(), self._stamp()
        for path in [path for path, page in self._pages.items() if now - page.asked > LOOKED_AT]:
            del self._pages[path]
        late = [
            path
            for path, page in self._pages.items()
            if page.stamp != stamp or now - page.made >= self._keep(path)
        ]
        for path in late:
            with self._drawing:
                self._anew(path, self._pages[path].asked)
        return bool(late)

    def _anew(self, path: str, asked: float) -> _Page:
        stamp = self._stamp()
        page = _Page(self._make(path), stamp, self._clock(), asked)
        self._pages[path] = page
        return page
