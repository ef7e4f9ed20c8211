"""The demo does what it promises, and leaves its pages alone; five times as fast as for those who look on."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

DEMO = Path(__file__).resolve().parents[2] / "demo"
FAST = "import sys, demo; demo.SPEEDUP *= 5; sys.exit(demo.main())"


def test_the_demo_ends_with_the_alert_and_leaves_its_pages(tmp_path: Path) -> None:
    spare, here = tmp_path / "spare", tmp_path / "here"
    spare.mkdir()
    here.mkdir()
    result = subprocess.run(
        [sys.executable, "-c", FAST],
        env=os.environ | {"TMPDIR": str(spare), "PYTHONPATH": str(DEMO), "PYTHONDONTWRITEBYTECODE": "1"},
        cwd=here,
        capture_output=True,
        text=True,
        check=False,
        timeout=200,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    assert "Traceback" not in result.stdout + result.stderr
    assert "sim-01 SLOW 0." in result.stdout
    assert "sim-03 ABORTED: leak" in result.stdout
    assert "gliderwatch is alive" in result.stdout
    assert list(spare.iterdir()) == []
    assert result.stdout.endswith(f"its page, with one a glider: {here}/build/demo-pages/index.html\n")
    pages = here / "build" / "demo-pages"
    assert "<h1>3 gliders:" in (pages / "index.html").read_text()
    for name, word in (("sim-01", "SLOW"), ("sim-02", ""), ("sim-03", "ABORTED")):
        assert f"<title>{name} {word}" in (pages / f"{name}.html").read_text()
