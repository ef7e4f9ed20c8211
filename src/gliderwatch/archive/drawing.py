"""The figures of a hindcast, those of paper 000, and the numbers in them as NetCDF."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np

from gliderwatch import __version__
from gliderwatch.archive import delayed
from gliderwatch.archive.along import Along
from gliderwatch.archive.hindcast import Evidence, Replayed
from gliderwatch.archive.spells import Spell
from gliderwatch.errors import GliderwatchError
from gliderwatch.export.netcdf import SINCE
from gliderwatch.figures import coast, dives, plots
from gliderwatch.figures.plots import Line, Panel
from gliderwatch.messages.formatting import utc
from gliderwatch.model import Array
from gliderwatch.navigation.geodesy import displacement, from_plane
from gliderwatch.navigation.track import mean_heading
from gliderwatch.sea.smoother import Currents

TRACK = "Track"
"""Name of the figure that is no panel over time."""
_RING = [(np.cos(a), np.sin(a)) for a in np.linspace(0, 2 * np.pi, 73)]
"""A circle: a basis function is drawn by its width."""


def panels(evidence: Evidence) -> list[Panel]:
    """The panels over time: how far the track is off, CLLE, speed and flow, what corroborates; the same of
    the files as sent, where there are full ones too; currents in delayed mode, what was measured around each
    flag."""
    best, sent = evidence.best, evidence.online
    made = [_off(best), *_law(best), *dives.panels(best.assessments)]
    if sent is not None and sent is not best:
        some = [_off(sent), *_law(sent), dives.speed(sent.assessments), *dives.flow(sent.assessments)]
        made += [replace(panel, name=f"{panel.name}, as sent") for panel in some if _has_values(panel)]
    if evidence.delayed is not None:
        made += _delayed(evidence)
    return [*made, *(panel for spell in evidence.spells for panel in _around(spell))]


def _has_values(panel: Panel) -> bool:
    return any(np.isfinite(line.v).any() for line in panel.lines)


def _off(made: Replayed) -> Panel:
    t, fixes, led = track(made)
    off = np.array([np.hypot(*displacement(*a, *b)) for a, b in zip(led, fixes, strict=True)])
    shows = (
        "How far from each surfacing speed and flow as estimated would have led the glider, from the fix "
        "before the dive and on the headings that it measured."
    )
    lines = (Line("of the dive", t, off),)
    return Panel("Error of the track", "error (m)", shows, lines, zero=True)


def _law(made: Replayed) -> list[Panel]:
    """The law of the papers between surfacings too (Figs. 5, 6 and 7 of 000)."""
    law = made.along
    return [] if law is None else [_clle(law), _learnt_speed(made, law), *_learnt_flow(made, law)]


def _clle(law: Along) -> Panel:
    shows = (
        "The controlled Lagrangian localisation error: how far the learnt trajectory is from that of the "
        "glider. Near 0 when speed and flow explain it."
    )
    lines = tuple(Line(way, law.t, law.error[:, i]) for i, way in enumerate(("east", "north")))
    return Panel("CLLE", "error (m)", shows, lines)


def _learnt_speed(made: Replayed, law: Along) -> Panel:
    outs = np.array([one.out for one in made.judged.incidents if one.out is not None])
    shows = (
        "Speed through the water as it is learnt along the track, between surfacings too, against its normal "
        "range (shaded). Marked is since when it was out of that, where an incident followed."
    )
    return Panel(
        "Speed along the track",
        "speed (m/s)",
        shows,
        (Line("learnt", law.t, law.speed),),
        (law.t, law.low, law.high),
        (("out of range", outs, np.interp(outs, law.t, law.speed)),),
        zero=True,
    )


def _learnt_flow(made: Replayed, law: Along) -> Iterator[Panel]:
    some = [
        (d.t_surface, d.reference_u, d.reference_v)
        for d in made.assessments
        if d.reference_u is not None and d.reference_v is not None
    ]
    t, *reported = np.array(some, dtype=float).reshape(-1, 3).T
    for i, way in enumerate(("east", "north")):
        lines = (Line("learnt", law.t, law.flow[:, i]), Line("reported", t, reported[i]))
        shows = f"The current to the {way} as it is learnt along the track, and as the glider reported it."
        yield Panel(f"Current to the {way} along the track", f"{way} (m/s)", shows, lines)


_UNITS = {
    "roll": ("roll (degrees)", np.degrees(1.0)),
    "pitch": ("pitch (degrees)", np.degrees(1.0)),
    "heading": ("heading (degrees)", np.degrees(1.0)),
    "ballast": ("volume (cm³)", 1e6),
    "depth": ("depth (m)", 1.0),
}


def _around(spell: Spell) -> Iterator[Panel]:
    """What was measured around a flag, a panel a quantity."""
    flag = dives.FLAGS[spell.flag]
    for name, series in spell.samples.items():
        unit, factor = _UNITS[name]
        shows = (
            f"The {name} that the glider measured, from a day before to a day after the dive that began at "
            f"{utc(spell.since)}, the first flagged: {flag}."
        )
        line = Line("measured", series.t, series.v * factor, joined=name != "heading")
        marks = [(flag, np.array([spell.since]))]
        if spell.onset is not None:
            shows += f" Depth rate, pitch and roll changed at {utc(spell.onset.t)}."
            marks.append(("began", np.array([spell.onset.t])))
        title = f"{name.capitalize()} around {utc(spell.since)}"
        marked = tuple((words, at, np.interp(at, line.t, line.v)) for words, at in marks)
        yield Panel(title, unit, shows, (line,), marked=marked, down=name == "depth")


def _delayed(evidence: Evidence) -> list[Panel]:
    assert evidence.delayed is not None
    found, made = evidence.delayed.delayed, []
    t = np.array([(one.start + one.end) / 2 for one in evidence.measured])
    for i, way in enumerate(("east", "north")):
        lines = (
            Line("current", found.t, found.total[:, i]),
            Line("residual", found.t, found.residual[:, i]),
            Line("tide", found.t, found.tide[:, i]),
            Line("mean of a dive", t, np.array([one.current[i] for one in evidence.measured]), joined=False),
        )
        shows = (
            f"The instantaneous current to the {way} in delayed mode, by all dives before and after, its "
            "tide and its residual, and what each dive measured."
        )
        made.append(Panel(f"Delayed mode, {way}", f"{way} (m/s)", shows, lines))
    return [*made, _delayed_speed(evidence, found)]


def _delayed_speed(evidence: Evidence, found: Currents) -> Panel:
    at, speed = delayed.speeds(evidence.best.dives, found)
    some = [(d.t_surface, d.speed) for d in evidence.best.assessments if d.speed is not None]
    then, online = np.array(some, dtype=float).reshape(-1, 2).T
    shows = (
        "Speed through the water in delayed mode: what the currents of the whole mission leave of the ground "
        "velocity of each dive. Dashed: as it was estimated after the dive."
    )
    lines = (Line("delayed", at, speed), Line("after the dive", then, online))
    return Panel("Delayed mode, speed", "speed (m/s)", shows, lines, zero=True)


def track(made: Replayed) -> tuple[Array, Array, Array]:
    """The surfacings: times (s, (n,)), fixes (degrees, (n, 2): latitude, longitude), and where speed and flow
    as estimated would have led on the headings that were measured, from the fix before ((n, 2), NaN where
    there is no estimate)."""
    found = {one.t_dive: one for one in made.assessments if one.speed is not None}
    rows = list[tuple[float, ...]]()
    for dive in made.dives:
        if dive.track is None or dive.start is None or dive.end is None:
            continue
        one, led = found.get(dive.t_dive), (np.nan, np.nan)
        if one is not None and one.speed is not None and one.flow_u is not None and one.flow_v is not None:
            heading, _ = mean_heading(dive.track)
            ground = np.array([one.flow_u, one.flow_v]) + one.speed * heading
            way = ground * float(dive.track.t[-1] - dive.track.t[0])
            led = from_plane(way, dive.start.lat, dive.start.lon)
        rows.append((dive.end.t, dive.end.lat, dive.end.lon, *map(float, led)))
    columns = np.array(rows).reshape(-1, 5)
    return columns[:, 0], columns[:, 1:3], columns[:, 3:]


def track_figures(evidence: Evidence) -> list[tuple[str, str, Any]]:
    """The maps, by the best files and, where there are both, by those sent: name, what it shows, figure."""
    shows = (
        "Where it surfaced, and where speed and flow as estimated would have led it. Land is grey.",
        "The trajectory of the glider, the one that was learnt, and the basis functions with their width. "
        "Land is grey.",
    )
    out, best = [], evidence.best
    for name, made in ((TRACK, best), (f"{TRACK}, as sent", evidence.online)):
        if made is not None and (made is not best or name == TRACK):
            found = evidence.delayed if made is best else None
            figure = _map(made, evidence.width, found.delayed if found is not None else None)
            out.append((name, shows[made.along is not None], figure))
    return out


def _map(made: Replayed, width: float, currents: Currents | None) -> Any:
    _, fixes, led = track(made)
    figure = plots.library().figure.Figure(figsize=(5.4, 4.6), layout="constrained")
    axis = figure.add_subplot()
    lines: list[tuple[Array, str, int, str]] = [(fixes, "-", 0, "surfacings")]
    if made.along is not None:
        lines = [(made.along.true, "-", 1, "glider"), (made.along.learnt, "--", 0, "learnt")]
    elif currents is not None:
        lines.append((delayed.way(made.dives, currents)[1], ":", 3, "delayed mode"))
    if made.along is None:
        lines.append((led[np.isfinite(led).all(axis=1)], "x", 1, "by the estimate"))
    for places, style, colour, label in lines:
        axis.plot(
            places[:, 1], places[:, 0], style, color=plots.COLOURS[colour], lw=1.1, markersize=3, label=label
        )
    if len(made.centres):
        c = made.centres
        axis.plot(c[:, 1], c[:, 0], "o", color=plots.COLOURS[2], markersize=5, label="basis functions")
        for centre in c:
            ring = np.array([from_plane(width * np.array(way), *centre) for way in _RING])
            axis.plot(ring[:, 1], ring[:, 0], ":", color=plots.COLOURS[2], linewidth=0.8)
    middle = float(np.mean(fixes[:, 0])) if len(fixes) else 0.0
    axis.set_aspect(1 / max(np.cos(np.radians(middle)), 0.1), adjustable="datalim")
    axis.set(xlabel="longitude (degrees)", ylabel="latitude (degrees)")
    axis.ticklabel_format(useOffset=False)
    axis.locator_params(axis="x", nbins=6)
    _coast(axis)
    figure.legend(loc="outside lower center", ncols=4, fontsize=8, frameon=False)
    return figure


def _coast(axis: Any) -> None:
    """Land in the part of the map that is shown."""
    (west, east), (south, north) = axis.get_xlim(), axis.get_ylim()
    high, wide = north - south, east - west  # the equal scale widens what is shown when it is drawn
    box = coast.Box(south - high, north + high, west - wide, east + wide)
    land = plots.library().collections.PolyCollection(
        list(coast.rings_in(coast.world(), box)), color="0.8", linewidth=0, zorder=0
    )
    axis.add_collection(land, autolim=False)


def write_numbers(path: Path, evidence: Evidence, made: Sequence[Panel]) -> None:
    """Write what the figures show, a group a figure. Raises GliderwatchError where it cannot be written."""
    try:
        with netCDF4.Dataset(path, "w") as data:
            data.setncatts({"Conventions": "CF-1.8", "source": f"gliderwatch {__version__}"})
            _places(data.createGroup("track"), evidence.best, evidence)
            if evidence.online is not None and evidence.online is not evidence.best:
                _places(data.createGroup("track_as_sent"), evidence.online, None)
            for panel in made:
                _panel(data.createGroup(_word(panel.name)), panel)
    except (OSError, RuntimeError) as error:
        raise GliderwatchError(f"{path} cannot be written: {error}") from None


def _places(group: netCDF4.Group, made: Replayed, evidence: Evidence | None) -> None:
    """Where the glider was and the estimate led; with the `evidence` also the way in delayed mode."""
    t, fixes, led = track(made)
    lines = {"surfacing": fixes, "estimate": led, "basis_function": made.centres}
    times = {"surfacing": t}
    if made.along is not None:
        lines |= {"glider": made.along.true, "learnt": made.along.learnt}
        times |= {"glider": made.along.t, "learnt": made.along.t}
    if evidence is not None:
        group.setncatts({"basis_function_width": evidence.width, "basis_function_width_units": "m"})
        if evidence.delayed is not None:
            times["delayed"], lines["delayed"] = delayed.way(made.dives, evidence.delayed.delayed)
    for name, values in lines.items():
        group.createDimension(name, len(values))
        for i, (axis, unit) in enumerate((("lat", "degrees_north"), ("lon", "degrees_east"))):
            _put(group, f"{name}_{axis}", name, values[:, i], unit, f"{name} {axis}")
    for name, t in times.items():
        _put(group, f"{name}_time", name, t, SINCE, f"time of {name}")


def _panel(group: netCDF4.Group, panel: Panel) -> None:
    unit = found[1] if (found := re.search(r"\(([^)]*)\)$", panel.unit)) else "1"
    group.setncatts({"title": panel.name, "comment": panel.shows})
    for line in panel.lines:
        name = _word(line.label)
        group.createDimension(name, len(line.t))
        _put(group, f"{name}_time", name, line.t, SINCE, f"time of {line.label}")
        _put(group, name, name, line.v, unit, line.label)
        if line.sigma is not None:
            _put(group, f"{name}_sigma", name, line.sigma, unit, f"standard error of {line.label}")
    if panel.band is not None:
        t, low, high = panel.band
        group.createDimension("normal", len(t))
        for name, values, each in (("time", t, SINCE), ("low", low, unit), ("high", high, unit)):
            _put(group, f"normal_{name}", "normal", values, each, f"normal range, {name}")


def _put(group: netCDF4.Group, name: str, dimension: str, values: Array, unit: str, words: str) -> None:
    variable = group.createVariable(name, "f8", (dimension,), fill_value=np.nan)
    variable.setncatts({"units": unit, "long_name": words})
    variable[:] = values


def _word(name: str) -> str:
    return re.sub(r"\W+", "_", name.lower()).strip("_")
