"""The pages of a state file as they are now: made in the process that draws, once for all who look at them,
and again when there is news. Who answers only hands bytes on."""

from __future__ import annotations

import asyncio
import gzip
import time
from collections.abc import Awaitable, Callable, Hashable, Mapping
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from gliderwatch.delivery import links
from gliderwatch.figures.map_files import land_or_world
from gliderwatch.health.rule import Limits
from gliderwatch.messages.guide import PAGE
from gliderwatch.pages import render
from gliderwatch.pages.fields import read_field
from gliderwatch.pages.reading import SHOWN, read_fleet, read_glider
from gliderwatch.pages.render import Frame, guide_page
from gliderwatch.pages.view import GliderView
from gliderwatch.params import Attention
from gliderwatch.store.state_file import Store

READERS = "who reads the pages"
"""Whom the links on the pages are for: who reaches them is not known here."""
LIVE = "events"
"""The address of news."""
FLEET = "index.html"
FLEET_KEPT, GLIDER_KEPT = 60.0, 300.0
"""Seconds for which a page holds while nothing is new."""
EXPLORED = 3000
"""Dives of a glider, a year of them, that are explored at the most."""
_GZIP = 6


@dataclass(frozen=True, slots=True)
class Shown:
    """What is shown: the gliders of a state file, by name how the silence of each is taken and the limits of
    its battery; and ``fields``, with maps of the files ``maps``. Links are signed by ``key``."""

    state: Path
    attention: dict[str, Attention]
    batteries: dict[str, Limits | None]
    fields: tuple[str, ...]
    maps: tuple[str, ...]
    key: str


@dataclass(frozen=True, slots=True)
class LiveJob:
    """A page to be made, by the name of its file; ``warning`` stands above all that is on it."""

    shown: Shown
    file: str
    warning: str = ""


@dataclass(frozen=True, slots=True)
class LivePage:
    """A page as it is sent: whole, and packed by gzip; ``version`` is another each time that it is made."""

    plain: bytes
    packed: bytes
    version: str


def kept(file: str) -> float:
    """Seconds for which a page holds while nothing is new."""
    return FLEET_KEPT if file == FLEET else GLIDER_KEPT


def files_of(name: str) -> Mapping[str, str]:
    """The pages of a glider: what each is, by the name of its file."""
    return {render.file_of(name): "", render.file_of(name, "-sheet"): "-sheet"}


def page(job: LiveJob) -> LivePage:
    """Make a page. Raises KeyError where there is none of that name, GliderwatchError."""
    now = time.time()
    version = f"{now:.3f}"
    frame = Frame(
        now, now + 2 * kept(job.file) + 60.0, f"{LIVE}?page={quote(job.file)}&since={version}", job.warning
    )
    plain = _text(job, frame).encode()
    return LivePage(plain, gzip.compress(plain, _GZIP, mtime=0), version)


def explored(job: LiveJob) -> str:
    """The plots of a glider to explore, as JSON. Raises KeyError where there is no such glider,
    GliderwatchError."""
    from gliderwatch.web import explore  # noqa: PLC0415 (Bokeh is loaded when somebody explores)

    name = {render.file_of(name, ending="json"): name for name in job.shown.attention}[job.file]
    with Store.looking(job.shown.state) as store:
        return explore.plots(_view(job.shown, store, name, time.time(), EXPLORED))


def _text(job: LiveJob, frame: Frame) -> str:
    if job.file == PAGE:
        return guide_page()
    shown = job.shown
    land = land_or_world(shown.maps)[0]
    with Store.looking(shown.state) as store:
        if job.file == FLEET:
            attention = shown.attention.__getitem__
            views = read_fleet(store, [*shown.attention], attention, frame.now, batteries=shown.batteries)
            return render.fleet_page(views, frame, land, shown.fields)
        for name in shown.fields:
            if job.file == render.field_file(name):
                field = read_field(store, name, frame.now)
                if field is None:
                    raise KeyError(job.file)
                return render.field_page(field, frame, land)
        kinds = {file: (name, kind) for name in shown.attention for file, kind in files_of(name).items()}
        name, kind = kinds[job.file]
        view = _view(shown, store, name, frame.now)
    if kind:
        return render.sheet_page(view, frame, land)
    return render.glider_page(view, frame, land, _take_on(shown.key, view))


def _view(shown: Shown, store: Store, name: str, now: float, dives: int = SHOWN) -> GliderView:
    attention, battery = shown.attention[name], shown.batteries[name]
    return read_glider(store, name, attention, now, dives=dives, battery=battery)


def _take_on(key: str, view: GliderView) -> dict[str, str]:
    """The links of a page by which what goes on can be taken on, and the glider muted: signed, so that no
    other page can have a browser follow them."""
    ids = {m.id: m.id for m in view.open_matters if m.can_be_taken_on}
    ids[view.name] = f"{view.name}/mute"
    return {what: f"ack/{links.token(key, identity, READERS)}" for what, identity in ids.items()}


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
            making = self._making[file] = asyncio.ensure_future(self._made_again(file, self._clock()))
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
            await self._made_again(file, self._held[file].asked)
        return bool(late)

    async def _made_again(self, file: str, asked: float) -> LivePage:
        mark = self._mark(file)  # before it is made: news that come meanwhile have it made again
        page = await self._make(file)
        held = self._held.get(file)
        self._held[file] = _Held(page, mark, self._clock(), asked if held is None else held.asked)
        return page
