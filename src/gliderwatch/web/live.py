"""One page of a state file as it is now, in the process that draws: who answers only hands bytes on."""

from __future__ import annotations

import gzip
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from gliderwatch.delivery import links
from gliderwatch.figures.map_files import land_or_world
from gliderwatch.health.rule import Limits
from gliderwatch.messages.guide import PAGE
from gliderwatch.pages import render
from gliderwatch.pages.fields import read_field
from gliderwatch.pages.guide import guide_page
from gliderwatch.pages.reading import SHOWN, read_fleet, read_glider
from gliderwatch.pages.render import Frame
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
