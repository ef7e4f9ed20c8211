"""What has to hold before the service starts: one list for `run`, which refuses, for `check` and `doctor`.

What hinders only now is not in it: another gliderwatch that uses the state file, a program that locks it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from gliderwatch import config as settings
from gliderwatch.config import Config, Problem, expand, secrets
from gliderwatch.delivery.mqtt import broker_of
from gliderwatch.errors import ConfigError, DamagedError, StateError
from gliderwatch.service import heartbeat
from gliderwatch.service.liveness import alive_path
from gliderwatch.slocum.folders import is_folder
from gliderwatch.store.database import read_only, refuse_foreign


@dataclass(frozen=True, slots=True)
class Refusal:
    """A reason not to start, at a ``key`` of the configuration. ``is_here_only``: what is asked for is only
    there inside of the service."""

    key: str
    text: str
    cure: str
    is_here_only: bool = False


def require(config: Config, path: Path) -> None:
    """Raises ConfigError, a line for each reason not to start with the configuration at `path`."""
    found = [
        Problem("error", _where(config, path, r), f"{r.key}: {r.text}", r.cure) for r in refusals(config)
    ]
    if found:
        raise ConfigError("\n".join(map(str, found)))


def check(config: Config, path: Path) -> list[Problem]:
    """All that is wrong with what the configuration at `path` names: what `run` refuses, and what else is not
    as it says. Nothing is sent or written."""
    return [
        *settings.check(config, path),
        *(
            Problem(
                "warning" if r.is_here_only else "error",
                _where(config, path, r),
                f"{r.key}: {r.text}",
                "credentials are only there inside of the service" if r.is_here_only else r.cure,
            )
            for r in refusals(config)
        ),
    ]


def refusals(config: Config) -> Iterator[Refusal]:
    """All reasons not to start."""
    for precondition in PRECONDITIONS:
        yield from precondition(config)


def _where(config: Config, path: Path, refusal: Refusal) -> str:
    return f"{path}:{config.locate(refusal.key)}"


def _place(config: Config) -> Iterator[Refusal]:
    """The state file may be made and written where it is to be, and nothing of it lies on the dockserver."""
    key, path = "state.path", Path(config.state.path)
    folder = next(parent for parent in path.parents if os.path.lexists(parent))  # the rest is made
    if not is_folder(folder):
        yield Refusal(key, f"{folder} is not a folder", "name a file in a folder")
    elif is_folder(path):
        yield Refusal(key, f"{path} is a folder", "name a file in it")
    elif not os.access(folder, os.W_OK | os.X_OK) or _is_closed(path) or _is_closed(alive_path(path)):
        cure = "let the user of the service write there (chown), or choose another state.path"
        yield Refusal(key, f"{path} cannot be written by this user", cure)
    elif is_folder(alive_path(path)):
        yield Refusal(key, f"{alive_path(path)} is a folder: it cannot be written", "move it away")
    for root in expand(config.dockserver.roots):
        if path.is_relative_to(root):
            yield Refusal(key, f"lies below the root {root}", "put it elsewhere")


def _pages(config: Config) -> Iterator[Refusal]:
    """The pages do not lie on the dockserver, nor does the file of virtual AIS."""
    for key, place in (("pages.folder", config.pages.folder), ("ais.file", config.ais.file)):
        for root in expand(config.dockserver.roots):
            if place is not None and Path(place).is_relative_to(root):
                yield Refusal(key, f"lies below the root {root}", "put it elsewhere")


def _is_closed(path: Path) -> bool:
    return os.access(path, os.F_OK) and not os.access(path, os.W_OK)


def _content(config: Config) -> Iterator[Refusal]:
    """What is in the state file is gliderwatch's, and of no later release. A damaged one is made again."""
    path = Path(config.state.path)
    try:
        refuse_foreign(path)
        if path.is_file() and path.stat().st_size:
            read_only(path).close()
    except DamagedError:
        return
    except StateError as error:
        yield Refusal("state.path", str(error), "see docs/state-file.md")
    except OSError as error:
        yield Refusal(
            "state.path", f"{path} cannot be read: {error.strerror}", "let the user of the service read it"
        )


def _heartbeat(config: Config) -> Iterator[Refusal]:
    """The URL of the dead man's switch can be fetched."""
    template = config.heartbeat.url
    try:
        heartbeat.address(config)
    except ConfigError as error:
        here = template is not None and _lacks_credentials(template.get_secret_value())
        yield Refusal("heartbeat.url", str(error), "correct it: the service does not start with it", here)


def _secrets(config: Config) -> Iterator[Refusal]:
    """The secrets of the channels can be had."""
    for name, channel in config.channels.items():
        template = channel.url.get_secret_value()
        try:
            secrets.resolve(template, config.folder)
        except ConfigError as error:
            cure = "set it where the service gets it from"
            yield Refusal(f"channels.{name}.url", str(error), cure, _lacks_credentials(template))


def _relays(config: Config) -> Iterator[Refusal]:
    """The broker of the relays can be named, and what speaks with it is installed."""
    if config.relays.broker is None:
        return
    key, template = "relays.broker", config.relays.broker.get_secret_value()
    try:
        broker_of(secrets.resolve(template, config.folder), config.relays.ca)
    except (ConfigError, ValueError) as error:
        cure = "correct it: the service does not start with it"
        yield Refusal(key, str(error), cure, _lacks_credentials(template))
    if find_spec("paho") is None:
        yield Refusal(key, "paho-mqtt is not installed", "docs/install.md says how")
    if config.relays.ca is not None and not os.access(config.relays.ca, os.R_OK):
        cure = "name a file of certificates that this user may read"
        yield Refusal("relays.ca", f"{config.relays.ca} cannot be read", cure)


def _lacks_credentials(template: str) -> bool:
    return secrets.needs_credentials(template) and secrets.CREDENTIALS not in os.environ


PRECONDITIONS: tuple[Callable[[Config], Iterator[Refusal]], ...] = (
    _place,
    _pages,
    _content,
    _heartbeat,
    _secrets,
    _relays,
)
