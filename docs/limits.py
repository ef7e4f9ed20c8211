"""How often are simulated faults told, and how often is a healthy glider called faulty? Prints a table.

Each mission is that of the simulator's default glider, `DAYS` long, its fault after `ONSET` days. All go
through the installed command (`gliderwatch run --replay`), once for each way of `WAYS` to judge them:
the defaults, a range of speed that is configured, and the learner of the papers. The table is put
into `how-it-decides.md`. On two cores it takes a good minute.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from gliderwatch.simulate.delivery import write_mission
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Fault, FaultKind, Mission, Scenario

PAGE = Path(__file__).resolve().with_name("how-it-decides.md")
GLIDERWATCH = Path(sys.executable).with_name("gliderwatch")
SEEDS, DAYS, ONSET = 10, 4.0, 2.0
FAULTS = (
    (FaultKind.NONE, 0.0, "none"),
    (FaultKind.REMORA, 8.0, "remora: drag times 8"),
    (FaultKind.REMORA, 2.0, "remora: drag times 2"),
    (FaultKind.WING_LOSS, 0.5, "wing lost: half the speed, same depth rate"),
    (FaultKind.DAC_WRONG, 0.3, "current reported 0.3 m/s wrong"),
)
RANGE = {"min": 0.15, "max": 0.40}
WAYS: Mapping[str, Mapping[str, object]] = {
    "`joint`, learnt": {},
    "`joint`, from 0.15 m/s": {"normal_speed": RANGE},
    "`adaptive`, from 0.15 m/s": {"estimator": "adaptive", "normal_speed": RANGE},
}
"""Estimator and normal range: what stands in the table, and the settings."""


def fly(kind: FaultKind, size: float, seed: int, days: float) -> Mission:
    """A mission with one fault, or none, of a glider that is named by its seed."""
    start = Scenario().start
    faults = () if kind is FaultKind.NONE else (Fault(kind, start + ONSET * 86400, size),)
    return simulate(Scenario(seed=seed, glider=f"s{seed}", days=days, faults=faults))


def told(root: Path, gliders: Sequence[str], settings: Mapping[str, object]) -> list[set[str]]:
    """The kinds of message that the files below a folder lead to, by glider."""
    config = {
        "dockserver": {"roots": ["gliders"], "cache": ["cache"]},
        "defaults": settings,
        "gliders": dict.fromkeys(gliders),
    }
    (root / "gliderwatch.yml").write_text(json.dumps(config), encoding="utf-8")  # JSON is YAML
    words = ["run", "-c", "gliderwatch.yml", "--replay", "gliders", "--out", "out"]
    subprocess.run([GLIDERWATCH, *words], cwd=root, check=True, capture_output=True)
    lines = (root / "out" / "alerts.jsonl").read_text(encoding="utf-8").splitlines()
    alerts = [json.loads(line) for line in lines]
    return [{a["kind"] for a in alerts if a["glider"] == glider} for glider in gliders]


def rows(kind: FaultKind, size: float, words: str, seeds: int, days: float) -> list[str]:
    """The rows of one fault."""
    flown = [fly(kind, size, seed, days) for seed in range(1, seeds + 1)]
    before, after = (sum(mission.truth[i].speed for mission in flown) / seeds for i in (0, -1))
    out = []
    with tempfile.TemporaryDirectory(prefix="gliderwatch-limits-") as folder:
        for mission in flown:
            write_mission(Path(folder) / "gliders", Path(folder) / "cache", mission)
        for way, settings in WAYS.items():
            kinds = told(Path(folder), [mission.scenario.glider for mission in flown], settings)
            counts = [sum(what in each for each in kinds) for what in ("anomaly", "false_alarm")]
            cells = " | ".join(f"{n} of {seeds}" for n in counts)
            out.append(f"| {words} | {before:.2f}, then {after:.2f} | {way} | {cells} |")
    return out


def table(seeds: int, days: float) -> str:
    """The table, as Markdown."""
    lines = [
        "| fault after two days | true speed, m/s | estimator, normal range | anomaly | false alarm |",
        "| --- | --- | --- | --- | --- |",
    ]
    with ProcessPoolExecutor(max_workers=2) as pool:
        jobs = [pool.submit(rows, *fault, seeds, days) for fault in FAULTS]
        return "\n".join([*lines, *(row for job in jobs for row in job.result())])


def main() -> None:
    """Print the table, and put it in place of the one in the page."""
    made = table(SEEDS, DAYS)
    page = PAGE.read_text(encoding="utf-8")
    head = re.escape(made.splitlines()[0])
    PAGE.write_text(re.sub(rf"^{head}\n(\|.*\n)+", lambda _: made + "\n", page, flags=re.M), encoding="utf-8")
    print(made)


if __name__ == "__main__":
    main()
