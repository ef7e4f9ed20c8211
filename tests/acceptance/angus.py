"""A dockserver with one glider, angus, who flew for a day: what most tests of the daemon begin with."""

from __future__ import annotations

from pathlib import Path

from acceptance.support import Site, healthy, until
from gliderwatch.simulate.delivery import Arrival, FileForm, Names, arrivals
from gliderwatch.store.state_file import Status

MISSION = healthy(1.0)
FILES = list(arrivals(MISSION))
SHORT = list(arrivals(MISSION, FileForm(Names.SHORT)))


def angus(folder: Path) -> Site:
    """The dockserver with his folder and caches, and him in the configuration; no file of his."""
    site = Site(folder)
    site.caches(MISSION)
    site.folder("angus")
    site.configure("angus")
    return site


def put(site: Site, *files: Arrival, glider: str = "angus") -> list[Path]:
    return [site.put(glider, file.name, file.data) for file in files]


def taken(site: Site, *files: Arrival) -> None:
    """Wait until files are taken."""
    wanted = [Status.TAKEN] * len(files)
    until(lambda: site.statuses(*(f.name for f in files)) == wanted, f"{[f.name for f in files]} taken")


def plenty(site: Site, copies: int = 40) -> int:
    """A backlog that takes a while: the files of many gliders; how many."""
    gliders = [f"angus-{number}" for number in range(copies)]
    # Copies of one glider are no fleet, and what compares them would take longer than all else.
    site.configure(
        "angus", *gliders, defaults={"normal_speed": {"min": 0.2, "max": 0.4}, "neighbours": False}
    )
    for name in gliders:
        for file in FILES:
            data = file.data.replace(b"angus-", f"{name}-".encode())
            site.put(name, file.name.replace("angus", name), data)
    return copies * len(FILES)
