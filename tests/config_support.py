"""What the tests of settings share: a minimal file, and what is wrong with one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from gliderwatch.config import load
from gliderwatch.errors import ConfigError

MINIMAL = "dockserver: {roots: [/data]}\n"
Write = Callable[[str], Path]


def problems(path: Path) -> list[str]:
    """The lines of the error without the folder of the file."""
    with pytest.raises(ConfigError) as caught:
        load(path)
    return [line.removeprefix(f"{path.parent}/") for line in str(caught.value).splitlines()]
