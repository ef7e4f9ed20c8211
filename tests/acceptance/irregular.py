"""Files that are wrong though the glider is well: its clock fell, a name is used twice, two have one name."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from acceptance.support import Daemon, Mail, Site, command, lines, mail_server, until
from clocks import WEEKS, files_with_clock_set
from gliderwatch.simulate.delivery import FileForm, Names, arrivals
from gliderwatch.simulate.flight import Point
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Mission, Scenario

DAY = 86400.0
GLIDER = "dora"
LAST = 4
"""Segments that come after the clock fell."""


@dataclass(frozen=True)
class Case:
    """A mission that ends at about now, and its files as they come: name and content."""

    mission: Mission
    files: list[tuple[str, bytes]]


def healthy(days: float = 3.0, **changes: object) -> Mission:
    """A mission that ends at about now."""
    return simulate(Scenario(seed=8, glider=GLIDER, days=days, start=time.time() - days * DAY, **changes))


def clock_fallen(seconds: float = WEEKS) -> Case:
    """Its clock falls back before the `LAST` segments."""
    flown = healthy()
    mission = files_with_clock_set(flown, len(flown.segments) - LAST, -seconds)
    return Case(mission, [(a.name, a.data) for a in arrivals(mission)])


def names_twice() -> Case:
    """Its mission counter begins again at 0 after half of the mission: the later files have 8.3 names."""
    mission = healthy()
    half = len(mission.segments) // 2
    names = [s.header.full_name for s in mission.segments]
    again = [
        replace(s, header=replace(s.header, full_name=name))
        for s, name in zip(mission.segments[half:], names, strict=False)
    ]
    mission = replace(mission, segments=(*mission.segments[:half], *again))
    files = [(a.name, a.data) for a in arrivals(mission)]
    return Case(
        mission, [*files[:half], *((f"0099{k:04d}.sbd", data) for k, (_, data) in enumerate(files[half:]))]
    )


def two_gliders() -> Case:
    """The files of a second one, 550 km away, come under its name."""
    mission = healthy(1.5)
    there = {"place": Point(24.5, -80.0), "waypoints": (Point(24.9, -80.3),), "mission_number": 7}
    start = mission.scenario.start + 1800.0
    other = simulate(replace(mission.scenario, seed=9, start=start, **there))
    files = [(a.time, a.name, a.data) for a in arrivals(mission)]
    files += [(a.time, a.name, a.data) for a in arrivals(other, FileForm(Names.SHORT))]
    return Case(mission, [file[1:] for file in sorted(files)])


@dataclass(frozen=True)
class Said:
    """What was said: mails, `status` and its JSON; of a replay its output and the titles of its alerts."""

    mails: list[Mail]
    status: str
    details: dict[str, object]
    replayed: str
    titles: list[str]


def said(case: Case, folder: Path) -> Said:
    """A live run, in which the files come one after another, and a replay of the same files."""
    site = Site(folder)
    site.caches(case.mission)
    with mail_server() as box:
        site.configure(GLIDER, url=box.url, defaults={"overdue_hours": 96})
        with Daemon(site):
            for n, (name, data) in enumerate(case.files, 1):
                site.put(GLIDER, name, data)
                until(lambda n=n: len(site.files()) == n, f"{n} files are known")
            until(lambda: not site.undelivered(), "all is delivered")
            status = command("status", "-c", site.config, COLUMNS="100").stdout
            details = site.status()
        mails = list(box.mails)
    out = folder / "out"
    replayed = command("run", "--replay", site.root, "-c", site.config, "--out", out, COLUMNS="100")
    titles = [line["title"] for line in lines(out / "alerts.jsonl")]
    return Said(mails, status, details, replayed.stdout + replayed.stderr, titles)


def about_files(titles: Iterator[str] | list[str]) -> list[str]:
    """Those of messages about files that are wrong."""
    return [t.strip() for t in titles if any(f" {word} " in t for word in ("CLOCK", "TWO GLIDERS"))]
