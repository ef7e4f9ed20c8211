"""Pages are written by a process of its own: drawing can be slow, hang or die, and no alert waits for it."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import structlog

from gliderwatch.config import Config
from gliderwatch.health.battery import END
from gliderwatch.health.rule import Limits
from gliderwatch.health.rules import usual_limits
from gliderwatch.params import Attention
from gliderwatch.processes import NotBegun
from gliderwatch.service.drawing import DrawingProcess

if TYPE_CHECKING:
    from gliderwatch.figures.coast import Land
    from gliderwatch.store.state_file import Store

log = structlog.get_logger(__name__)

LIMIT = 60.0
"""Seconds that the pages of one glider, or the one of all, may take: usually below one."""
FLEET_EVERY, GLIDER_EVERY = 600.0, 3600.0
"""Seconds after which a page is written again without any news: countdowns, and where a glider drifts."""
EXPORTED = 5000
"""Dives of a glider in its table and its NetCDF file at the most: two years of them."""
_NICENESS = 10


@dataclass(frozen=True, slots=True)
class PageJob:
    """What is to be written: the pages of a ``glider``, or, where that is empty, the one of all, with maps of
    the files ``maps`` and ``attributes`` in NetCDF files. By glider: how its silence is taken, and the limits
    of its battery (None: that is not looked at)."""

    state: Path
    folder: Path
    attention: dict[str, Attention] = field(default_factory=dict)
    batteries: dict[str, Limits | None] = field(default_factory=dict)
    glider: str = ""
    maps: tuple[str, ...] = ()
    attributes: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class PagesWritten:
    """News for the daemon: what was begun is done, or was given up."""


def write(job: PageJob) -> str:
    """Write the pages of a job, and what lies beside them for other programs; why the maps have the coast of
    the package alone, if they do. Raises GliderwatchError."""
    from gliderwatch.figures.map_files import land_or_world
    from gliderwatch.store.state_file import Store

    now = time.time()
    land, reason = land_or_world(job.maps)
    with Store.looking(job.state) as store:
        if job.glider:
            name, limits = job.glider, job.batteries.get(job.glider)
            attention = job.attention[name]
            write_glider(store, job.folder, name, attention, limits, now, land, job.attributes)
        else:
            write_fleet(store, job.folder, job.attention, job.batteries, now, land)
    return reason


# ruff: noqa: PLC0415
# Nothing that draws is loaded in the daemon, which imports this module too.


def battery_limits(config: Config | None, glider: str) -> Limits | None:
    """The limits of a glider's battery: as configured, else the usual ones; None where that rule is off."""
    limits = usual_limits() if config is None else config.health(glider)
    return limits.get(END.name)


def write_fleet(
    store: Store,
    folder: Path,
    attention: dict[str, Attention],
    batteries: dict[str, Limits | None],
    now: float,
    land: Land,
) -> None:
    """Write what is of all gliders, those of `attention`, as known at `now` (s). Raises GliderwatchError."""
    from gliderwatch.export import maps
    from gliderwatch.messages.guide import PAGE
    from gliderwatch.pages import render, writing

    writing.clear(folder, now)
    writing.write_fleet(store, folder, attention, batteries, now, land)
    writing.put(folder / PAGE, render.guide_page())
    links = [render.file_of(name, ending="kml") for name in store.gliders()]
    writing.put(folder / "gliders.kml", maps.as_kml_link(links))


def write_glider(
    store: Store,
    folder: Path,
    name: str,
    attention: Attention,
    battery: Limits | None,
    now: float,
    land: Land,
    attributes: Mapping[str, str],
) -> None:
    """Write what is of one glider, as known at `now` (s), with `attributes` in its NetCDF file. Raises
    GliderwatchError."""
    from gliderwatch.export import dives, maps, netcdf
    from gliderwatch.pages import reading, render, writing

    view = reading.read_glider(store, name, attention, now, battery=battery)
    writing.write_glider(view, folder, land)
    writing.put(folder / render.file_of(name, ending="geojson"), maps.as_geojson((view,)))
    writing.put(folder / render.file_of(name, ending="kml"), maps.as_kml((view,)))
    every = store.facts(name).latest_dives(EXPORTED)
    writing.put(folder / render.file_of(name, ending="csv"), dives.as_csv(every))
    if any(dive.lat is not None and dive.lon is not None for dive in every):
        with writing.replacing(folder / render.file_of(name, ending="nc")) as part:
            netcdf.write(part, name, every, now, attributes)


class PageWriter:
    """Has the pages written that are out of date, one at a time. Used in the daemon's thread.

    `news` gets a `PagesWritten` whenever the next can be begun. `write` is what the process does, `limit` the
    seconds after which it is ended.
    """

    def __init__(
        self,
        news: Callable[[PagesWritten], None],
        write: Callable[[PageJob], str] = write,
        limit: float = LIMIT,
    ) -> None:
        self._news, self._write, self._limit = news, write, limit
        self._config: Config | None = None
        self._process = DrawingProcess(_NICENESS)
        self._job: Future[str] | None = None
        self._waiting: dict[str, None] = {}
        self._written: dict[str, float] = {}
        self._again: set[str] = set()

    def use(self, config: Config) -> None:
        """Go by these settings; all pages are written once."""
        self._config = config
        self._waiting, self._written = {}, {}

    def changed(self, glider: str) -> None:
        """There is news of a glider (empty: of none that is known): its pages, and that of all, are out of
        date."""
        self._waiting |= {"": None, glider: None}

    def turn(self, gliders: list[str], monotonic: float) -> None:
        """Begin to write what is out of date, if nothing is being written; `gliders` have a file by now."""
        config = self._config
        if config is None or config.pages.folder is None or (self._job is not None and not self._job.done()):
            return
        names = sorted({*config.gliders, *gliders})
        for name, every in (("", FLEET_EVERY), *((glider, GLIDER_EVERY) for glider in names)):
            if monotonic - self._written.get(name, float("-inf")) >= every:
                self._waiting.setdefault(name)
        if not self._waiting:
            return
        name = "" if "" in self._waiting else next(iter(self._waiting))
        del self._waiting[name]
        self._written[name] = monotonic
        if not name or name in names:
            some = [name] if name else names
            attention = {each: config.attention(each) for each in some}
            batteries = {each: battery_limits(config, each) for each in some}
            state, folder = Path(config.state.path), Path(config.pages.folder)
            maps, attributes = config.maps.files, config.export.attributes
            self._begin(PageJob(state, folder, attention, batteries, name, maps, attributes))

    @property
    def is_idle(self) -> bool:
        """Whether nothing is being written, nor waits to be."""
        return not self._waiting and (self._job is None or self._job.done())

    def stop(self) -> None:
        """End the process at once: the pages that are there are whole."""
        self._process.stop()

    def _begin(self, job: PageJob) -> None:
        self._job = self._process.begin(self._write, job, self._limit, job.state)
        if self._job is not None:
            self._job.add_done_callback(partial(self._ended, job))

    def _ended(self, job: PageJob, done: Future[str]) -> None:
        error = None if done.cancelled() else done.exception()
        if isinstance(error, NotBegun) and job.glider not in self._again:
            self._again.add(job.glider)  # once: the job may be what the process dies of
            self._waiting.setdefault(job.glider)
            self._news(PagesWritten())
            return
        self._again.discard(job.glider)
        if error is not None:
            what = str(error) or type(error).__name__
            log.warning("pages not written", glider=job.glider or "all", folder=str(job.folder), reason=what)
        elif not done.cancelled() and (reason := done.result()):
            log.warning("map file cannot be used", reason=reason)
        self._news(PagesWritten())
