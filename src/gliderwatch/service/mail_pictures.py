"""Pictures in mails: the speed against its range, and the map, drawn by a process of its own while the mail
waits for them for not more than `LIMIT`; without them if they are not there by then."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import TimeoutError as NotInTime
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import structlog

from gliderwatch.delivery.mail import Picture
from gliderwatch.model import Alert
from gliderwatch.params import Attention
from gliderwatch.service.drawing import DrawingProcess

log = structlog.get_logger(__name__)

LIMIT = 2.0
"""Seconds for which a mail waits for its pictures: a fifth of one is usual."""
DIVES, PLACES = 40, 20
"""Dives in the plot of the speed, and on the map, at the most: those of the last days."""
HANGS = 30.0
"""Seconds after which the process counts as hung, and is begun anew: one that is only slow stays warm."""
_NICENESS = 0


@dataclass(frozen=True, slots=True)
class PictureJob:
    """What is to be drawn: a ``glider`` as the state file ``state`` has it at ``now`` (s), on a map with what
    the files ``maps`` have."""

    state: Path
    glider: str
    attention: Attention
    now: float
    maps: tuple[str, ...] = ()


# ruff: noqa: PLC0415
# Nothing that draws is loaded in the daemon, which imports this module too.


def draw(job: PictureJob) -> tuple[Picture, ...]:
    """The pictures of a glider; none of what it has no values for. Raises GliderwatchError."""
    from gliderwatch.figures import dives, map_png, plots
    from gliderwatch.figures.map_files import land_or_world
    from gliderwatch.pages import maps, reading
    from gliderwatch.store.state_file import Store

    with Store.looking(job.state) as store:
        view = reading.read_glider(store, job.glider, job.attention, job.now, dives=DIVES, whole=False)
    made = []
    if sum(dive.speed is not None for dive in view.dives) > 1:
        panel = dives.speed(view.dives)
        made.append(Picture("speed.png", panel.shows, plots.png(panel)))
    chart = maps.of_glider(replace(view, dives=view.dives[-PLACES:]))
    land, _ = land_or_world(job.maps)
    map_of = map_png.png(chart, land)
    if map_of:
        made.append(Picture("map.png", chart.title, map_of))
    return tuple(made)


def warm(maps: tuple[str, ...]) -> None:
    """Load what the first picture would wait for: matplotlib, its fonts, the coast, the readers of state."""
    import gliderwatch.pages.maps
    import gliderwatch.pages.reading  # noqa: F401
    from gliderwatch.figures import dives, map_png, plots
    from gliderwatch.figures.chart import Chart, Mark
    from gliderwatch.figures.map_files import land_or_world

    map_png.png(Chart("", marks=(Mark((0.0, 0.0), "warm"),)), land_or_world(maps)[0])
    plots.png(dives.speed(()))


class MailPictures:
    """Has the pictures of messages drawn. Used in the threads of the channels.

    `attention` says when each glider is silent, and may be put anew; `now` is the clock of what is drawn,
    `draw` what the process does, `limit` for how long a mail waits (s).
    """

    def __init__(
        self,
        state: Path,
        attention: Callable[[str], Attention],
        now: Callable[[], float],
        maps: tuple[str, ...] = (),
        draw: Callable[[PictureJob], tuple[Picture, ...]] = draw,
        limit: float = LIMIT,
    ) -> None:
        self._state, self.attention, self._now = state, attention, now
        self._draw, self._limit, self._maps = draw, limit, maps
        self._process = DrawingProcess(_NICENESS, partial(warm, maps))

    def prepare(self) -> None:
        """Begin the process, so that the first mail need not wait for it."""
        self._process.begin(_nothing, None, 60.0, self._state)

    def of(self, alert: Alert) -> tuple[Picture, ...]:
        """The pictures of a message; none of one about no glider, nor where they are not there in time."""
        if not alert.glider:
            return ()
        job = PictureJob(self._state, alert.glider, self.attention(alert.glider), self._now(), self._maps)
        making = self._process.begin(self._draw, job, HANGS, self._state)
        if making is None:
            return ()
        try:
            return making.result(self._limit)
        except NotInTime:
            if not making.running():
                making.cancel()  # it waits behind others, and nobody waits for it
            reason = f"not drawn within {self._limit:g} s"
        except Exception as error:  # whatever a drawing does, the mail goes
            reason = str(error) or type(error).__name__
        log.warning("mail goes without pictures", alert=alert.id, glider=alert.glider, reason=reason)
        return ()

    def stop(self) -> None:
        """End the process."""
        self._process.stop()


def _nothing(_job: None) -> None:
    """What the process does to begin."""
