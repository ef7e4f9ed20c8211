"""Pages that are made once for all who look at them, and anew when there is news of what they show."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable, Hashable
from dataclasses import dataclass

from gliderwatch.web.live import LivePage

LOOKED_AT = 600.0
"""Seconds after which a page that nobody asked for is not made anew."""


@dataclass(slots=True)
class _Held:
    page: LivePage
    mark: Hashable
    made: float
    asked: float


class PageCache:
    """Pages by the names of their files; used in one thread. `make` is slow: nobody waits for it who can have
    the page as it was a moment ago. `mark` is another whenever there is news of what a page shows, `keep` are
    the seconds for which it holds without."""

    def __init__(
        self,
        make: Callable[[str], Awaitable[LivePage]],
        mark: Callable[[str], Hashable],
        keep: Callable[[str], float],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._make, self._mark, self._keep, self._clock = make, mark, keep, clock
        self._held: dict[str, _Held] = {}
        self._making: dict[str, asyncio.Future[LivePage]] = {}

    def held(self, file: str) -> LivePage | None:
        """A page that is there; None where it has to be made first."""
        held, now = self._held.get(file), self._clock()
        if held is None or now - held.made >= 2 * self._keep(file):
            return None
        held.asked = now
        return held.page

    async def get(self, file: str) -> LivePage:
        """A page, made if need be, once for all who wait for it. Raises what `make` raises."""
        page = self.held(file)
        if page is not None:
            return page
        making = self._making.get(file)
        if making is None:
            making = self._making[file] = asyncio.ensure_future(self._anew(file, self._clock()))
            making.add_done_callback(lambda _: self._making.pop(file))
        return await asyncio.shield(making)

    async def refresh(self) -> bool:
        """Make those anew that somebody looks at and that are out of date; whether there were any. Raises
        what `make` raises."""
        now = self._clock()
        for file in [file for file, held in self._held.items() if now - held.asked > LOOKED_AT]:
            del self._held[file]
        late = [
            file
            for file, held in self._held.items()
            if held.mark != self._mark(file) or now - held.made >= self._keep(file)
        ]
        for file in late:
            await self._anew(file, self._held[file].asked)
        return bool(late)

    async def _anew(self, file: str, asked: float) -> LivePage:
        mark = self._mark(file)  # before it is made: news that come meanwhile have it made again
        page = await self._make(file)
        held = self._held.get(file)
        self._held[file] = _Held(page, mark, self._clock(), asked if held is None else held.asked)
        return page
