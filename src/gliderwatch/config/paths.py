"""Folders that the settings name by path or pattern."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterable
from pathlib import Path

from pydantic import ValidationInfo

FROM_GLIDER = "from-glider"
_NOISE = {"unknown"}  # dockservers keep files of gliders they could not name in it


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


def glider_folders(root: Path) -> list[tuple[str, Path]]:
    """The from-glider folders below a root (`ROOT/NAME/from-glider`), with the glider's name, lower case.

    Raises `OSError` when the root cannot be listed.
    """
    folders = sorted((folder.name.lower(), folder / FROM_GLIDER) for folder in root.iterdir())
    return [(name, folder) for name, folder in folders if name not in _NOISE and is_folder(folder)]
