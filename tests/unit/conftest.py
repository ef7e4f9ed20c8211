"""What many tests of numbers and settings are given."""

from __future__ import annotations

from pathlib import Path

import pytest

from config_support import Write


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Writes a text as settings, and returns its path."""

    def _write(text: str) -> Path:
        path = tmp_path / "c.yml"
        path.write_text(text, encoding="utf-8")
        return path

    return _write
