"""The demo does what it promises, and leaves nothing behind."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

DEMO = Path(__file__).resolve().parents[2] / "demo" / "demo.py"


def test_the_demo_ends_with_the_alert_and_leaves_nothing(tmp_path: Path) -> None:
    result = subprocess.run(
        [sys.executable, DEMO],
        env=os.environ | {"TMPDIR": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
        timeout=200,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    assert "Traceback" not in result.stdout + result.stderr
    assert "ANOMALY" in result.stdout
    assert "gliderwatch is alive" in result.stdout
    assert list(tmp_path.iterdir()) == []
