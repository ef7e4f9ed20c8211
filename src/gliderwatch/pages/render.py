"""Pages as HTML: a function of what they show. Every value is escaped by the templates; a picture is markup
that `figures` made, with its labels escaped. Pure, but for the templates and the coast in the package."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from importlib.resources import files
from math import isfinite
from urllib.parse import quote

from jinja2 import Environment, PackageLoader, StrictUndefined, pass_context
from jinja2.runtime import Context
from markupsafe import Markup

from gliderwatch import __version__
from gliderwatch.figures import chart, dives, plots
from gliderwatch.figures.coast import Land
from gliderwatch.messages import formatting
from gliderwatch.messages.formatting import INCIDENTS, clean, duration, flow, map_link, place, utc
from gliderwatch.model import Assessment, Flag, Kind
from gliderwatch.pages import maps
from gliderwatch.pages.view import GliderView, Verdict, verdict, worst_first

DAY = 86400.0
ROWS = 15
"""Dives in the table of a page."""
TEXT = 12_000
"""Characters of one text (a message, a log) at the most: a page stays small whatever comes."""
MARKED = re.compile(r"abort|error|warning|leak|oddit|emergenc|undervolt|overdepth|GliderDOS", re.IGNORECASE)
"""Lines of a log that are shown first."""
MOST_MARKED = 15


@dataclass(frozen=True, slots=True)
class Frame:
    """When a page was made (s), when the next is ``due`` (s), where news of it come from, if any do, and a
    ``warning`` that stands above all."""

    now: float
    due: float
    live: str = ""
    warning: str = ""


@dataclass(frozen=True, slots=True)
class Fact:
    """A labelled line: with the time until it (s), a link to a map, or a picture."""

    label: str
    text: str
    t: float | None = None
    link: str = ""
    picture: Markup | None = None


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


def _href(file: str) -> str:
    return file.replace("%", "%25")


def fleet_page(views: tuple[GliderView, ...], frame: Frame, land: Land) -> str:
    """The page of all gliders, the worst first."""
    ranked = worst_first(views)
    links = {view.name: _href(file_of(view.name)) for view, _ in ranked}
    cards = [
        {"name": clean(v.name, 40), "verdict": f, "link": links[v.name], "facts": _short(v)}
        for v, f in ranked
    ]
    picture = Markup(chart.svg(maps.of_fleet(ranked, links), land))
    return _render("fleet.html", frame, cards=cards, map=picture, summary=summary([f for _, f in ranked]))


def summary(found: Sequence[Verdict]) -> str:
    """How many gliders need somebody, in words."""
    bad, warn = (sum(v.colour == colour for v in found) for colour in ("bad", "warn"))
    parts = [f"{bad} in trouble"] if bad else []
    parts += [f"{warn} to look at"] if warn else []
    many = f"{len(found)} glider{'' if len(found) == 1 else 's'}"
    return f"{many}: {', '.join(parts)}" if parts else f"{many}, nothing to do"


def glider_page(view: GliderView, frame: Frame, land: Land) -> str:
    """The page of one glider."""
    message, *older = view.alerts or (None,)
    lines = view.log.splitlines()
    marked = [clean(line, 160) for line in lines if MARKED.search(line)][-MOST_MARKED:]
    return _render(
        "glider.html",
        frame,
        name=clean(view.name, 40),
        verdict=verdict(view),
        sheet=_href(file_of(view.name, "-sheet")),
        facts=_facts(view),
        message=message,
        messages=older,
        open=view.open,
        map=Markup(chart.svg(maps.of_glider(view), land)),
        plots=_plots(view.dives),
        calls=tuple(reversed(view.calls[-5:])),
        marked="\n".join(marked),
        log="\n".join(clean(line, 300) for line in lines)[-TEXT:],
        incidents=tuple(reversed(view.incidents))[:ROWS],
        acks=view.acks,
        rows=tuple(reversed(view.dives[-ROWS:])),
    )


def sheet_page(view: GliderView, frame: Frame, land: Land) -> str:
    """One page to print, of the last day of a glider that is known."""
    end = view.now if view.latest is None else min(view.now, view.latest.t_surface + DAY)
    some = tuple(d for d in view.dives if d.t_surface > end - DAY)
    speed = dives.speed(some) if any(d.speed is not None for d in some) else None
    recent = (i for i in view.incidents if i.cleared_at is None or i.cleared_at > end - DAY)
    return _render(
        "sheet.html",
        frame,
        name=clean(view.name, 40),
        verdict=verdict(view),
        page=_href(file_of(view.name)),
        facts=_facts(view),
        day=_day(some),
        map=Markup(chart.svg(maps.of_glider(view), land)),
        plot=None if speed is None else _plot(speed),
        rows=tuple(reversed(some))[:24],
        incidents=tuple(recent),
        acks=view.acks,
    )


def ack_page(frame: Frame, incident: str, recipient: str, told: str) -> str:
    """The page of a link that acknowledges: a button, or what was `told`."""
    return _render("ack.html", frame, incident=incident, recipient=recipient, told=told)


def _day(some: Sequence[Assessment]) -> str:
    flagged = sum(d.flag not in (None, 0) for d in some)
    hours = sum(d.evidence.get("duration_h", 0.0) for d in some)
    return f"{len(some)} dives in 24 h, {hours:.1f} h under water, {flagged} flagged."


def _plots(some: Sequence[Assessment]) -> list[Plot]:
    return [_plot(panel) for panel in dives.panels(some)] if len(some) > 1 else []


def _plot(panel: plots.Panel) -> Plot:
    return Plot(panel.name, panel.shows, Markup(plots.svg(panel)))


# ----------------------------------------
# The facts of a glider, in the order in which a pilot asks for them.


def _short(view: GliderView) -> list[Fact]:
    """Those of its card on the page of the fleet."""
    return [*_incidents(view), *_last_call(view), *_next_call(view), *_last_dive(view), *_muted(view)]


def _last_dive(view: GliderView) -> list[Fact]:
    if view.latest is None:
        return []
    facts = [Fact("Speed", _speed(view.latest), picture=bullet(view.latest))]
    return facts if view.flow is None else [*facts, Fact("Current", flow(*view.flow))]


def _facts(view: GliderView) -> list[Fact]:
    """Those of its own page."""
    now, fix = view.whereabouts(), view.fix
    facts = [*_incidents(view), *_muted(view), *_last_call(view)]
    if fix is not None:
        facts += [
            Fact("Last fix", f"{place(fix.lat, fix.lon)}, {utc(fix.t)}", link=map_link(fix.lat, fix.lon))
        ]
    facts += _next_call(view)
    if now is not None and fix is not None and view.now > fix.t:
        facts += [Fact("Now about", f"{place(now.lat, now.lon)}, 95 % within {now.major / 1000:.1f} km")]
    if view.waypoint is not None:
        facts += [Fact("Waypoint", place(*view.waypoint))]
    return [*facts, *_last_dive(view)]


def _last_call(view: GliderView) -> list[Fact]:
    if view.heard is None:
        return []
    why = clean(view.calls[-1].reason, 80) if view.calls else ""
    return [Fact("Last heard", utc(view.heard) + (f", {why}" if why else ""), view.heard)]


def _next_call(view: GliderView) -> list[Fact]:
    call, e = view.awaited, view.expected
    if call is None or view.is_over or view.attention.recovered:
        return []
    sure = f" ± {duration(1.96 * e.t_sigma)}" if e is not None and e.t == call.t else ""
    facts = [Fact("Next call", f"{utc(call.t)}{sure}", call.t)]
    if e is not None and e.t == call.t and e.lat is not None:
        facts += [Fact("There", place(e.lat, e.lon), link=map_link(e.lat, e.lon))]
    return facts


def _incidents(view: GliderView) -> list[Fact]:
    facts = []
    for i in view.open:
        ack = view.acks.get(i.id)
        who = "nobody has taken it on" if ack is None else f"taken on by {clean(ack.by, 40)}"
        if ack is not None and not ack.holds(i):
            who += ", WORSE SINCE"
        facts.append(Fact("Incident", f"{INCIDENTS.get(i.kind, str(i.kind))} since {utc(i.since)}; {who}"))
    return facts


def _muted(view: GliderView) -> list[Fact]:
    until = view.attention.muted_until
    return [Fact("Muted", f"until {utc(until)}")] if until is not None and until > view.now else []


def _speed(dive: Assessment) -> str:
    sigma = dive.evidence.get("speed_sigma")
    error = "" if sigma is None else f" ± {sigma:.2f}"
    return f"{formatting.speed(dive.speed)}{error}, normal {dive.speed_min:.2f}-{dive.speed_max:.2f}"


def bullet(dive: Assessment) -> Markup | None:
    """The speed of a dive against its normal range, as a bullet chart."""
    if dive.speed is None or not isfinite(dive.speed):
        return None
    top = 1.25 * max(dive.speed_max, dive.speed, 1e-3)
    low, high, at = (200 * max(x, 0.0) / top for x in (dive.speed_min, dive.speed_max, dive.speed))
    is_out = not dive.speed_min <= dive.speed <= dive.speed_max
    colour = "bad" if is_out else "ok"
    sigma = 200 * dive.evidence.get("speed_sigma", 0.0) / top
    label = f"{dive.speed:.2f} m/s of {dive.speed_min:.2f} to {dive.speed_max:.2f}"
    return Markup(
        '<svg class="bullet" viewBox="0 0 200 14" role="img" aria-label="{label}">'
        '<rect class="range" x="{low:.1f}" y="1" width="{width:.1f}" height="12"/>'
        '<rect class="{colour}" x="0" y="5" width="{at:.1f}" height="4"/>'
        '<rect class="{colour}" x="{left:.1f}" y="6.5" width="{both:.1f}" height="1"/></svg>'
    ).format(
        label=label,
        low=low,
        width=high - low,
        colour=colour,
        at=at,
        left=max(at - sigma, 0.0),
        both=2 * sigma,
    )


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


def _incident(kind: Kind) -> str:
    return INCIDENTS.get(kind, str(kind))


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
    return part("style.css") + chart.STYLE


def page_policy() -> str:
    """The policy of all pages."""
    return policy([_style()], [part("page.js")])


@pass_context
def _from_now(context: Context, t: float) -> str:
    now: float = context["frame"].now
    apart = duration(abs(t - now))
    return f"{apart} ago" if t < now else f"in {apart}"


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
        utc=utc, clean=clean, flag=_flag, flow=_flow, number=_number, incident=_incident, from_now=_from_now
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
