"""How often are simulated faults told, and how often is a healthy glider called faulty? Prints a table.

Each mission is that of the simulator's default glider, `DAYS` long, its fault after `ONSET` days. It is flown
once for each lower bound of the normal speed, and all go through the installed command
(`gliderwatch run --replay`). The table is put into `how-it-decides.md`.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from gliderwatch.simulate.dockserver import write_mission
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Fault, FaultKind, Mission, Scenario

PAGE = Path(__file__).resolve().with_name("how-it-decides.md")
GLIDERWATCH = Path(sys.executable).with_name("gliderwatch")
SEEDS, DAYS, ONSET = 20, 4.0, 2.0
LOWER_BOUNDS = (0.15, 0.20)
FAULTS = (
    (FaultKind.NONE, 0.0, "none"),
    (FaultKind.REMORA, 8.0, "remora: drag times 8"),
    (FaultKind.WING_LOSS, 0.5, "wing lost: half the speed, same depth rate"),
    (FaultKind.DAC_WRONG, 0.3, "current reported 0.3 m/s wrong"),
)


Flown = dict[tuple[int, float], Mission]
"""Missions by seed and lower bound."""


def fly(kind: FaultKind, size: float, seeds: int, days: float) -> Flown:
    """Missions with one fault, or none, each by a glider that is named by its seed and lower bound."""
    start = Scenario().start
    faults = () if kind is FaultKind.NONE else (Fault(kind, start + ONSET * 86400, size),)
    return {
        (seed, bound): simulate(
            Scenario(seed=seed, glider=f"s{seed}-{100 * bound:.0f}", days=days, faults=faults)
        )
        for seed in range(1, seeds + 1)
        for bound in LOWER_BOUNDS
    }


def incidents(flown: Flown) -> dict[tuple[int, float], set[str]]:
    """The kinds of message that each mission leads to."""
    with tempfile.TemporaryDirectory(prefix="gliderwatch-limits-") as folder:
        root = Path(folder)
        gliders = {}
        for (_, bound), mission in flown.items():
            write_mission(root / "gliders", root / "cache", mission)
            gliders[mission.scenario.glider] = {"normal_speed": {"min": bound, "max": 0.40}}
        config = {"dockserver": {"roots": ["gliders"], "cache": ["cache"]}, "gliders": gliders}
        (root / "gliderwatch.yml").write_text(json.dumps(config), encoding="utf-8")  # JSON is YAML
        words = ["run", "-c", "gliderwatch.yml", "--replay", "gliders", "--out", "out"]
        subprocess.run([GLIDERWATCH, *words], cwd=root, check=True, capture_output=True)
        lines = (root / "out" / "alerts.jsonl").read_text(encoding="utf-8").splitlines()
    told = [json.loads(line) for line in lines]
    return {key: {a["kind"] for a in told if a["glider"] == m.scenario.glider} for key, m in flown.items()}


def table(seeds: int, days: float) -> str:
    """The table, as Markdown."""
    lines = [
        "| fault after two days | true speed before, after | lower bound | anomaly | false alarm |",
        "| --- | --- | --- | --- | --- |",
    ]
    for kind, size, words in FAULTS:
        flown = fly(kind, size, seeds, days)
        kinds = incidents(flown)
        before, after = (sum(m.truth[i].speed for m in flown.values()) / len(flown) for i in (0, -1))
        for bound in LOWER_BOUNDS:
            opened = [kinds[key] for key in kinds if key[1] == bound]
            counts = [sum(what in each for each in opened) for what in ("anomaly", "false_alarm")]
            told = " | ".join(f"{n} of {seeds}" for n in counts)
            lines.append(f"| {words} | {before:.2f}, {after:.2f} m/s | {bound:.2f} m/s | {told} |")
    return "\n".join(lines)


def main() -> None:
    """Print the table, and put it in place of the one in the page."""
    made = table(SEEDS, DAYS)
    page = PAGE.read_text(encoding="utf-8")
    head = re.escape(made.splitlines()[0])
    PAGE.write_text(re.sub(rf"^{head}\n(\|.*\n)+", lambda _: made + "\n", page, flags=re.M), encoding="utf-8")
    print(made)


if __name__ == "__main__":
    main()
