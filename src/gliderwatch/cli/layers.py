"""The commands `gliderwatch layers`. What they need is imported when they run; others need not wait."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gliderwatch.cli.options import Number
from gliderwatch.errors import GliderwatchError
from gliderwatch.model import Segment, SegmentId

if TYPE_CHECKING:
    from gliderwatch.layers.casts import Cast
    from gliderwatch.papers.seeking_vehicle import Preset, Run

_NOISE = 0.002
"""°C: noise of a CTD of today (SBE 49: 0.002)."""
_AFTER_JUMP = 3000.0
"""s: how long the loop goes on after a jump: a reset and four periods, or the gain's way over 3 m."""
_FOUND = 0.95
"""A leg that covers this part of the layers has found them."""


@click.group()
def layers() -> None:
    """Layers of the sea, and how deep to fly to keep on them."""


@layers.command(epilog="\b\nExample:\n  gliderwatch layers simulate --preset simulation --out figures")
@click.option("--preset", "name", type=click.Choice(["simulation", "field"]), default="simulation")
@click.option("--seed", type=click.IntRange(0), default=0, help="Chance of its own for each seed (0).")
@click.option(
    "--jump",
    type=Number(-50, 50),
    help="At its end the layers jump down by so many m, and it goes on 3000 s.",
)
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path(),
    help="Folder for the figure (here).",
)
@click.option("--json", "as_json", is_flag=True, help="Numbers as JSON.")
def simulate(name: str, seed: int, jump: float | None, out: Path, as_json: bool) -> None:
    """Run the loop of paper 004 again, and draw its depth and temperature.

    The preset simulation is that of Table 1 (Figs. 7 and 8), field that of Table 2 (Figs. 9 and 10). Below a
    jump the water is deeper by as much.
    """
    import numpy as np

    from gliderwatch.papers.seeking_vehicle import PRESETS, fly

    preset = PRESETS[name]
    by, at = jump or 0.0, preset.seconds
    water = replace(preset.water, bottom=preset.water.bottom + max(by, 0.0))
    steps = round((at if jump is None else at + _AFTER_JUMP) / preset.params.dt)
    noise = np.random.default_rng(seed).normal(0.0, _NOISE, steps)
    run = fly(preset.params, water, noise, lambda t: by if t >= at else 0.0)
    path = out / f"layers-{name}.svg"
    found = _summary(preset, run, preset.seconds)
    if jump is not None:
        found |= _after_jump(run, water.layers, jump, at)
    found |= {"resets": run.resets, "figure": str(path)}
    out.mkdir(parents=True, exist_ok=True)
    _draw(path, preset, run)
    if as_json:
        click.echo(json.dumps(found, indent=2))
        return
    for key, value in found.items():
        click.echo(f"{key.replace('_', ' ')}: {value}")


@layers.command(epilog="\b\nExample:\n  gliderwatch layers replay data/electa-2022/from-glider")
@click.argument("mission", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option(
    "--cache",
    "caches",
    multiple=True,
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="A folder of cache files (MISSION, and the folder `cache` in it or beside it).",
)
@click.option("--glider", help="Of several gliders in the folder, this one.")
@click.option(
    "--sensor",
    default="temperature",
    help="temperature, salinity, density, oxygen, or the name of a science sensor (temperature).",
)
@click.option("--json", "as_json", is_flag=True, help="Segments and means as JSON.")
def replay(mission: Path, caches: tuple[Path, ...], glider: str | None, sensor: str, as_json: bool) -> None:
    """Fly the advised bands through the water that a mission recorded.

    What is outside a band is not seen by its method. Coverage is the part of the gradient above a quarter of
    its peak that the casts went through, travel their part of the way of full casts.
    """
    from gliderwatch.layers import flown
    from gliderwatch.layers.constants import COUNTED

    casts = _casts(mission, caches or _near(mission), glider, sensor)
    found = flown.compare(casts, sensor)
    if not found["full yos"]:
        raise GliderwatchError(f"{mission} holds no segment with {COUNTED} casts of {sensor}")
    totals = {name: flown.total(segments) for name, segments in found.items()}
    if as_json:
        means = {name: asdict(one) for name, one in totals.items()}
        flights = {name: [asdict(one) for one in segments] for name, segments in found.items()}
        click.echo(json.dumps({"means": means, "segments": flights}, indent=2))
        return
    click.echo(f"{'method':<32}{'coverage':>9}{'travel':>8}{'segments':>10}{'complete':>10}")
    for name, one in totals.items():
        click.echo(f"{name:<32}{one.coverage:>9.2f}{one.travel:>8.2f}{one.segments:>10}{one.complete:>10}")


def _near(mission: Path) -> tuple[Path, ...]:
    """Where cache files are, if nobody says it."""
    return (mission, *(p for p in (mission / "cache", mission.parent / "cache") if p.is_dir()))


def _casts(mission: Path, caches: Sequence[Path], glider: str | None, sensor: str) -> list[tuple[Cast, ...]]:
    """The casts of each segment of one glider in a folder, in order of time; of copies the fullest."""
    from gliderwatch.layers.casts import casts_of, is_own
    from gliderwatch.slocum import folders
    from gliderwatch.slocum.decode import Decoder, decode_science

    paths = sorted(path for path in mission.rglob("*") if folders.is_science(path.name))
    own = [sensor] if is_own(sensor) else []
    best: dict[SegmentId, Segment] = {}
    with Decoder(caches, decode=partial(decode_science, science=own)) as decoder:
        for path, result in decoder.map(paths):
            if not isinstance(result, Segment):
                click.echo(f"{path.name} left out: {result}", err=True)
            elif result.id not in best or best[result.id].completeness < result.completeness:
                best[result.id] = result
    gliders = {one.glider for one in best} if glider is None else {glider}
    if len(gliders) > 1:
        raise GliderwatchError(f"{mission} holds several gliders: --glider {' or '.join(sorted(gliders))}")
    chosen = [best[one] for one in sorted(best) if one.glider in gliders]
    return [casts_of(one, sensor) for one in chosen]


def _summary(preset: Preset, run: Run, until: float) -> dict[str, Any]:
    """What the run did from four periods after the loop began `until` a time (s)."""
    from gliderwatch.papers.extremum_seeking import reach
    from gliderwatch.papers.seeking_vehicle import coverage, outside

    run = run.until(until)
    tracked = run.t[run.tracking > 0]
    if not len(tracked):
        return {"began": None}
    settled = float(tracked[0]) + 4 * preset.params.period
    covered = coverage(run, preset.water.layers, settled)
    return {
        "began_s": round(float(tracked[0]), 1),
        "began_m": round(float(run.depth[run.t == tracked[0]][0]), 1),
        "height_of_band_m": round(reach(preset.params), 2),
        "legs": len(covered),
        "coverage_mean": round(sum(covered) / len(covered), 3),
        "coverage_least": round(min(covered), 3),
        "travel_outside_layers": round(outside(run, preset.water.layers, settled), 3),
    }


def _after_jump(run: Run, layers: tuple[tuple[float, float], ...], jump: float, at: float) -> dict[str, Any]:
    """What the run did from the time `at` (s) on, when its `layers` (m) had jumped down by `jump` (m)."""
    from gliderwatch.papers.seeking_vehicle import coverage, legs

    moved = tuple((top + jump, bottom + jump) for top, bottom in layers)
    covered, ways = coverage(run, moved, at), legs(run, at)
    lost = [i for i, part in enumerate(covered) if part < _FOUND]
    again = ways[lost[-1] + 1][0] if lost and lost[-1] + 1 < len(ways) else None
    return {
        "jump_m": jump,
        "coverage_after_jump": round(covered[1], 3),
        "found_again_after_s": None if again is None else round(float(run.t[again]) - at),
        "coverage_at_end": round(covered[-1], 3),
    }


def _draw(path: Path, preset: Preset, run: Run) -> None:
    """Depth against value, and both against time, as the figures of 004 have them."""
    from gliderwatch.figures.plots import as_svg, library

    figure = library().figure.Figure(figsize=(14, 4.5), layout="constrained")
    profile, way, series = figure.subplots(1, 3)
    step = max(len(run.t) // 2000, 1)
    t, depth, value = run.t[::step], run.depth[::step], run.measured[::step]
    tracking = run.tracking[::step] > 0
    profile.scatter(value[~tracking], depth[~tracking], s=4, color="#c4572e", label="complete dive")
    profile.scatter(value[tracking], depth[tracking], s=4, color="#1f5f8b", label="on the layer")
    way.plot(t, depth, color="#1f5f8b", lw=1)
    for top, bottom in preset.water.layers:
        for axes in (profile, way):
            axes.axhspan(top, bottom, color="#a08a2c", alpha=0.2)
    series.plot(t, value, color="#c4572e", lw=1)
    profile.set(xlabel="temperature (°C)", ylabel="depth (m)")
    way.set(xlabel="time (s)", ylabel="depth (m)")
    series.set(xlabel="time (s)", ylabel="temperature (°C)")
    for axes in (profile, way):
        axes.invert_yaxis()
    profile.legend(loc="lower right")
    path.write_text(as_svg(figure), encoding="utf-8")
