"""The joint estimator on real missions, on the score's grid, and in seas and with airframes of all kinds.

python benchmarks/joint.py [--missions ../shared/data] [--gliders 8]
python benchmarks/joint.py calibrate [--gliders 16] [--first 1700]

Dives come from files: simulated gliders write Dinkum files, which are decoded and navigated like real ones.
What is said of a dive is said with all that is known of it in the end. `calibrate` prints how often the
test for a step speaks on healthy gliders of 30 days in each kind of sea: the table of
`estimation/constants.py`.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from common import machine
from flights import (
    DAY,
    HOUR,
    SEAS,
    Flown,
    all_of,
    delay,
    errors,
    fly,
    from_,
    incidents,
    judged,
    off,
    read,
    slowed,
    various,
)
from sea_runs import Job, flight

from gliderwatch.estimation.kalman import JointParams
from gliderwatch.estimation.modes import Cause
from gliderwatch.estimation.verdict import SpeedParams, SpeedState, step
from gliderwatch.score.graft import navigate
from gliderwatch.score.grid import cells, load_grid
from gliderwatch.score.measures import HEALTHY
from gliderwatch.simulate.scenario import FaultKind
from gliderwatch.simulate.seas import SEAS as KINDS

SILENT = SpeedParams(joint=JointParams(alarms_per_month=1e-12))
"""No step is ever believed."""
RATIOS = (8, 10, 12, 14, 16, 18, 20, 24)


def speed_row(name: str, flights: Sequence[Flown]) -> str:
    e = errors(flights)
    inside = 100 * np.mean(np.abs(e[:, 1]) < 1.96)
    numbers = f"{100 * np.sqrt(np.mean(e[:, 0] ** 2)):9.2f} {inside:7.1f} {np.mean(e[:, 1] ** 2):7.2f}"
    return f"{name:34s} {len(e):6d} {numbers} {np.mean(e[:, 2]):7.2f} {np.nanmean(e[:, 3]):7.2f}"


def false_row(name: str, flights: Sequence[Flown]) -> str:
    months = sum(f.healthy_months() for f in flights)
    counts = []
    for flag in (1, 2):
        wrong = sum(t <= (f.onset or np.inf) for f in flights for t in incidents(f, flag))
        counts.append(f"{wrong:4d} {wrong / months:7.3f}")
    return f"{name:34s} {months:6.1f} {counts[0]} {counts[1]}"


def share(found: Sequence[bool]) -> str:
    return f"{sum(found)} of {len(found)}"


def real(folder: Path) -> None:
    """Targets 1 to 3 on real missions: faults are put onto each dive after the first 12 h in turn."""
    print(
        "\nreal missions, after 12 h    dives flag 1 flag 2 none  NIS    lost 50 %   lost 30 %  0.3 m/s wrong"
    )
    for mission in sorted(p for p in folder.iterdir() if (p / "from-glider").is_dir()):
        dives = navigate(read(mission / "from-glider", mission / "cache"))
        verdicts = judged(dives)
        late = [k for k, d in enumerate(dives) if d.t_dive - dives[0].t_dive > 12 * HOUR]
        flags = [verdicts[k].flag for k in late]
        usual = [v.info for v in verdicts if v.info and v.info.cause is Cause.USUAL]
        nis = sum(i.nis for i in usual) / sum(i.dof for i in usual)
        onsets = [k for k in late[:-1] if dives[k].track is not None]
        half = [any(v.flag == 1 for v in from_(dives, k, lambda d: slowed(d, 0.5))[:2]) for k in onsets]
        third = [any(v.flag == 1 for v in from_(dives, k, lambda d: slowed(d, 0.3))[:4]) for k in onsets]
        wrong = [
            judged([*dives[:k], off(dives[k], angle)])[k].flag
            for k in late
            if dives[k].track is not None and dives[k].current is not None
            for angle in np.arange(8) * np.pi / 4
        ]
        counts = [flags.count(flag) for flag in (1, 2, None)]
        told = f"flag 2 {wrong.count(2)}, flag 1 {wrong.count(1)} of {len(wrong)}"
        print(
            f"{mission.name:28s} {len(late):5d} {counts[0]:6d} {counts[1]:6d} {counts[2]:4d} {nis:5.2f} "
            f" {share(half):>11s} {share(third):>11s}  {told}"
        )
        for k in late:
            if verdicts[k].flag in (1, 2):
                hours = (dives[k].t_dive - dives[0].t_dive) / HOUR
                print(f"    flag {verdicts[k].flag} at {hours:.0f} h: {verdicts[k].reason}")


# --------------------------------------------------------------------------- simulated gliders


def grid() -> list[Flown]:
    """The default grid of the score."""
    found = [c for c in cells(load_grid("default")) if c.scenario is not None]
    return all_of(fly, [(c.sea, c.scenario) for c in found])


def table(flights: Sequence[Flown], various_ones: Sequence[Flown]) -> None:
    print("\nfaults of the score's grid     n  flag due: median, worst surfacing; hours     other flag")
    for fault in dict.fromkeys(f.fault for f in flights if f.fault):
        some = [f for f in flights if f.fault == fault]
        due = 2 if fault.startswith(("compass", "dac_wrong")) else 1
        counts, hours = zip(*(delay(f, due) for f in some), strict=True)
        other = sum(any(t > (f.onset or 0) for t in incidents(f, 3 - due)) for f in some)
        print(
            f"{fault:28s} {len(some):3d}  {np.median(counts):5.1f} {max(counts):5.0f}"
            f"  {np.median(hours):6.1f} {max(hours):6.0f}  {other:20d}"
        )
    print("\nspeed against the truth             dives  rms cm/s  in 95 %  NEES V  NEES F     NIS")
    for sea in dict.fromkeys(f.name for f in flights):
        some = [f for f in flights if f.name == sea]
        for words, kind in (
            ("healthy", [f for f in some if not f.fault]),
            ("faulty", [f for f in some if f.fault]),
        ):
            if kind:
                print(speed_row(f"{sea}, {words}", kind))
    print(speed_row("all of the grid", flights))
    print(speed_row("healthy, airframes that differ", various_ones))
    print("\nfalse messages of healthy time     months  flag 1, a month  flag 2, a month")
    for sea in dict.fromkeys(f.name for f in flights):
        print(false_row(sea, [f for f in flights if f.name == sea]))
    for sea in SEAS:
        print(false_row(f"{sea}, airframes that differ", [f for f in various_ones if f.name.startswith(sea)]))
    print(false_row("all", [*flights, *various_ones]))


def hidden(gliders: int) -> None:
    """Target 4: half of the speed lost at the same depth rate, where the heading changes by 60 degrees."""
    print("\nwing_loss 0.5, heading changed by 60 degrees within 48 h    n  within 48 h  median h")
    for roll in (True, False):
        jobs = [
            (name, scenario, SpeedParams(), roll)
            for name, scenario in various(gliders, FaultKind.WING_LOSS, 0.5)
        ]
        flights = [f for f in all_of(fly, jobs) if turns(f)]
        for sea in SEAS:
            hours = [delay(f, 1)[1] for f in flights if f.name.startswith(sea)]
            words = f"{sea}, roll {'sent' if roll else 'not sent'}"
            print(
                f"{words:58s} {len(hours):3d} {np.mean(np.array(hours) <= 48):11.0%} {np.median(hours):9.1f}"
            )


def turns(flown: Flown) -> bool:
    onset = flown.onset or 0.0
    seen = [
        d.features.heading_mean
        for d in flown.dives
        if onset < d.t_dive < onset + 2 * DAY and d.features.heading_mean is not None
    ]
    apart = np.angle(np.exp(1j * np.subtract.outer(seen, seen)))
    return bool(np.abs(apart).max(initial=0.0) >= np.pi / 3)


def calibrate(gliders: int, first: int, kept: Path) -> None:
    """How often in a month the likeliest step of a healthy glider has a ratio above some numbers, in each
    kind of sea: of a loss or of a turn, and in all of them of each."""
    jobs = [(Job(sea, first + k, HEALTHY, 30.0, kept),) for k in range(gliders) for sea in KINDS]
    counted = all_of(likeliest, jobs)
    months = sum(each.months for each in counted)
    print(f"{months:.0f} glider-months, {len(counted)} gliders\nalarms a month at a ratio above")
    print(f"{'':20s}" + "".join(f"{ratio:8d}" for ratio in RATIOS))
    for sea in KINDS:
        some = [each for each in counted if each.sea == sea]
        print(rates(sea, [max(each.loss, each.turn) for each in some], sum(each.months for each in some)))
    print(rates("all", [max(each.loss, each.turn) for each in counted], months))
    print(rates("all, losses", [each.loss for each in counted], months))
    print(rates("all, turns", [each.turn for each in counted], months))


class Likeliest(NamedTuple):
    """Of one healthy glider: its sea, months, and the greatest ratios of a loss and of a turn."""

    sea: str
    months: float
    loss: float
    turn: float


def likeliest(job: Job) -> Likeliest:
    """The greatest ratios of one healthy glider, where no step is ever believed."""
    state, losses, turned = SpeedState(), [0.0], [0.0]
    dives = navigate(flight(job).segments)
    for dive in dives:
        state, said = step(state, dive, SILENT)
        if said.info is not None:
            losses += [said.info.loss.ratio] if said.info.loss else []
            turned += [said.info.turn.ratio] if said.info.turn else []
    t = dives[-1].t_surface - dives[0].t_dive
    return Likeliest(job.sea, t / (30 * DAY), max(losses), max(turned))


def rates(name: str, most: Sequence[float], months: float) -> str:
    counts = (sum(m > ratio for m in most) / months for ratio in RATIOS)
    return f"{name:20s}" + "".join(f"{count:8.3f}" for count in counts)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("what", nargs="?", choices=["table", "calibrate"], default="table")
    parser.add_argument("--missions", type=Path, default=Path(__file__).parents[2] / "shared" / "data")
    parser.add_argument("--gliders", type=int, default=8, help="in each sea, and on each way")
    parser.add_argument("--first", type=int, default=0, help="calibrate: first seed")
    parser.add_argument("--kept", type=Path, default=Path(__file__).parents[1] / "build" / "seas")
    arguments = parser.parse_args()
    print(machine())
    if arguments.what == "calibrate":
        calibrate(arguments.gliders, arguments.first, arguments.kept)
        return
    if arguments.missions.is_dir():
        real(arguments.missions)
    varied = all_of(fly, various(arguments.gliders))
    table(grid(), varied)
    hidden(arguments.gliders)


if __name__ == "__main__":
    main()
