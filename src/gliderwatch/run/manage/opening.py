"""The state file as commands that change it open it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gliderwatch.config import Config
from gliderwatch.errors import ConfigError, StateError
from gliderwatch.store.database import SCHEMA
from gliderwatch.store.sqlite import Store
from gliderwatch.store.watch_health import schema_version


@contextmanager
def reading(config: Config) -> Iterator[Store]:
    """The state of a configuration, for looking only. Raises StateError where there is none."""
    store = Store.reading(Path(config.state.path))
    try:
        with store.guarded():
            yield store
    finally:
        store.close()


@contextmanager
def writing(config: Config) -> Iterator[Store]:
    """The state of a configuration, the service running or not; all that is written inside, or nothing.

    Raises StateError where there is none, or one that the service has to migrate first: the one that runs may
    be of the release before.
    """
    path = Path(config.state.path)
    version = schema_version(path)
    if version < SCHEMA:
        raise StateError(
            f"state file {path} is of an earlier release (schema {version}, now {SCHEMA}). "
            "What to do: systemctl restart gliderwatch, which takes it on"
        )
    store = Store.open(path)
    try:
        with store.transaction():
            yield store
    finally:
        store.close()


def known_glider(config: Config, name: str) -> str:
    """The name of a glider as it is kept. Raises ConfigError where it is not in the configuration."""
    if (found := name.lower()) not in config.gliders:
        raise ConfigError(
            f"there is no glider {name} in the configuration; known are: "
            f"{', '.join(sorted(config.gliders)) or 'none'}"
        )
    return found
