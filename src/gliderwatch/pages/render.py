"""Pages as HTML: a function of what they show. Every value is escaped by the templates; a picture is markup
that `figures` made, with its labels escaped. Pure, but for the templates and the coast in the package.

Beside those of the gliders stands the guide, `docs/pilots.md`, with a section for each kind of message."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from urllib.parse import quote

from jinja2 import Environment, PackageLoader, StrictUndefined, pass_context
from jinja2.runtime import Context
from markdown_it import MarkdownIt
from markupsafe import Markup

from gliderwatch import __version__
from gliderwatch.figures import chart, dives, field_svg, health, panel_svg, section_svg, timeline
from gliderwatch.figures.coast import Land
from gliderwatch.figures.plots import Panel
from gliderwatch.figures.timeline import Bar
from gliderwatch.messages.formatting import clean, duration, flow, utc
from gliderwatch.messages.guide import anchor
from gliderwatch.model import Assessment, Flag, Severity
from gliderwatch.pages import facts, fields, maps
from gliderwatch.pages.facts import call_log, transferred
from gliderwatch.pages.fields import FieldView
from gliderwatch.pages.matters import in_words
from gliderwatch.pages.view import GliderView, Verdict, verdict, worst_first

HOUR, DAY = 3600.0, 86400.0
NOTHING: Mapping[str, str] = MappingProxyType({})
ROWS = 15
"""Dives in the table of a page."""
MESSAGES = 8
"""Of the last messages, that a page shows by their titles."""
PAST = 14 * DAY
"""Seconds back that the timeline of the fleet shows."""


@dataclass(frozen=True, slots=True)
class Frame:
    """When a page was made (s), when the next is ``due`` (s), where news of it come from, if any do, and a
    ``warning`` that stands above all."""

    now: float
    due: float
    live: str = ""
    warning: str = ""


@dataclass(frozen=True, slots=True)
class Plot:
    """A panel as it stands in a page."""

    name: str
    shows: str
    svg: Markup


def file_of(glider: str, kind: str = "", ending: str = "html") -> str:
    """The name of a file of a glider: its own, where that can be one.

    >>> file_of("electa"), file_of("unit_1033", "-sheet"), file_of("../a b")
    ('electa.html', 'unit_1033-sheet.html', '%2E%2E%2Fa%20b.html')
    """
    name = glider if re.fullmatch(r"[\w-]+", glider, re.ASCII) else quote(glider, safe="").replace(".", "%2E")
    return f"{'glider-' if name in {'index', 'gliders'} else ''}{name}{kind}.{ending}"


def field_file(name: str) -> str:
    """The name of the page of a field; with a dot, so that it is none of a glider.

    >>> field_file("upper")
    'field.upper.html'
    """
    return f"field.{file_of(name)}"


def href(file: str) -> str:
    """The address of a file beside a page."""
    return file.replace("%", "%25")


def fleet_page(views: tuple[GliderView, ...], frame: Frame, land: Land, seas: Sequence[str] = ()) -> str:
    """The page of all gliders, the worst first, with links to the pages of fields, `seas`."""
    ranked = worst_first(views)
    links = {view.name: href(file_of(view.name)) for view, _ in ranked}
    cards = [
        {
            "name": clean(v.name, 40),
            "verdict": f,
            "since": facts.since(v),
            "link": links[v.name],
            "facts": facts.of_card(v),
        }
        for v, f in ranked
    ]
    picture = Markup(chart.svg(maps.of_fleet(ranked, links), land))
    bars = [bar for view, found in ranked if found.rank >= 0 for bar in _bars(view, by_glider=True)]
    past = Markup(timeline.svg("Timeline of all gliders", bars, frame.now - PAST, frame.now))
    found = summary([f for _, f in ranked])
    values = {"cards": cards, "map": picture, "timeline": past, "summary": found}
    return _render("fleet.html", frame, **values, fields=_links(seas))


def _links(seas: Iterable[str]) -> list[tuple[str, str]]:
    return [(clean(name, 40), href(field_file(name))) for name in seas]


def field_page(view: FieldView, frame: Frame, land: Land) -> str:
    """The page of a field of the sea."""
    plots = [
        Plot(panel.title, shows, Markup(field_svg.svg(panel, land))) for panel, shows in fields.panels(view)
    ]
    return _render("field.html", frame, name=view.name, sentence=fields.sentence(view), plots=plots)


def summary(found: Sequence[Verdict]) -> str:
    """How many gliders need somebody, in words."""
    bad, warn = (sum(v.colour == colour for v in found) for colour in ("bad", "warn"))
    parts = [f"{bad} in trouble"] if bad else []
    parts += [f"{warn} to look at"] if warn else []
    many = f"{len(found)} glider{'' if len(found) == 1 else 's'}"
    return f"{many}: {', '.join(parts)}" if parts else f"{many}, nothing to do"


def glider_page(view: GliderView, frame: Frame, land: Land, take_on: Mapping[str, str] = NOTHING) -> str:
    """The page of one glider; `take_on` has the links by which what goes on can be taken on, by its id, and
    that by which the glider is muted, by its name."""
    return _glider_page(view, frame, _shared(view, land), take_on)


def sheet_page(view: GliderView, frame: Frame, land: Land) -> str:
    """One page to print, of the last day of a glider that is known."""
    return _sheet_page(view, frame, _shared(view, land))


def both_pages(view: GliderView, frame: Frame, land: Land) -> tuple[str, str]:
    """The page of one glider, and that to print; what both show, its map above all, is made once."""
    shared = _shared(view, land)
    return _glider_page(view, frame, shared), _sheet_page(view, frame, shared)


def _shared(view: GliderView, land: Land) -> Mapping[str, object]:
    """What both pages of a glider show."""
    return {
        "name": clean(view.name, 40),
        "verdict": verdict(view),
        "since": facts.since(view),
        "page": href(file_of(view.name)),
        "facts": facts.of_glider(view),
        "message": facts.actions(view),
        "map": Markup(chart.svg(maps.of_glider(view), land)),
    }


def _glider_page(
    view: GliderView, frame: Frame, shared: Mapping[str, object], take_on: Mapping[str, str] = NOTHING
) -> str:
    span = _span(view)
    past = timeline.svg(f"Timeline of {clean(view.name, 40)}", list(_bars(view)), *span)
    return _render(
        "glider.html",
        frame,
        **shared,
        sheet=href(file_of(view.name, "-sheet")),
        fields=_links(field for field, _ in view.advice),
        messages=[facts.message_of(alert) for alert in view.alerts[:MESSAGES]],
        open=[(m, take_on.get(m.id, "")) for m in view.open_matters if m.can_be_taken_on],
        mute=take_on.get(view.name, ""),
        plots=_plots(view, span),
        section=_section(view, span),
        layers=tuple(reversed(view.layers))[:ROWS],
        calls=tuple(reversed(view.calls[-5:])),
        log=call_log(view.log, view.calls[-1] if view.calls else None),
        timeline=Markup(past),
        matters=tuple(reversed(view.matters))[:ROWS],
        rows=tuple(reversed(view.dives[-ROWS:])),
    )


def _sheet_page(view: GliderView, frame: Frame, shared: Mapping[str, object]) -> str:
    end = view.now if view.latest is None else min(view.now, view.latest.t_surface + DAY)
    some = tuple(d for d in view.dives if d.t_surface > end - DAY)
    span = (end - DAY, end)
    drawn = [panel for panel in dives.panels(some)[:1] if panel.name == "Speed"] if len(some) > 1 else []
    return _render(
        "sheet.html",
        frame,
        **shared,
        day=_day(some),
        plots=[_plot(panel, span) for panel in drawn],
        rows=tuple(reversed(some))[:12],
        matters=tuple(m for m in reversed(view.matters) if m.over is None or m.over > end - DAY),
    )


def ack_page(frame: Frame, incident: str, recipient: str, answer: str, *, is_open: bool = True) -> str:
    """The page of a link that acknowledges or mutes: buttons, or the `answer` to one; only the latter where
    the incident is none that can be taken on (`is_open`)."""
    glider = incident.partition("/")[0]
    values = {"what": in_words(incident), "glider": glider, "recipient": recipient, "answer": answer}
    return _render("ack.html", frame, **values, is_open=is_open)


def explore_page(name: str, data: str, now: float) -> str:
    """The page of the plots of a glider to explore, whose values are at `data`; as of `now` (s)."""
    page, style = href(file_of(name)), Markup(_style())
    template = _environment().get_template("explore.html")
    return template.render(name=clean(name, 40), page=page, data=data, now=now, style=style)


def _day(some: Sequence[Assessment]) -> str:
    flagged = sum(d.flag not in (None, 0) for d in some)
    hours = sum(d.evidence.get("duration_h", 0.0) for d in some)
    return f"{len(some)} dives in 24 h, {hours:.1f} h under water, {flagged} flagged."


def _span(view: GliderView) -> tuple[float, float]:
    """The first and the last time (s) of the plots of a glider: the same for all, so that they compare."""
    start = view.dives[0].t_dive if view.dives else view.now - PAST
    return start, max(view.now if not view.is_over else view.last_sign or view.now, start + DAY)


def _plots(view: GliderView, span: tuple[float, float]) -> list[Plot]:
    made = dives.panels(view.dives) if len(view.dives) > 1 else []
    ours = health.panels(view.readings, view.battery, view.calls)
    names = {panel.name for panel in ours}
    panels = [*(panel for panel in made if panel.name not in names), *ours]
    return [plot for panel in panels if (plot := _plot(panel, span)).svg]


def _plot(panel: Panel, span: tuple[float, float]) -> Plot:
    if panel.name == "Battery" and len(panel.lines) > 1:  # it ends in the future
        span = (span[0], max(span[1], float(panel.lines[1].t[-1])))
    return Plot(panel.name, panel.shows, Markup(panel_svg.svg(panel, span)))


def _section(view: GliderView, span: tuple[float, float]) -> Markup:
    """The section along its way, where layers are looked for; over the time of its profiles alone."""
    if view.section is None:
        return Markup("")
    start = max(span[0], float(view.section.t[0]) - 6 * HOUR)
    return Markup(section_svg.svg(view.section, view.layers, start, max(span[1], start + HOUR)))


def _bars(view: GliderView, *, by_glider: bool = False) -> Iterator[Bar]:
    """What needed somebody, as bars of a timeline: a row a glider, or one a kind."""
    for m in view.matters:
        until = "now" if m.over is None else utc(m.over)
        words = f"{clean(view.name, 40)} {m.word}, {utc(m.since)} to {until}"
        row = clean(view.name, 40) if by_glider else m.word
        yield Bar(row, m.since, m.over, "bad" if m.severity is Severity.CRITICAL else "warn", words)


# ----------------------------------------
# Templates.


def _flag(dive: Assessment) -> str:
    if dive.flag is None:
        return clean(dive.reason, 60)
    words = {Flag.NORMAL: "0 normal", Flag.ANOMALY: "1 out of range", Flag.FALSE_ALARM: "2 disagrees"}
    return words[Flag(dive.flag)]


def _flow(dive: Assessment) -> str:
    return "" if dive.flow_u is None else flow(dive.flow_u, dive.flow_v)


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"


def part(name: str) -> str:
    """The style or the script that is in every page."""
    return files("gliderwatch.pages").joinpath("templates", name).read_text(encoding="utf-8")


def policy(texts: Iterable[str], scripts: Iterable[str]) -> str:
    """The content security policy of a page of these styles and scripts, and of nothing else."""

    def listed(found: Iterable[str]) -> str:
        return " ".join(f"'sha256-{b64encode(sha256(t.encode()).digest()).decode()}'" for t in found)

    return (
        f"default-src 'none'; style-src {listed(texts)}; script-src {listed(scripts)}; connect-src 'self'; "
        "img-src 'self'; form-action 'self'; base-uri 'none'"
    )


@cache
def _style() -> str:
    return (
        part("style.css")
        + chart.STYLE
        + panel_svg.STYLE
        + timeline.STYLE
        + section_svg.STYLE
        + field_svg.STYLE
    )


def page_policy() -> str:
    """The policy of all pages."""
    return policy([_style()], [part("page.js")])


@pass_context
def _from_now(context: Context, t: float) -> str:
    now: float = context["frame"].now
    apart = duration(abs(t - now))
    return f"{apart} ago" if t < now else f"in {apart}"


@pass_context
def _near(context: Context, t: float) -> str:
    return facts.near(t, context["frame"].now)


@cache
def _environment() -> Environment:
    made = Environment(
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        loader=PackageLoader("gliderwatch.pages"),
    )
    made.filters.update(
        utc=utc,
        clean=clean,
        flag=_flag,
        flow=_flow,
        number=_number,
        from_now=_from_now,
        near=_near,
        files=transferred,
    )
    made.globals.update(
        version=__version__,
        style=Markup(_style()),
        script=Markup(part("page.js")),
        policy=Markup(page_policy()),
    )
    return made


def _render(template: str, frame: Frame, **values: object) -> str:
    return _environment().get_template(template).render(frame=frame, **values)


_PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<title>What to do: gliderwatch</title><style>{style}</style></head>
<body><main class="guide"><p><a href="index.html">All gliders</a></p>
{body}</main></body></html>
"""
_ELSEWHERE = re.compile(r"\[([^\]]+)\]\((?!https?:|#)[^)]*\)")
"""Links to other pages of the documentation, which do not lie here."""


@cache
def guide_page() -> str:
    """The guide as a page; its headings are the targets of the links in messages."""
    style, reader = part("style.css"), MarkdownIt()
    tokens = reader.parse(_ELSEWHERE.sub(r"\1", _path().read_text(encoding="utf-8")))
    for opening, inline in pairwise(tokens):
        if opening.type == "heading_open":
            opening.attrSet("id", anchor(inline.content))
    body = reader.renderer.render(tokens, reader.options, {})
    return _PAGE.format(policy=policy([style], []), style=style, body=body)


def _path() -> Path:
    """Where the guide is: beside this module in a wheel, in `docs/` of a checkout."""
    installed = Path(__file__).with_name("pilots.md")
    return installed if installed.is_file() else Path(__file__).parents[3] / "docs" / "pilots.md"
