"""The report of a hindcast: a page, the same on paper, and the numbers of its figures."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from textwrap import wrap
from typing import Any

import msgspec
from jinja2 import PackageLoader, Template
from markupsafe import Markup

from gliderwatch import __version__
from gliderwatch.archive import drawing, hindcast
from gliderwatch.archive.difference import Delay, Found
from gliderwatch.archive.hindcast import Evidence, Hindcast, Judged
from gliderwatch.archive.missions import Mission, local
from gliderwatch.archive.onset import Onset
from gliderwatch.errors import GliderwatchError
from gliderwatch.export import netcdf
from gliderwatch.figures import panel_svg, plots
from gliderwatch.messages.formatting import INCIDENTS, utc
from gliderwatch.messages.template import environment
from gliderwatch.model import Kind
from gliderwatch.service.replay_files import find_files

LINES = 36
"""Lines of text on a page of paper."""
RESULT, PAGE, PAPER, NUMBERS = "hindcast.json", "report.html", "report.pdf", "figures.nc"


def make_in(root: Path, estimator: str, settings: Path | None, mission: Mission) -> Hindcast:
    """Judge a mission again and write its report into a folder of its own below `root`, or read what an
    earlier run wrote of the same.

    `estimator` and `settings` as `hindcast.replays` has them.
    Raises GliderwatchError where nothing can be judged, or a file cannot be written.
    """
    out, chosen = root / mission.name, "" if settings is None else settings.read_text(encoding="utf-8")
    with local(mission.place) as folder:
        files = find_files([folder])
        done = out / f"done-{hindcast.fingerprint(mission, files, estimator, chosen)}"
        result = hindcast.read(out / RESULT)
        if done.exists() and result is not None:
            return result
        replays = hindcast.replays(mission, folder, files, out, estimator, settings)
    found, evidence = hindcast.hindcast(mission, replays)
    try:
        write(out, found, evidence)
        for old in out.glob("done-*"):
            old.unlink()
        done.touch()
    except OSError as error:
        raise GliderwatchError(f"{out} cannot be written: {error.strerror}") from None
    return found


def write(out: Path, found: Hindcast, evidence: Evidence) -> None:
    """Write page, paper, numbers and the result itself."""
    made = drawing.panels(evidence)
    maps = drawing.track_figures(evidence)
    pictures = [
        *((name, shows, Markup(plots.as_svg(figure))) for name, shows, figure in maps),
        *((panel.name, panel.shows, Markup(panel_svg.svg(panel))) for panel in made),
    ]
    page = _page().render(
        found=found,
        kinds=_kinds(found),
        pictures=pictures,
        style=Markup(panel_svg.STYLE),
        version=__version__,
    )
    (out / PAGE).write_text(page, encoding="utf-8")
    for name, _, figure in maps:
        figure.suptitle(name, x=0.02, ha="left", fontsize=10, fontweight="bold")
    paper = [*_cover(found), *(figure for *_, figure in maps), *map(plots.page_figure, made)]
    plots.write_pdf(out / PAPER, f"{found.name}: hindcast", paper)
    drawing.write_numbers(out / NUMBERS, evidence, made)
    assessments = evidence.best.assessments
    placed = [d for d in assessments if d.lat is not None]
    if placed:
        netcdf.write(out / "dives.nc", found.glider, assessments, placed[-1].t_surface)
    partial = out / f"{RESULT}.part"
    partial.write_bytes(msgspec.json.format(msgspec.json.encode(found), indent=2))
    partial.replace(out / RESULT)


def _kinds(found: Hindcast) -> list[tuple[str, Judged]]:
    both = (("as sent", found.online), ("full files", found.full))
    return [(words, judged) for words, judged in both if judged is not None]


def lines(found: Hindcast) -> list[str]:
    """What was found, in lines for a page of paper or a terminal."""
    out = [f"{found.glider}, estimator {found.estimator}"]
    for words, judged in _kinds(found):
        flags = ", ".join(f"{flag}: {n}" for flag, n in judged.flags.items())
        out.append(f"{words}: {judged.dives} dives, {utc(judged.start)} to {utc(judged.end)}; flags {flags}")
        for one in judged.incidents:
            out += [f"  {incident(one.kind)}", *(f"    {line}" for line in _when(one))]
    if found.difference is not None:
        d = found.difference
        out.append(
            f"both kinds of files: {d.dives} dives, differ by {_cm(d.speed)} in speed, "
            f"{_cm(d.current)} in a component of the current"
        )
        out += [f"  {delay(one)}" for one in d.delays]
    if found.delayed is not None:
        out.append(
            f"instantaneous current: standard error {_cm(found.near_real_time)} near real time, "
            f"{_cm(found.delayed)} in delayed mode"
        )
    return out


def _when(one: Found) -> Iterator[str]:
    """When an incident began, was seen and ended, as far as it is known."""
    if one.onset is not None:
        yield f"began {onset(one.onset)}"
    if one.out is not None:
        yield f"speed along the track out of its range since {utc(one.out)}"
    on_shore = "" if one.on_shore is None else f", on shore {utc(one.on_shore)}"
    end = "open at the end" if one.cleared_at is None else f"until {utc(one.cleared_at)}"
    yield f"in the dive from {utc(one.since)}, seen at the surfacing {utc(one.opened_at)}{on_shore}, {end}"


def onset(found: Onset) -> str:
    """When something began, and what shows it."""
    minutes = (found.latest - found.earliest) / 60
    return f"{utc(found.t)} (within {minutes:.0f} min): {'; '.join(step.words for step in found.steps)}"


def delay(one: Delay) -> str:
    """How much later an incident by full files was found by those that were sent."""
    name = incident(one.full.kind)
    if one.sent is None:
        already = "" if one.already is None else f"; they had one open since {utc(one.already)}"
        return f"{name} since {utc(one.full.since)}: not by files as sent{already}"
    assert one.later is not None
    late = f"{abs(one.later):.1f} h {'later' if one.later > 0 else 'earlier'}"
    late = late if abs(one.later) > 0.05 else "at the same surfacing"
    began = "it began" if one.full.onset is not None else "the dive began in which it is first seen"
    return (
        f"{name} since {utc(one.full.since)}: by files as sent {late}; known on shore "
        f"{one.after:.1f} h after {began}"
    )


def incident(kind: str) -> str:
    """The kind of an incident in words."""
    return INCIDENTS.get(Kind(kind), kind)


def _cm(value: float | None) -> str:
    return "unknown" if value is None else f"{100 * value:.1f} cm/s"


def _cover(found: Hindcast) -> list[Any]:
    """What was found, as pages of text."""
    text = [part for line in lines(found) for part in wrap(line, 112, subsequent_indent="      ")]
    pages = [text[i : i + LINES] for i in range(0, len(text), LINES)]
    figures = [plots.library().figure.Figure(figsize=(8.3, 5.8)) for _ in pages]
    for figure, page in zip(figures, pages, strict=True):
        figure.text(0.06, 0.94, found.name, fontsize=16, fontweight="bold", va="top")
        figure.text(0.06, 0.86, "\n".join(page), fontsize=7.5, va="top", family="monospace")
    return figures


@cache
def _page() -> Template:
    made = environment(PackageLoader("gliderwatch.archive"))
    made.filters |= {"utc": utc, "incident": incident, "cm": _cm, "onset": onset, "delay": delay}
    return made.get_template("report.html")
