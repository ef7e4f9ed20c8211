"""The figures of a hindcast, those of paper 000, and the numbers in them as NetCDF."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np

from gliderwatch import __version__
from gliderwatch.archive import delayed
from gliderwatch.archive.hindcast import Evidence
from gliderwatch.archive.spells import Spell
from gliderwatch.errors import GliderwatchError
from gliderwatch.export.netcdf import SINCE
from gliderwatch.figures import dives, plots
from gliderwatch.figures.plots import Line, Panel
from gliderwatch.messages.formatting import utc
from gliderwatch.model import Array, Assessment
from gliderwatch.navigation.geodesy import displacement, from_plane
from gliderwatch.sea.smoother import Currents

TRACK = "Track"
"""Name of the figure that is no panel over time."""
_RING = [(np.cos(a), np.sin(a)) for a in np.linspace(0, 2 * np.pi, 73)]
"""A circle: a basis function is drawn by its width."""


def panels(evidence: Evidence) -> list[Panel]:
    """The panels over time: how far the track is off, CLLE, speed and flow, what corroborates, currents in
    delayed mode, what was measured around each flag."""
    some = evidence.best
    made = [_off(evidence), *_clle(some), *dives.panels(some)]
    if evidence.delayed is not None:
        made += _delayed(evidence)
    return [*made, *(panel for spell in evidence.spells for panel in _around(spell))]


def _off(evidence: Evidence) -> Panel:
    fixes, led = track(evidence)
    off = np.array([np.hypot(*displacement(*a, *b)) for a, b in zip(led, fixes, strict=True)])
    shows = (
        "How far from each surfacing the estimated speed and flow would have led the glider, from the "
        "surfacing before and on the course that it made."
    )
    return Panel(
        "Error of the track", "error (m)", shows, (Line("of the dive", _fixed(evidence), off),), zero=True
    )


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
        at = np.array([spell.since])
        mark = (flag, at, np.interp(at, line.t, line.v))
        title = f"{name.capitalize()} around {utc(spell.since)}"
        yield Panel(title, unit, shows, (line,), marked=(mark,), down=name == "depth")


def _clle(some: Sequence[Assessment]) -> list[Panel]:
    found = [(d.t_surface, d.clle_max) for d in some if d.clle_max is not None]
    if not found:
        return []
    t, v = np.array(found, dtype=float).T
    shows = (
        "The largest controlled Lagrangian localisation error of each dive: how far the learnt trajectory is "
        "from the one flown. It falls as speed and flow are learnt, and rises where either changes."
    )
    return [Panel("CLLE", "error (m)", shows, (Line("largest of the dive", t, v),), zero=True)]


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
    at, speed = delayed.speeds(evidence.dives, found)
    some = [(d.t_surface, d.speed) for d in evidence.best if d.speed is not None]
    then, online = np.array(some, dtype=float).reshape(-1, 2).T
    shows = (
        "Speed through the water in delayed mode: what the currents of the whole mission leave of the ground "
        "velocity of each dive. Dashed: as it was estimated after the dive."
    )
    lines = (Line("delayed", at, speed), Line("after the dive", then, online))
    return Panel("Delayed mode, speed", "speed (m/s)", shows, lines, zero=True)


def _fixed(evidence: Evidence) -> Array:
    """The times (s) of the surfacings that `track` has."""
    return np.array([d.t_surface for d in evidence.best if d.lat is not None and d.lon is not None])


def track(evidence: Evidence) -> tuple[Array, Array]:
    """Fixes (degrees, (n, 2): latitude, longitude) at the surfacings, and where the estimated speed and flow
    would have led from the one before ((n, 2), NaN where there is no estimate)."""
    some = [d for d in evidence.best if d.lat is not None and d.lon is not None]
    fixes = np.array([(d.lat, d.lon) for d in some], dtype=float).reshape(-1, 2)
    led = np.full(fixes.shape, np.nan)
    for i in range(1, len(some)):
        one, before = some[i], some[i - 1]
        if one.speed is None or one.flow_u is None or one.flow_v is None:
            continue
        drift = np.array([one.flow_u, one.flow_v]) * (one.t_surface - before.t_surface)
        # The heading as the ground track and the flow have it: the estimate is of speed and flow alone.
        through = displacement(*fixes[i], *fixes[i - 1]) - drift
        length = float(np.hypot(*through))
        if length > 0:
            way = drift + through / length * one.speed * (one.t_surface - one.t_dive)
            led[i] = from_plane(way, *fixes[i - 1])
    return fixes, led


def track_figure(evidence: Evidence) -> Any:
    """The track with where the estimate leads, and the basis functions of the papers' law."""
    fixes, led = track(evidence)
    figure = plots.library().figure.Figure(figsize=(5.4, 4.6), layout="constrained")
    axis = figure.add_subplot()
    axis.plot(fixes[:, 1], fixes[:, 0], "-", color=plots.COLOURS[0], linewidth=1.2, label="surfacings")
    if evidence.delayed is not None:
        _, places = delayed.way(evidence.dives, evidence.delayed.delayed)
        axis.plot(
            places[:, 1], places[:, 0], "-", color=plots.COLOURS[3], linewidth=0.7, label="delayed mode"
        )
    good = np.isfinite(led).all(axis=1)
    axis.plot(led[good, 1], led[good, 0], "x", color=plots.COLOURS[1], markersize=4, label="by the estimate")
    if len(evidence.centres):
        c = evidence.centres
        axis.plot(c[:, 1], c[:, 0], "o", color=plots.COLOURS[2], markersize=5, label="basis functions")
        for centre in c:
            ring = np.array([from_plane(evidence.width * np.array(way), *centre) for way in _RING])
            axis.plot(ring[:, 1], ring[:, 0], ":", color=plots.COLOURS[2], linewidth=0.8)
    middle = float(np.mean(fixes[:, 0])) if len(fixes) else 0.0
    axis.set_aspect(1 / max(np.cos(np.radians(middle)), 0.1), adjustable="datalim")
    axis.set(xlabel="longitude (degrees)", ylabel="latitude (degrees)")
    axis.legend(fontsize=8, frameon=False)
    return figure


def write_numbers(path: Path, evidence: Evidence, made: Sequence[Panel]) -> None:
    """Write what the figures show, a group a figure. Raises GliderwatchError where it cannot be written."""
    try:
        with netCDF4.Dataset(path, "w") as data:
            data.setncatts({"Conventions": "CF-1.8", "source": f"gliderwatch {__version__}"})
            _places(data.createGroup("track"), evidence)
            for panel in made:
                _panel(data.createGroup(_word(panel.name)), panel)
    except (OSError, RuntimeError) as error:
        raise GliderwatchError(f"{path} cannot be written: {error}") from None


def _places(group: netCDF4.Group, evidence: Evidence) -> None:
    group.setncatts({"basis_function_width": evidence.width, "basis_function_width_units": "m"})
    fixes, led = track(evidence)
    lines = {"surfacing": fixes, "estimate": led, "basis_function": evidence.centres}
    times = {"surfacing": _fixed(evidence)}
    if evidence.delayed is not None:
        times["delayed"], lines["delayed"] = delayed.way(evidence.dives, evidence.delayed.delayed)
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
