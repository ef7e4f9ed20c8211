"""The estimators that can be scored, by name, and the settings that choose them."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import msgspec

from gliderwatch.config import Config, load
from gliderwatch.config.document import read
from gliderwatch.config.loading import presets_path
from gliderwatch.errors import GliderwatchError

ALGORITHMS = ("joint", "adaptive")
"""The values of `estimator:`, the default first."""


def known() -> list[str]:
    """All names: those of the algorithms with default settings, and `adaptive:PRESET`."""
    return [*ALGORITHMS, *(f"adaptive:{name}" for name in read(presets_path()).data)]


def check(name: str) -> str:
    """The name itself. Raises GliderwatchError where there is no such estimator."""
    names = known()
    if name not in names:
        raise GliderwatchError(f"there is no estimator {name}; known are: {', '.join(names)}")
    return name


@cache
def configuration(name: str, glider: str, low: float, high: float) -> Config:
    """The configuration of one glider with an estimator.

    `joint` learns the normal range of speed as it does where the configuration says nothing; the others are
    given it (m/s), as good as a pilot could know it. It is read from a file as the pilot's own, so that the
    score knows no setting that a pilot cannot make. Raises GliderwatchError where there is no such estimator.
    """
    algorithm, _, preset = check(name).partition(":")
    settings: dict[str, Any] = {"estimator": algorithm}
    if algorithm != "joint":
        settings["normal_speed"] = {"min": round(low, 4), "max": round(high, 4)}
    if preset:
        settings["preset"] = preset
    document = {"dockserver": {"roots": ["."]}, "gliders": {glider: settings}}
    with TemporaryDirectory(prefix="gliderwatch-") as folder:
        path = Path(folder) / "gliderwatch.yml"
        path.write_bytes(msgspec.json.encode(document))  # JSON is YAML
        return load(path)
