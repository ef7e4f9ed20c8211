"""Folders that the settings name by path or pattern."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterable
from pathlib import Path

from pydantic import ValidationInfo

FROM_GLIDER = "from-glider"


def absolute(path: str, info: ValidationInfo) -> str:
    """A path from the settings, made absolute: relative ones start at the folder of the file."""
    base = (info.context or {}).get("base")
    expanded = os.path.expanduser(path)  # noqa: PTH111 (of Path it raises where there is no home)
    return os.path.normpath(base / expanded) if base else expanded


def expand(patterns: Iterable[str]) -> list[Path]:
    """The folders or files that exist now for paths and glob patterns, each once, in order."""
    found: dict[Path, None] = {}
    for pattern in patterns:
        matches = [pattern] if os.path.lexists(pattern) else sorted(glob.glob(pattern))  # noqa: PTH207
        found.update(dict.fromkeys(map(Path, matches)))
    return list(found)


def is_folder(path: Path) -> bool:
    """Whether a folder is there; False, unlike `Path.is_dir`, also where this user may not look."""
    return os.path.isdir(path)  # noqa: PTH112
