"""What commands show on a terminal: tables that fit it, and alerts as they arrive."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

from rich.console import Console
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from gliderwatch.cli.status import GliderStatus, IncidentEntry, Overview
from gliderwatch.config import Problem
from gliderwatch.export.dives import iso_ms
from gliderwatch.incidents.acknowledgement import Ack
from gliderwatch.incidents.open_threads import OpenThread
from gliderwatch.messages import irregularity_text
from gliderwatch.messages.formatting import clean, duration, place, utc
from gliderwatch.model import Alert, Assessment, Flag, Incident, Kind, Severity
from gliderwatch.store.relays import RelayState
from gliderwatch.store.state_file import File, Status

# ----------------------------------------
# What commands show on a terminal: tables that fit it.

_FLAGS = {Flag.NORMAL: "[green]0 normal[/]", Flag.ANOMALY: "[bold red]1 anomaly[/]"}
_FALSE = "[yellow]2 measurements disagree[/]"
_STYLES = {Severity.CRITICAL: "bold red", Severity.WARNING: "yellow", Severity.INFO: "cyan"}


def flag(a: Assessment) -> str:
    """A flag in words with its colour, or why there is none."""
    return f"[dim]{_safe(a.reason)}[/]" if a.flag is None else _FLAGS.get(Flag(a.flag), _FALSE)


def _safe(text: str) -> str:
    """Text from files, in which brackets are no markup."""
    return clean(text).replace("[", r"\[")


def _number(value: float | None, form: str = ".2f") -> str:
    return "" if value is None else format(value, form)


def _vector(u: float | None, v: float | None) -> str:
    return "" if u is None or v is None else f"{u:+.2f} {v:+.2f}"


LEGEND = """\
Times are those of the surfacing. h: hours of the dive. speed, ±: through the
water, and its uncertainty; own: what the glider believes; flow: as estimated;
DAC: the current it is compared with; all in m/s, E N: east, north. p_E: how far
flow and DAC differ, 0 to 1."""
"""What the columns of `dives` are."""
WIDE = 10_000
"""Columns of what is no terminal: nothing has to be cut or wrapped."""


def dives(assessments: Sequence[Assessment], *, whole: bool = False) -> Table:
    """The dives of a mission, one a line; 80 columns, for which a long reason is wrapped, unless `whole`."""
    years = sorted({iso_ms(a.t_surface)[:4] for a in assessments})
    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0), header_style="bold")
    for name in (f"{'/'.join(years)} UTC", "h"):
        table.add_column(name, no_wrap=True)
    table.add_column("flag", max_width=None if whole else 14, no_wrap=whole)
    for name in ("speed", "±", "own", "flow E N", "DAC E N", "p_E"):
        table.add_column(name, justify="right", no_wrap=True)
    for a in assessments:
        table.add_row(
            iso_ms(a.t_surface)[5:16].replace("T", " "),
            _number(a.evidence.get("duration_h"), ".1f"),
            flag(a),
            _number(a.speed),
            _number(a.speed_sigma),
            _number(a.evidence.get("along_speed")),
            _vector(a.flow_u, a.flow_v),
            _vector(a.reference_u, a.reference_v),
            _number(a.p_e),
        )
    return table


def show(table: Table, console: Console) -> None:
    """Print a table: it fits a terminal, and is as wide as it needs where there is none."""
    if not console.is_terminal:
        console = Console(file=console.file, width=WIDE)
    console.print(table)


def files(counts: dict[Status, int], left_out: Sequence[File], console: Console, most: int = 20) -> None:
    """What became of files: how many of each status, and why those that were not taken were not.

    Files of one status and reason are shown once.
    """
    console.print("files: " + (", ".join(f"{n} {status}" for status, n in counts.items()) or "none"))
    alike = defaultdict[tuple[Status, str], list[File]](list)
    for file in left_out:
        alike[file.status, file.reason].append(file)
    for (status, reason), same in list(alike.items())[:most]:
        path = clean(same[0].path, 500)
        text = (
            f"{path}: {clean(reason, 2000)}"
            if len(same) == 1
            else f"{len(same)} files: {clean(reason, 2000)}; such as {path}"
        )
        console.print(Text(f"  {status}  {text}"), soft_wrap=True)
    rest = sum(len(same) for same in list(alike.values())[most:])
    if rest:
        console.print(f"  and {rest} more")


def status(view: Overview, console: Console) -> None:
    """The overview of a running service."""
    silent = "never" if view.silent_for is None else f"{view.silent_for:.0f} s ago"
    state = "[green]alive[/]" if view.alive else "[bold red]NOT RUNNING[/]"
    console.print(f"gliderwatch is {state} (last sign of life: {silent})")
    table = Table(box=None, pad_edge=False, header_style="bold")
    for name in ("glider", "surfaced UTC", "lat lon"):
        table.add_column(name, no_wrap=True)
    table.add_column("flag", no_wrap=not console.is_terminal)
    for name in ("speed", "range", "dives"):
        table.add_column(name, justify="right", no_wrap=True)
    for glider in view.gliders:
        table.add_row(*_glider(glider))
    show(table, console)
    for glider in view.gliders:
        for style, text in _next(glider):
            console.print(Text(text, style=style))
    for glider in view.gliders:
        for i in glider.incidents:
            ack = glider.acks.get(i.id)
            text = f"{clean(i.glider)}: {i.kind} open since {utc(i.since)}, {i.dives} dives"
            taken_on = "" if ack is None else f", {acknowledged(ack, i)}"
            console.print(Text(text + taken_on, style=_STYLES[i.severity]))
    for glider in view.gliders:
        _of_files_and_calls(glider, console)
    files(view.files, [*view.waiting, *view.quarantined], console)
    for name, link in view.links.items():
        text = f"{clean(name, 30)}: {clean(str(link), 600)} ({clean(link.cure, 600)})"
        console.print(Text(text, style="bold red"), soft_wrap=True)
    if view.unknown:
        names = ", ".join(clean(g) for g in sorted({f.glider for f in view.unknown}))
        console.print(
            Text(f"gliders not in the configuration: {names} ({len(view.unknown)} files left alone)")
        )
    if view.relays is not None:
        _relays(view.relays, console)
    _messages(view, console)


def _relays(relays: RelayState, console: Console) -> None:
    """How the exchange with other dockservers stands."""
    link = relays.link
    if link is None:
        console.print("relays: not connected yet")
        return
    state = "connected to" if link.is_up else "NOT CONNECTED to"
    why = f" ({clean(link.error)})" if link.error else ""
    text = (
        f"relays: {clean(link.name)} is {state} {clean(link.broker)} since {utc(relays.t)}{why}; "
        f"{relays.waiting} batches to send"
    )
    console.print(Text(text, style="" if link.is_up and not why else "yellow"), soft_wrap=True)
    for name, (t, other) in relays.others.items():
        held = ", ".join(f"{n} batches of {clean(field)}" for field, n in other.batches.items()) or "no batch"
        apart = f"; not exchanged: {clean(', '.join(other.apart))}" if other.apart else ""
        text = f"  {clean(name)}, heard of {utc(t)}: {held}{apart}"
        console.print(Text(text, style="yellow" if apart else ""), soft_wrap=True)


def _of_files_and_calls(glider: GliderStatus, console: Console) -> None:
    """What goes on beside incidents of dives, and what is wrong with the glider's files."""
    name = glider.name
    lines = [
        (_STYLES[t.severity], f"{name}: {t.kind} since {utc(t.since)}: {t.about}") for t in glider.threads
    ]
    if (call := glider.call) is not None and call.fix is not None:
        bound = "" if call.waypoint is None else f", bound for {place(*call.waypoint)}"
        because = f", at the surface because {call.reason}" if call.reason else ""
        where = f"{name}: at {place(call.fix.lat, call.fix.lon)} by its call of {utc(call.last_t)}"
        lines.append(("", where + bound + because))
    lines += [
        ("yellow", f"{name}: {file} was announced in the call of {utc(t)} and never came")
        for t, file in glider.not_come
    ]
    lines += [
        ("yellow", f"since {utc(each.t)}: {irregularity_text.title(each)}") for each in glider.irregularities
    ]
    for style, text in lines:
        console.print(Text(clean(text), style=style), soft_wrap=True)


def _messages(view: Overview, console: Console) -> None:
    """What is held, and what no channel took."""
    for u in view.held:
        until = f"{utc(u.held_until)}{', unless acknowledged' if u.escalates else ' (quiet hours)'}"
        console.print(Text(f"held until {until}: {clean(u.alert)} by {u.channel}"), soft_wrap=True)
    for u in view.undelivered:
        why = f": {clean(u.error)}" if u.error else ""
        console.print(Text(f"undelivered: {clean(u.alert)} by {u.channel}, {u.attempts} attempts{why}"))


def _glider(g: GliderStatus) -> list[str]:
    name = _safe(g.name) if g.configured else f"[dim]{_safe(g.name)}[/]"
    a = g.latest
    if a is None:
        return [name, "[dim]no dive yet[/]", "", "", "", "", str(g.dives)]
    where = "" if a.lat is None or a.lon is None else f"{a.lat:.4f} {a.lon:.4f}"
    speeds = f"{a.speed_min:.2f}-{a.speed_max:.2f}"
    return [
        name,
        iso_ms(a.t_surface)[2:16].replace("T", " "),
        where,
        flag(a),
        _number(a.speed),
        speeds,
        str(g.dives),
    ]


def _next(g: GliderStatus) -> list[tuple[str, str]]:
    """The next surfacing of a glider, or its silence, and why nobody may be notified: style and text."""
    name, call, lines = clean(g.name, 30), g.awaited, list[tuple[str, str]]()
    if g.attention.recovered:
        return [("dim", f"{name}: recovered, nothing is told of it")]
    if g.is_muted and g.attention.muted_until is not None:
        lines = [("dim", f"{name}: muted until {utc(g.attention.muted_until)}")]
    if not g.configured:
        return lines
    if call is None:
        why = "no dive yet" if g.latest is None else "its next surfacing cannot be said yet"
        return [*lines, ("dim", f"{name}: not missed while it is silent, {why}")]
    if g.is_over:
        return [*lines, ("dim", f"{name}: last heard {utc(call.last_sign)}, its deployment seems over")]
    silent = duration(g.at - call.last_sign)
    if g.overdue_since is not None:
        text = f"{name}: OVERDUE since {utc(g.overdue_since)}, silent for {silent}"
        return [*lines, ("bold red", text)]
    late = f", {duration(g.at - call.t)} late" if g.at > call.t else ""
    where = "" if g.place is None else f" near {g.place[0]:.3f} {g.place[1]:.3f}"
    return [*lines, ("yellow" if late else "", f"{name}: next surfacing {utc(call.t)}{where}{late}")]


def acknowledged(ack: Ack, incident: Incident) -> str:
    """Who took an incident on, in words."""
    worse = "" if ack.holds(incident) else ", WORSE SINCE"
    note = f": {clean(ack.note)}" if ack.note else ""
    return f"acknowledged by {clean(ack.by, 40)}{worse}{note}"


def incidents(found: Sequence[IncidentEntry], console: Console) -> None:
    """Incidents, a few lines each: the id, since when, how bad, and who has taken it on; 80 columns."""
    for noted in found:
        i, ack = noted.incident, noted.ack
        if isinstance(i, OpenThread):
            console.print(Text(clean(i.id), style=_STYLES[i.severity]), soft_wrap=True)
            console.print(Text(f"  {i.kind}, {i.severity.name.lower()}, open"))
            console.print(Text(f"  since {utc(i.since)}: {clean(i.about)}"), soft_wrap=True)
            if ack is not None:
                worse = "" if noted.is_quiet else ", WORSE SINCE"
                note = f": {clean(ack.note)}" if ack.note else ""
                console.print(Text(f"  acknowledged by {clean(ack.by, 40)}{worse}{note}, {utc(ack.at)}"))
            continue
        over = "open" if i.cleared_at is None else f"cleared {utc(i.cleared_at)}"
        style = "dim" if i.cleared_at is not None else _STYLES[i.severity]
        console.print(Text(clean(i.id), style=style), soft_wrap=True)
        console.print(Text(f"  {i.kind}, {i.severity.name.lower()}, {over}"))
        console.print(Text(f"  since {utc(i.since)}, {i.dives} dives"))
        console.print(Text(f"  worst {_dive(i.worst)}"))
        console.print(Text(f"  last  {_dive(i.last)}"))
        if ack is not None:
            console.print(Text(f"  {acknowledged(ack, i)}, {utc(ack.at)}"))


def _dive(a: Assessment) -> str:
    speed = "speed unknown" if a.speed is None else f"{a.speed:.2f} m/s"
    error = "" if a.p_e is None else f", p_E {a.p_e:.2f}"
    return f"{utc(a.t_surface)}: {speed} (normal {a.speed_min:.2f}-{a.speed_max:.2f}){error}"


def problems(found: Sequence[Problem], console: Console) -> None:
    """What `check` found, the worst first, each marked for what it is."""
    for p in sorted(found, key=lambda p: p.severity):
        text = Text(f"{clean(p.where, 500)}: ")
        text.append(f"{p.severity}: ", style="bold red" if p.severity == "error" else "yellow")
        text.append(clean(p.text + (f" ({p.cure})" if p.cure else ""), 2000))
        console.print(text, soft_wrap=True)


# ----------------------------------------
# Alerts on a terminal, for replay and demo.

_STYLE = {Severity.INFO: "cyan", Severity.WARNING: "yellow", Severity.CRITICAL: "bold red"}


def show_alert(alert: Alert, console: Console) -> None:
    """Print an alert in a frame: title, what and how bad, what to do, the map; not its numbers and remarks.

    Texts are printed as they are: brackets in a name are no markup.
    """
    style = "green" if alert.kind is Kind.ALL_CLEAR else _STYLE[alert.severity]
    blocks = alert.body.strip().split("\n\n")
    maps = [line for line in alert.body.splitlines() if line.startswith("Map: ")]
    console.print(
        Panel(
            Text("\n\n".join([*blocks[:2], *maps])),
            title=Text(alert.title, style=style),
            subtitle=Text(f"{utc(alert.time)}  {alert.kind}", style="dim"),
            title_align="left",
            subtitle_align="right",
            border_style=style,
        )
    )
