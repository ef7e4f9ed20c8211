"""The four deployments of Table II of paper 000, and one in a strong current, simulated and judged again by
`gliderwatch hindcast`.

`python benchmarks/deployments.py --out DIR [--estimator joint|adaptive] [--only franklin]`: sbd and dbd
files of each are written, and the installed command makes the reports. With `joint` the normal speed is what
a pilot of these gliders would write (`deployments/gliderwatch.json`), with `adaptive` the law of the papers
has the preset of each glider in Table I (`deployments/adaptive.json`). Printed of each event: when its onset
within the dive is by the samples of dbd, since when the learnt speed is out of its range (papers' law), the
surfacings at which dbd and sbd show it, when the sbd was on shore, and the flags by sbd before and after it.
The paper has for USF-Sam 11 March 20:00 by dbd and 12 March 03:00 by sbd.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections import Counter
from datetime import UTC, datetime
from pathlib import Path

from common import GLIDERWATCH

from gliderwatch.simulate.scenario_files import load_scenario

HERE = Path(__file__).parent / "deployments"
SETTINGS = {"joint": "gliderwatch.json", "adaptive": "adaptive.json"}


def simulated(name: str, out: Path) -> Path:
    """The folder of a deployment, with sent and recovered files; made once."""
    folder = out / "missions" / name
    if not folder.exists():
        scenario = str(HERE / f"{name}.yml")
        subprocess.run(
            [GLIDERWATCH, "simulate", folder, "--scenario", scenario, "--full-rate"],
            check=True,
            capture_output=True,
        )
    return folder


def onset(name: str) -> float:
    """When the fault of a deployment begins (s)."""
    return load_scenario(HERE / f"{name}.yml").faults[0].onset


def when(t: float) -> str:
    """A time (s) in words."""
    return datetime.fromtimestamp(t, UTC).strftime("%d %b %H:%M")


def after(t: float | None, event: float) -> str:
    """A time (s), and how long after an event it is."""
    return "-" if t is None else f"{when(t)} ({(t - event) / 3600:+.1f} h)"


def first(judged: dict | None, event: float) -> dict:
    """The first incident that is seen after an event and concerns it."""
    found = [] if judged is None else judged["incidents"]
    return min((i for i in found if i["opened_at"] >= event), key=lambda i: i["opened_at"], default={})


def show(found: dict, event: float, online: Path) -> None:
    """Print what full files and files as sent show of an event."""
    full, sent = first(found["full"], event), first(found["online"], event)
    onset = (full.get("onset") or {}).get("t")
    print(f"{found['name']}: {when(event)}")
    print(f"  by dbd, in the dive       {after(onset, event)}")
    if full.get("out") or sent.get("out"):
        print(f"  V_L out of range, dbd     {after(full.get('out'), event)}")
        print(f"  V_L out of range, sbd     {after(sent.get('out'), event)}")
    print(f"  by dbd, at the surfacing  {after(full.get('opened_at'), event)} {full.get('kind', 'not seen')}")
    print(f"  by sbd, at the surfacing  {after(sent.get('opened_at'), event)} {sent.get('kind', 'not seen')}")
    print(f"  by sbd, on shore          {after(sent.get('on_shore'), event)}")
    for words, judged in (("dbd", found["full"]), ("sbd", found["online"])):
        early = sum(i["opened_at"] < event for i in judged["incidents"])
        print(f"  incidents by {words} before the event: {early}, in all {len(judged['incidents'])}")
        for one in judged["incidents"]:
            if one["opened_at"] < event < (one["cleared_at"] or float("inf")):
                print(f"  by {words} one was open already, since {when(one['since'])}")
    print(f"  flags by sbd before, after: {flags(online, event)}", flush=True)


def flags(replay: Path, after: float) -> str:
    """How many dives had each flag before an event, and after it."""
    rows = [json.loads(line) for line in (replay / "assessments.jsonl").read_text().splitlines()]
    when = datetime.fromtimestamp(after, UTC).strftime("%Y-%m-%dT%H:%M")
    parts = ([row for row in rows if (row["t_surface"] < when) is early] for early in (True, False))
    return ", ".join(str(dict(sorted(Counter(str(row["flag"]) for row in part).items()))) for part in parts)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--estimator", choices=SETTINGS, default="joint")
    parser.add_argument("--only", action="append", default=[])
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    names = options.only or sorted(path.stem for path in HERE.glob("*.yml"))
    folders = [simulated(name, options.out) for name in names]
    out = options.out / options.estimator
    command = [GLIDERWATCH, "hindcast", *folders, "--out", out, "--json", "--settings"]
    command += [HERE / SETTINGS[options.estimator], "--workers", str(options.workers)]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    print(done.stderr, file=sys.stderr)
    for line in done.stdout.splitlines():
        found = json.loads(line)
        show(found, onset(found["name"]), out / found["name"] / "online")


if __name__ == "__main__":
    main()
