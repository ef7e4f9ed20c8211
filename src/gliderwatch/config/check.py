"""Does what the settings name exist? Folders, caches, the state, channels; nothing is sent or written."""

from __future__ import annotations

import os
import shutil
from collections.abc import Container, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from gliderwatch.config import secrets
from gliderwatch.config.document import Problem
from gliderwatch.config.fields import expand
from gliderwatch.config.loading import Config
from gliderwatch.errors import ConfigError
from gliderwatch.slocum.folders import FROM_GLIDER, Link, Survey, is_folder, survey

_CACHES = {".cac", ".ccc"}
_FREE_BYTES = 200e6
_LET_READ = "let this user read it: gliderwatch doctor says by which mode, group or ACL"


@dataclass(frozen=True, slots=True)
class _Finding:
    severity: Literal["error", "warning"]
    key: str
    text: str
    cure: str


_Findings = Iterator[_Finding]


def check(config: Config, path: Path) -> list[Problem]:
    """Everything outside of the settings file ``path`` that is not as it says, with the line, but for what
    the service does not start with (`service.preconditions`).

    What can be read depends on the user: run it as the user that runs the service.
    """
    parts = (_roots, _gliders, _caches, _state, _channels, _recipients, _maps)
    return _problems(config, path, (found for part in parts for found in part(config)))


def check_maps(config: Config, path: Path) -> list[Problem]:
    """Files of maps that cannot be used."""
    return _problems(config, path, _maps(config))


def _problems(config: Config, path: Path, findings: Iterable[_Finding]) -> list[Problem]:
    return [
        Problem(each.severity, f"{path}:{config.locate(each.key)}", f"{each.key}: {each.text}", each.cure)
        for each in findings
    ]


def _error(key: str, text: str, cure: str) -> _Finding:
    return _Finding("error", key, text, cure)


def _warning(key: str, text: str, cure: str) -> _Finding:
    return _Finding("warning", key, text, cure)


def _can_read(folder: Path) -> bool:
    return is_folder(folder) and os.access(folder, os.R_OK | os.X_OK)


def _folders(section: str, patterns: tuple[str, ...]) -> Iterator[tuple[str, Path]]:
    """Key and folder of everything that patterns of the settings match."""
    for i, pattern in enumerate(patterns):
        for folder in expand([pattern]):
            yield f"{section}.{i}", folder


def _unusable(section: str, patterns: tuple[str, ...]) -> _Findings:
    """Paths and patterns without a folder, and folders that cannot be read."""
    for i, pattern in enumerate(patterns):
        key, matches = f"{section}.{i}", expand([pattern])
        folders = [match for match in matches if is_folder(match)]
        if not matches:
            cure = "correct the path, or create it; a folder above it may also be closed to this user"
            yield _error(key, f"{pattern} is not there", cure)
        elif not folders:
            yield _error(key, f"{pattern} is not a folder", "name the folder")
        for folder in folders:
            if not _can_read(folder):
                yield _error(key, f"{folder} cannot be read", _LET_READ)


def _roots(config: Config) -> _Findings:
    roots = config.dockserver.roots
    yield from _unusable("dockserver.roots", roots)
    for key, folder in _folders("dockserver.roots", roots):
        if is_folder(folder / FROM_GLIDER):
            yield _error(key, f"{folder} is the folder of one glider", f"give {folder.parent}")


def linked_gliders(config: Config, names: Container[str]) -> dict[str, Link]:
    """Gliders among `names` without a folder that is seen, with the link that stands in its place."""
    return _linked(config, _survey(config), names)


def _linked(config: Config, found: Survey, names: Container[str]) -> dict[str, Link]:
    return {
        name: link
        for name, link in found.links.items()
        if name in names and name not in found.gliders and not config.gliders[name].paths
    }


def _survey(config: Config) -> Survey:
    roots = (folder for _, folder in _folders("dockserver.roots", config.dockserver.roots))
    return survey(folder for folder in roots if _can_read(folder))


def _gliders(config: Config) -> _Findings:
    seen = _survey(config)
    found = seen.gliders
    for folder in seen.closed:
        yield _warning("dockserver.roots", f"{folder} cannot be read: nothing below it is watched", _LET_READ)
    if not config.gliders:
        yield _warning("gliders", "no glider is configured: none is watched", "add their names")
    links = _linked(config, seen, config.gliders)
    for name, glider in config.gliders.items():
        key = f"gliders.{name}"
        yield from _unusable(f"{key}.paths", glider.paths)
        if name in links:
            yield _error(key, str(links[name]), links[name].cure)
        elif name not in found and not glider.paths:
            cure = "wait for its first file, correct the name, or give `paths`"
            yield _warning(key, f"no folder {name}/{FROM_GLIDER} below the roots", cure)
        for folder in found.get(name, []):
            if not _can_read(folder):
                yield _error(key, f"{folder} cannot be read", _LET_READ)
    strangers = sorted(set(found) - set(config.gliders))
    if strangers:
        text = f"not configured, so not watched: {', '.join(strangers)}"
        yield _warning("gliders", text, "add those that fly")


def _caches(config: Config) -> _Findings:
    key, patterns = "dockserver.cache", config.dockserver.cache
    yield from _unusable(key, patterns)
    if not patterns:
        yield _warning(key, "no cache folder: most files cannot be read", "name the folder of `.cac`")
    for place, folder in _folders(key, patterns):
        if _can_read(folder) and not any(file.suffix.lower() in _CACHES for file in folder.iterdir()):
            yield _warning(place, f"{folder} holds no .cac or .ccc", "correct the path")


def _state(config: Config) -> _Findings:
    path = Path(config.state.path)
    folder = next(parent for parent in path.parents if is_folder(parent))  # the daemon makes the rest
    if shutil.disk_usage(folder).free < _FREE_BYTES:
        yield _warning("state.path", f"less than {_FREE_BYTES / 1e6:g} MB are free in {folder}", "make room")


def _channels(config: Config) -> _Findings:
    for name, channel in config.channels.items():
        key = f"channels.{name}.url"
        try:
            url = secrets.resolve(channel.url.get_secret_value(), config.folder)
        except ConfigError:
            continue  # the service does not start with it: see `service.preconditions`
        from gliderwatch.delivery.channels import problem  # noqa: PLC0415 (apprise behind it is slow to load)

        found = problem(url)
        if found:
            yield _error(key, found, "compare with https://github.com/caronc/apprise/wiki")
        elif channel.pictures and not url.startswith(("mailto:", "mailtos:")):
            cure = "remove `pictures`, or name a mail channel"
            yield _warning(f"channels.{name}.pictures", "only mails have pictures", cure)


def _recipients(config: Config) -> _Findings:
    if not config.recipients:
        yield _warning("recipients", "there are none: nobody gets a message", "add one")
        return
    used = {channel for recipient in config.recipients.values() for channel in recipient.channels}
    for channel in sorted(set(config.channels) - used):
        yield _warning(f"channels.{channel}", "no recipient uses it", "name it in one")
    late: list[str] = []
    for glider in sorted(config.gliders):
        hear = [r for r in config.recipients.values() if r.gliders is None or glider in r.gliders]
        if not hear:
            yield _warning(f"gliders.{glider}", "no recipient gets its alerts", "name it in one")
        elif all(r.unacknowledged_minutes is not None for r in hear):
            late.append(glider)
    if late:
        text = f"nobody gets the alerts of these at once: {', '.join(late)}"
        yield _warning("recipients", text, "leave `unacknowledged_minutes` out for who is on duty")


def _maps(config: Config) -> _Findings:
    for i, file in enumerate(config.maps.files):
        from gliderwatch.figures.map_files import land_or_world  # noqa: PLC0415 (shapely is slow to load)

        _, reason = land_or_world([file])
        if reason:
            yield _error(f"maps.files.{i}", reason, "maps are drawn without it until then")
