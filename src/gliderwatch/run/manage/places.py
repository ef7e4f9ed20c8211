"""Where a command may write: never below the folders of a dockserver, whose programs take what lies there."""

from __future__ import annotations

from pathlib import Path

from gliderwatch.config import Config, expand
from gliderwatch.errors import GliderwatchError


def not_on_dockserver(config: Config, file: Path) -> Path:
    """The file to be written. Raises GliderwatchError where it lies below a folder that is only read."""
    place = file.parent.resolve() / file.name
    folders = [*config.dockserver.roots, *config.dockserver.cache]
    folders += [path for glider in config.gliders.values() for path in glider.paths]
    for folder in expand(folders):
        if place.is_relative_to(folder.resolve()):
            raise GliderwatchError(
                f"{file} lies below {folder}, where the dockserver's files are: nothing is written there. "
                "Name another place"
            )
    return file
