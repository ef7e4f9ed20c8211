"""Draw the pictures of the README from the demo's mission: what a replay prints, and speed against its range.

Both come from the installed command, which simulates the demo's fleet and replays the files of its faulty
glider. The truth beside them is the simulation's own.
"""

from __future__ import annotations

import io
import json
import os
import re
import runpy
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from netCDF4 import Dataset
from rich.console import Console
from rich.text import Text

HERE = Path(__file__).resolve().parent
GLIDERWATCH = Path(sys.executable).with_name("gliderwatch")
COLUMNS = 80
"""Columns of the terminal."""
FONT = "'DejaVu Sans Mono', Menlo, Consolas, monospace"


@dataclass(frozen=True, slots=True)
class Truth:
    """What the simulation says of one dive: its start and end (s) and the true speed (m/s)."""

    t_dive: float
    t_surface: float
    speed: float


@dataclass(frozen=True, slots=True)
class Replay:
    """The commands, what the replay printed (with colours) and wrote, and what was true."""

    commands: tuple[str, ...]
    printed: str
    assessments: list[dict[str, Any]]
    alerts: list[dict[str, Any]]
    truth: tuple[Truth, ...]
    onset: float
    """When the fault begins (s)."""


def replay() -> Replay:
    """Simulate the demo's fleet and replay its faulty glider, with the installed command."""
    demo = runpy.run_path(str(HERE.parent / "demo" / "demo.py"))
    with tempfile.TemporaryDirectory(prefix="gliderwatch-picture-") as folder:
        root = Path(folder)
        simulate = ["simulate", "dockserver", *demo["FLEET"]]
        folder_of_glider = f"dockserver/gliders/{demo['HURT']}"
        watch = ["run", "--replay", folder_of_glider, "--cache", "dockserver/cache", "--out", "results"]
        _run(simulate, root)
        printed = _run(watch, root)
        written = [_lines(root / "results" / f"{what}.jsonl") for what in ("assessments", "alerts")]
        truth = _truth_of_first(root / "dockserver" / "truth.nc")
        onset = demo["onset"](root / "dockserver")
    commands = tuple(" ".join(["$ gliderwatch", *words]) for words in (simulate, watch))
    return Replay(commands, printed, written[0], written[1], truth, onset)


def _run(words: list[str], folder: Path) -> str:
    """What a command of gliderwatch prints, in colours."""
    environment = os.environ | {"COLUMNS": str(COLUMNS), "FORCE_COLOR": "1", "TERM": "xterm-256color"}
    environment.pop("NO_COLOR", None)
    command = [GLIDERWATCH, *words]
    return subprocess.run(
        command, cwd=folder, env=environment, check=True, stdout=subprocess.PIPE, text=True
    ).stdout


def _truth_of_first(path: Path) -> tuple[Truth, ...]:
    """The truth of the first glider, which is the faulty one."""
    with Dataset(path) as table:
        n = int(table["row_size"][0])
        bounds, speed = table["time_bounds"][:n].tolist(), table["speed"][:n].tolist()
    return tuple(Truth(begin, end, v) for (begin, end), v in zip(bounds, speed, strict=True))


def _lines(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def terminal(made: Replay) -> str:
    """The output of the command as SVG."""
    console = Console(record=True, width=COLUMNS, file=io.StringIO(), color_system="truecolor")
    for command in made.commands:
        console.print(Text(command, style="bold"))
    console.print(Text.from_ansi(made.printed))
    svg = console.export_svg(title="gliderwatch", unique_id="gliderwatch")
    svg = re.sub(r"@font-face \{.*?\}\n", "", svg, flags=re.DOTALL)  # no fonts from the net
    return "\n".join(line.rstrip() for line in svg.replace("Fira Code, monospace", FONT).splitlines()) + "\n"


# --------------------------------------------------------------------------- the plot

WIDTH, HEIGHT = 860, 380
LEFT, RIGHT, TOP, BOTTOM = 46, 46, 52, 46
LOW, HIGH = 0.0, 0.45
COLOURS = {None: "#8a8f98", 0: "#1a7f37", 1: "#cf222e", 2: "#bf8700"}
WORDS = {
    None: "no flag yet (warming up)",
    0: "flag 0, normal",
    1: "flag 1, anomaly",
    2: "flag 2, measurements disagree",
}


@dataclass(frozen=True, slots=True)
class Axes:
    """Time (s) and speed (m/s) to places in the picture."""

    begin: float
    end: float

    def x(self, t: float) -> float:
        """From the left (px)."""
        return LEFT + (WIDTH - LEFT - RIGHT) * (t - self.begin) / (self.end - self.begin)

    def y(self, speed: float) -> float:
        """From the top (px)."""
        return TOP + (HEIGHT - TOP - BOTTOM) * (HIGH - speed) / (HIGH - LOW)


def _seconds(text: str) -> float:
    return datetime.fromisoformat(text.replace("Z", "+00:00")).timestamp()


def plot(made: Replay) -> str:
    """Through-water speed of each dive against its normal range, with flags and the truth, as SVG."""
    times = [_seconds(a["t_surface"]) for a in made.assessments]
    axes = Axes(min(t.t_dive for t in made.truth), max(times) + 3600.0)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" '
        'font-family="DejaVu Sans, Helvetica, Arial, sans-serif" font-size="13" role="img">',
        "<title>Through-water speed of the demo's faulty glider against its normal range</title>",
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#ffffff"/>',
        *_range(axes, made.assessments[-1]),
        *_grid(axes),
        *_events(axes, made),
        *_truth(axes, made.truth),
        *_learnt(axes, times, made.assessments),
        *_legend(made.assessments),
        "</svg>",
    ]
    return "\n".join(parts) + "\n"


def _text(x: float, y: float, words: str, more: str = "") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" fill="#24292f" {more}>{words}</text>'


def _line(a: tuple[float, float], b: tuple[float, float], style: str) -> str:
    return f'<line x1="{a[0]:.1f}" y1="{a[1]:.1f}" x2="{b[0]:.1f}" y2="{b[1]:.1f}" {style}/>'


def _range(axes: Axes, dive: dict[str, Any]) -> list[str]:
    top, bottom = axes.y(dive["speed_max"]), axes.y(dive["speed_min"])
    area = f'x="{LEFT}" y="{top:.1f}" width="{WIDTH - LEFT - RIGHT}" height="{bottom - top:.1f}"'
    words = f"normal: {dive['speed_min']:.2f} to {dive['speed_max']:.2f} m/s"
    return [f'<rect {area} fill="#dff3e4"/>', _text(LEFT + 8, top + 17, words)]


def _grid(axes: Axes) -> list[str]:
    out = []
    for i in range(10):
        y = axes.y(0.05 * i)
        out.append(_line((LEFT, y), (WIDTH - RIGHT, y), 'stroke="#d0d7de" stroke-width="0.6"'))
        if i % 2 == 0:
            out.append(_text(LEFT - 8, y + 4, f"{0.05 * i:.1f}", 'text-anchor="end"'))
    day = 86400.0
    t = axes.begin - axes.begin % day + day / 2
    while t < axes.end:
        if t > axes.begin:
            out.append(_line((axes.x(t), TOP), (axes.x(t), HEIGHT - BOTTOM), 'stroke="#d0d7de"'))
            words = datetime.fromtimestamp(t, UTC).strftime("%d %b %H:%M")
            out.append(_text(axes.x(t), HEIGHT - BOTTOM + 18, words, 'text-anchor="middle"'))
        t += day / 2
    out.append(_text(LEFT, TOP - 10, "through-water speed, m/s"))
    out.append(_text(WIDTH - RIGHT, HEIGHT - 8, "time of surfacing, UTC", 'text-anchor="end"'))
    return out


def _events(axes: Axes, made: Replay) -> list[str]:
    """When the fault began and when the alert was made."""
    x = axes.x(made.onset)
    out = [_line((x, TOP), (x, HEIGHT - BOTTOM), 'stroke="#24292f" stroke-dasharray="2 3"')]
    out.append(_text(x - 6, TOP + 78, "a remora takes hold", 'text-anchor="end"'))
    for alert in made.alerts:
        x = axes.x(_seconds(alert["time"]))
        out.append(_line((x, TOP), (x, HEIGHT - BOTTOM), 'stroke="#cf222e" stroke-dasharray="5 3"'))
        out.append(_text(x + 6, TOP + 78, f"message: {alert['kind']}", 'font-weight="bold"'))
    return out


def _truth(axes: Axes, truth: Sequence[Truth]) -> list[str]:
    style = 'stroke="#57606a" stroke-width="2.5" stroke-linecap="round"'
    return [
        _line((axes.x(t.t_dive), axes.y(t.speed)), (axes.x(t.t_surface), axes.y(t.speed)), style)
        for t in truth
    ]


def _learnt(axes: Axes, times: Sequence[float], dives: Sequence[dict[str, Any]]) -> list[str]:
    known = [
        (axes.x(t), axes.y(a["speed"]), a["flag"])
        for t, a in zip(times, dives, strict=True)
        if a["speed"] is not None
    ]
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y, _ in known)
    out = [f'<polyline points="{path}" fill="none" stroke="#8a8f98" stroke-width="1.2"/>']
    return out + [_dot(x, y, flag) for x, y, flag in known]


def _dot(x: float, y: float, flag: int | None) -> str:
    fill = "#ffffff" if flag is None else COLOURS[flag]
    return (
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="5" fill="{fill}" stroke="{COLOURS[flag]}" stroke-width="1.8"/>'
    )


def _legend(dives: Sequence[dict[str, Any]]) -> list[str]:
    flags = [flag for flag in WORDS if any(a["flag"] == flag for a in dives)]
    x, out = float(LEFT), []
    out.append(_text(x, 20, "V_L, learnt:", 'font-weight="bold"'))
    x += 96
    for flag in flags:
        out += [_dot(x, 16, flag), _text(x + 10, 20, WORDS[flag])]
        x += 30 + 7.2 * len(WORDS[flag])
    out.append(_line((x, 16), (x + 24, 16), 'stroke="#57606a" stroke-width="2.5"'))
    return [*out, _text(x + 30, 20, "true speed (simulation)")]


def documents() -> dict[Path, str]:
    """The text of each picture."""
    made = replay()
    return {HERE / "replay.svg": terminal(made), HERE / "speed.svg": plot(made)}


if __name__ == "__main__":
    for path, text in documents().items():
        path.write_text(text, encoding="utf-8")
        print(path)
