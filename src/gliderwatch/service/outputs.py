"""Files for pilots to check and send, in a folder of outputs: mission arguments of a Slocum."""

from __future__ import annotations

from pathlib import Path


def put(path: Path, text: str) -> None:
    """Put a file in the place of an earlier one, ASCII as a glider reads it. Raises OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".tmp")
    part.write_text(text, encoding="ascii", errors="replace")
    part.replace(path)
