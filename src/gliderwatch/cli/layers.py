"""The commands `gliderwatch layers`. What they need is imported when they run; others need not wait."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from gliderwatch.papers.seeking_vehicle import Preset, Run

_NOISE = 0.002
"""°C: noise of a CTD of today (SBE 49: 0.002)."""


@click.group()
def layers() -> None:
    """Layers of the sea, and how deep to fly to keep on them."""


@layers.command(epilog="\b\nExample:\n  gliderwatch layers simulate --preset simulation --out figures")
@click.option("--preset", "name", type=click.Choice(["simulation", "field"]), default="simulation")
@click.option("--seed", type=click.IntRange(0), default=0, help="Chance of its own for each seed (0).")
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path(),
    help="Folder for the figure (here).",
)
@click.option("--json", "as_json", is_flag=True, help="Numbers as JSON.")
def simulate(name: str, seed: int, out: Path, as_json: bool) -> None:
    """Run the loop of paper 004 again, and draw its depth and temperature.

    The preset simulation is that of Table 1 (Figs. 7 and 8), field that of Table 2 (Figs. 9 and 10).
    """
    import numpy as np

    from gliderwatch.papers.seeking_vehicle import PRESETS, fly

    preset = PRESETS[name]
    steps = round(preset.seconds / preset.params.dt)
    run = fly(preset.params, preset.water, np.random.default_rng(seed).normal(0.0, _NOISE, steps))
    path = out / f"layers-{name}.svg"
    found = _summary(preset, run) | {"figure": str(path)}
    out.mkdir(parents=True, exist_ok=True)
    _draw(path, preset, run)
    if as_json:
        click.echo(json.dumps(found, indent=2))
        return
    for key, value in found.items():
        click.echo(f"{key.replace('_', ' ')}: {value}")


def _summary(preset: Preset, run: Run) -> dict[str, Any]:
    """What the run did from four periods after the loop began."""
    from gliderwatch.papers.extremum_seeking import reach
    from gliderwatch.papers.seeking_vehicle import coverage, outside

    tracked = run.t[run.tracking > 0]
    if not len(tracked):
        return {"began": None, "resets": run.resets}
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
        "resets": run.resets,
    }


def _draw(path: Path, preset: Preset, run: Run) -> None:
    """Depth against value, and both against time, as the figures of 004 have them."""
    from gliderwatch.score.plots import pyplot

    figure, (profile, way, series) = pyplot().subplots(1, 3, figsize=(14, 4.5), layout="constrained")
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
    figure.savefig(path)
