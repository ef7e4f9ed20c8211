"""One root of errors, branched by what the caller does about them."""

from __future__ import annotations

from collections.abc import Iterable


class GliderwatchError(Exception):
    """Everything gliderwatch raises on purpose; its text is fit for a user."""


class Retry(GliderwatchError):
    """The input may be good later (a missing cache file, a share that is away): wait and try again."""


class MissingCache(Retry):
    """A file with a factored header whose sensor list (cache file) is not there yet.

    ``crc`` is the checksum that names the cache file, lower case, without a suffix; ``folders`` are those
    where it was looked for.
    """

    def __init__(self, crc: str, folders: Iterable[object] = ()) -> None:
        self.crc, self.folders = crc, tuple(map(str, folders))
        where = f"not in {', '.join(self.folders)}" if self.folders else "no folder is searched"
        super().__init__(f"cache file {crc}.cac is missing: {where}")

    def __reduce__(self) -> tuple[type[MissingCache], tuple[str, tuple[str, ...]]]:
        """What it is made of, so that it comes whole out of a worker process."""
        return type(self), (self.crc, self.folders)


class Quarantine(GliderwatchError):
    """The input will never be good as it is: note the reason, leave the file alone, go on."""


class NotAssessed(Quarantine):
    """The input could be read, but gliderwatch failed to assess it: a fault of its own."""


class ConfigError(GliderwatchError):
    """The configuration is wrong; the text names the file, the line and the cure."""


class StateError(GliderwatchError):
    """The state file cannot be used now; the text says which, why, and what to do."""


class DamagedError(StateError):
    """What the state file holds is not what was written: it has to be set aside and made anew."""


class LayoutError(StateError):
    """What the state file holds is whole, but no value that this gliderwatch knows: it is left as it is."""
