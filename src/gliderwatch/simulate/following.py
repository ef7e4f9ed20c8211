"""Gliders that follow the advice: each dives on to the waypoint that the service advised at its surfacing."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from gliderwatch.errors import GliderwatchError
from gliderwatch.simulate.delivery import FileForm, write_mission
from gliderwatch.simulate.flight import Point
from gliderwatch.simulate.glider import Underway
from gliderwatch.simulate.scenario import Mission, Scenario
from gliderwatch.slocum.logs import degrees_of

POLL = 0.05
"""s between two looks for the advice."""


def fly(scenarios: Sequence[Scenario], answer: Callable[[Mission], Point | None]) -> Iterator[Underway]:
    """Fly a fleet, the glider that is at the surface next first; each of them after a dive.

    ``answer`` gets what a glider sent, and says where it is to go (None: on as before).
    Raises GliderwatchError where one cannot fly.
    """
    fleet, end = [Underway(each) for each in scenarios], scenarios[0].start + 86400 * scenarios[0].days
    while (glider := min(fleet, key=lambda each: each.time)).time < end:
        try:
            glider.fly()
        except ValueError as error:
            raise GliderwatchError(f"{glider.glider} cannot fly this scenario: {error}") from None
        waypoint = answer(glider.news())
        if waypoint is not None:
            glider.head_for(waypoint)
        yield glider


def by_files(
    dockserver: Path, cache: Path, advice: Path, form: FileForm, patience: float
) -> Callable[[Mission], Point | None]:
    """What a service answers that watches the dockserver and writes its advice into a folder.

    Who gets none within the ``patience`` (s) flies on as before.
    """

    def answer(sent: Mission) -> Point | None:
        before = _advice(advice, sent.scenario.glider)
        write_mission(dockserver, cache, sent, form)
        deadline = time.monotonic() + patience
        while time.monotonic() < deadline:
            now = _advice(advice, sent.scenario.glider)
            if now is not None and now != before:
                return waypoint_of(now[0].read_text(encoding="ascii"))
            time.sleep(POLL)
        return None

    return answer


def _advice(folder: Path, glider: str) -> tuple[Path, int] | None:
    """The newest file of mission arguments for a glider, and when it was written (ns)."""
    found = [(path, path.stat().st_mtime_ns) for path in folder.glob(f"{glider}-*-goto.ma")]
    return max(found, key=lambda each: each[1], default=None)


def waypoint_of(text: str) -> Point | None:
    """The first waypoint of a file of mission arguments (`goto_list`); None where there is none.

    >>> waypoint_of("<start:waypoints>\\n-7030.0000 4200.0000\\n<end:waypoints>")
    Point(lat=42.0, lon=-70.5)
    """
    found = re.search(r"<start:waypoints>\s*([-\d.]+)\s+([-\d.]+)", text)
    return None if found is None else Point(degrees_of(found[2]), degrees_of(found[1]))
