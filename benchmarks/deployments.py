"""The four deployments of Table II of paper 000, and one in a strong current, simulated and judged again by
`gliderwatch hindcast`.

`python benchmarks/deployments.py --out DIR [--estimator joint|adaptive] [--only franklin]`: sbd and dbd
files of each are written, and the installed command makes the reports. With `joint` the normal speed is what
a pilot of these gliders would write (`deployments/gliderwatch.json`), with `adaptive` the law of the papers
has the preset of each glider in Table I (`deployments/adaptive.json`). Beside each event stand the surfacings
at which dbd and sbd show it, and the flags by sbd before and after it; the paper has for USF-Sam 11 March
20:00 by dbd and 12 March 03:00 by sbd.
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


def seen(judged: dict | None, after: float) -> str:
    """The first incident after an event, and how long after it."""
    if judged is None:
        return "no files"
    opened = sorted((one["opened_at"], one["kind"]) for one in judged["incidents"])
    before = sum(t < after for t, _ in opened)
    first = next(((t, kind) for t, kind in opened if t >= after), None)
    if first is None:
        return "not seen" + (f", {before} before" if before else "")
    when = datetime.fromtimestamp(first[0], UTC).strftime("%d %b %H:%M")
    return f"{when} ({(first[0] - after) / 3600:+.0f} h, {first[1]})" + (
        f", {before} before" if before else ""
    )


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
    options = parser.parse_args()
    names = options.only or sorted(path.stem for path in HERE.glob("*.yml"))
    folders = [simulated(name, options.out) for name in names]
    out = options.out / options.estimator
    command = [GLIDERWATCH, "hindcast", *folders, "--out", out, "--json", "--settings"]
    command.append(HERE / SETTINGS[options.estimator])
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    print(done.stderr, file=sys.stderr)
    print(f"{'deployment':<16}{'event':>14}  {'by dbd':<38}{'by sbd':<38}flags before, after")
    for line in done.stdout.splitlines():
        found = json.loads(line)
        t = onset(found["name"])
        event = datetime.fromtimestamp(t, UTC).strftime("%d %b %H:%M")
        by = f"{seen(found['full'], t):<38}{seen(found['online'], t):<38}"
        print(f"{found['name']:<16}{event:>14}  {by}{flags(out / found['name'] / 'online', t)}")


if __name__ == "__main__":
    main()
