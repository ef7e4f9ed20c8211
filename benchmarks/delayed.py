"""What delayed mode gains over near real time on simulated seas, where the truth is known.

`python benchmarks/delayed.py [--seas rotary,mixed] [--seeds 2] [--days 20] [--lost 0.3]
[--page docs/archive.md]`: gliders of the classes of `simulate/seas.py`, through their files; error (rms,
cm/s) of a component of the instantaneous current at each half hour under water from day 3 on, and the part
inside of 95 %, of

- foreseen: what was known when the dive began;
- near real time: what was known once it had ended;
- delayed: what the whole mission shows;
- as on board: delayed, where the reckoning leaves out the angle of attack;
- 002: the two-stage filter of paper 002, forward (its near real time) and both ways (its delayed mode).

`--lost` is the part of the dives whose files never came: their currents count too. `--page` puts the table
where a page names its part of lost dives (`<!-- lost 0.3 -->` to `<!-- end -->`). Paper 002 has 6.5 to 7
near real time and below 6 delayed, against an ADCP some km away.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from sea_runs import HEALTHY, Job, flight, scenario

from gliderwatch.archive.delayed import mean_currents
from gliderwatch.estimation.dive_measurement import observe
from gliderwatch.model import Array, Dive
from gliderwatch.navigation.geodesy import to_plane
from gliderwatch.papers.two_stage import TwoStageParams, learn_tide, low_pass, low_pass_both_ways, mean_tide
from gliderwatch.score.graft import navigate
from gliderwatch.sea.gauss_markov import FlowParams
from gliderwatch.sea.smoother import MeanCurrent, smooth
from gliderwatch.sea.tides import Constituent
from gliderwatch.simulate.glider import sea_of
from gliderwatch.simulate.scenario import DiveTruth, Scenario
from gliderwatch.simulate.seas import SEAS

DAY, HOUR = 86400.0, 3600.0
DEPTHS = 8
MODES = ("foreseen", "near real time", "delayed", "as on board", "002 forward", "002 both ways")
LENGTHS = {"dives below 3 h": (0.0, 3.0), "3 to 6 h": (3.0, 6.0), "above 6 h": (6.0, 99.0)}
NOTHING = 10.0
"""m/s: standard error of a current that never came."""
PAPER = TwoStageParams(constituents=(Constituent.M2, Constituent.K1))


def truth(t: Array, dives: Sequence[DiveTruth], flown: Scenario) -> Array:
    """The true current (m/s, (n, 2)) at times (s), mean over the depths that the glider flies through."""
    places = np.array([dive.end for dive in dives])
    origin = flown.origin or flown.place
    east, north = to_plane(places[:, 0], places[:, 1], origin.lat, origin.lon).T
    times = np.array([dive.t_surface for dive in dives])
    x, y, sea = np.interp(t, times, east), np.interp(t, times, north), sea_of(flown)
    deepest = float(np.median([dive.deepest for dive in dives]))
    layers = [sea.current(t, x, y, depth) for depth in (np.arange(DEPTHS) + 0.5) / DEPTHS * deepest]
    return np.mean([np.stack(layer, -1) for layer in layers], axis=0)


def as_on_board(dives: Sequence[Dive], found: Sequence[MeanCurrent]) -> list[MeanCurrent]:
    """The same currents without what the angle of attack takes from the reckoning."""
    seen = {one.start: one.current for dive in dives if dive.track is not None for one in (observe(dive),)}
    return [replace(one, current=seen[one.start]) for one in found]


def of_paper(t: Array, came: Sequence[MeanCurrent], until: Array, both_ways: bool) -> Array:
    """Currents (m/s, (n, 2)) at times ``t`` (s) by the two-stage filter of 002: by the dives that had ended
    at ``until`` (s), or, ``both_ways``, by all.

    The residual is interpolated between the middles of the dives, as 002 does once a dive has ended.
    """
    middles, ends = (
        np.array(each) for each in zip(*(((c.start + c.end) / 2, c.end) for c in came), strict=True)
    )
    filtered = low_pass_both_ways if both_ways else low_pass
    residual = filtered(middles, np.array([one.current for one in came]), PAPER.cutoff)
    amplitudes = tides(came, residual, middles, both_ways)
    last = np.clip(np.searchsorted(ends, until, "right") - 1, 0, len(came) - 1)
    at = np.clip(np.searchsorted(ends, t, "left"), 0, len(came) - 1) if both_ways else last
    tide = np.array([mean_tide(s, s, PAPER.constituents) @ amplitudes[k] for s, k in zip(t, at, strict=True)])
    steady = np.stack([np.interp(t, middles, residual[:, i]) for i in range(2)], -1)
    if not both_ways:  # what is not yet known stays as it was last
        steady = np.where((t > middles[last])[:, None], residual[last], steady)
    return steady + tide


def tides(came: Sequence[MeanCurrent], residual: Array, middles: Array, both_ways: bool) -> list[Array]:
    """The amplitudes of the tides (m/s) after each dive, or, ``both_ways``, by all."""
    n = 2 * len(PAPER.constituents)
    mean, cov, before = np.zeros((n, 2)), PAPER.prior * np.eye(n), middles[0]
    means, covs = [], []
    for one, steady, t in zip(came, residual, middles, strict=True):
        cov = cov + PAPER.q * (t - before) * np.eye(n)
        row = mean_tide(one.start, one.end, PAPER.constituents)
        mean, cov, _ = learn_tide(mean, cov, row, one.current - steady, one.sigma)
        means, covs, before = [*means, mean], [*covs, cov], t
    if both_ways:
        for k in reversed(range(len(means) - 1)):
            spread = PAPER.q * (middles[k + 1] - middles[k]) * np.eye(n)
            means[k] = means[k] + covs[k] @ np.linalg.inv(covs[k] + spread) @ (means[k + 1] - means[k])
    return means


def errors(job: Job, lost: float) -> tuple[dict[str, tuple[Array, Array]], Array]:
    """By mode the errors (m/s, (n, 2)) and whether each is inside of 95 % ((n, 2)); the length (h, (n,)) of
    the dive of each."""
    flown, made = scenario(job), flight(job)
    dives = navigate(made.segments)
    luck = np.random.default_rng(job.seed)
    came = mean_currents(dives)
    gone = luck.random(len(came)) < lost
    gone[:2] = False
    wanted = [replace(one, sigma=NOTHING) if no else one for one, no in zip(came, gone, strict=True)]
    found = smooth(wanted, FlowParams())
    t = found.delayed.t
    kept = (t > flown.start + 3 * DAY) & (t < made.truth[-1].t_surface)
    real = truth(np.clip(t, flown.start, None), made.truth, flown)
    starts = np.array([one.start for one in wanted])
    at = np.clip(np.searchsorted(starts, t, "right") - 1, 0, None)
    until = np.array([one.end for one in wanted])[at]
    plain = smooth(as_on_board(dives, wanted), FlowParams()).delayed
    out = {}
    ours = (found.foreseen, found.near_real_time, found.delayed, plain)
    for mode, one in zip(MODES, ours, strict=False):
        error = (one.total - real)[kept]
        out[mode] = error, np.abs(error) < 1.96 * one.sigma[kept]
    known = [one for one, no in zip(came, gone, strict=True) if not no]
    for mode, both_ways in zip(MODES[4:], (False, True), strict=True):
        error = (of_paper(t, known, until, both_ways) - real)[kept]
        out[mode] = error, np.full(error.shape, np.nan)
    hours = np.array([one.end - one.start for one in wanted])[at] / HOUR
    return out, hours[kept]


def row(
    name: str, some: Sequence[tuple[dict[str, tuple[Array, Array]], Array]], low: float, high: float
) -> str:
    """The errors of flights in dives that last so many hours, printed too; nothing where there is no dive."""
    rms, cells = {}, []
    for mode in MODES:
        error, inside = (
            np.concatenate([each[mode][i][(hours >= low) & (hours < high)] for each, hours in some])
            for i in range(2)
        )
        if not len(error):
            return ""
        rms[mode] = 100 * float(np.sqrt(np.mean(error**2)))
        covered = "" if np.isnan(inside).any() else f" ({np.mean(inside):.0%})"
        cells.append(f"{rms[mode]:.1f}{covered}")
    ratio = rms["delayed"] / rms["near real time"]
    words = f"| {name} | {' | '.join(cells)} | {ratio:.2f} |"
    print(words, flush=True)
    return words + "\n"


def put(page: Path, lost: float, table: str) -> None:
    """Put a table where a page has its place for it."""
    begin, end = f"<!-- lost {lost:g} -->\n", "<!-- end -->"
    before, found, rest = page.read_text(encoding="utf-8").partition(begin)
    if not found:
        raise SystemExit(f"{page} has no line {begin}")
    page.write_text(before + begin + table + end + rest.partition(end)[2], encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seas", default=",".join(SEAS))
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--first", type=int, default=500)
    parser.add_argument("--days", type=float, default=20.0)
    parser.add_argument("--lost", type=float, default=0.0)
    parser.add_argument("--kept", type=Path, default=Path("build/seas"))
    parser.add_argument("--page", type=Path)
    options = parser.parse_args()
    table = f"| sea | {' | '.join(MODES)} | delayed to near real time |\n| --- |" + " --- |" * (
        len(MODES) + 1
    )
    print(table, flush=True)
    table += "\n"
    all_of_them = []
    for name in options.seas.split(","):
        seeds = range(options.first, options.first + options.seeds)
        some = [errors(Job(name, seed, HEALTHY, options.days, options.kept), options.lost) for seed in seeds]
        table += row(name, some, 0.0, 99.0)
        all_of_them += some
    table += row("all", all_of_them, 0.0, 99.0)
    for name, (low, high) in LENGTHS.items():
        table += row(name, all_of_them, low, high)
    if options.page is not None:
        put(options.page, options.lost, table)


if __name__ == "__main__":
    main()
