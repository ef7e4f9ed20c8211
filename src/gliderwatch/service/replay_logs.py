"""The logs of calls in a replay: each has its turn when the call had ended."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from gliderwatch.service import triage
from gliderwatch.slocum.calls import Dialog
from gliderwatch.slocum.folders import is_log
from gliderwatch.store.state_file import File, Store


@dataclass(frozen=True, slots=True)
class Log:
    """A log as it was read; ``dialog`` is None where it could not be."""

    file: File
    dialog: Dialog | None

    @property
    def sent(self) -> float:
        """When the call was over (s); a log that tells nothing comes first."""
        return 0.0 if self.dialog is None else self.dialog.call.last_t


def find_logs(folders: Iterable[Path]) -> list[Path]:
    """All logs of calls below some folders, each once."""
    found = {
        path.resolve() if path.is_symlink() else path: None
        for folder in folders
        for path in sorted([folder] if folder.is_file() else folder.rglob("*.[lL][oO][gG]"))
        if is_log(path.name) and not path.is_dir()
    }
    return list(found)


def read_logs(paths: Iterable[Path], store: Store, is_wanted: Callable[[str], bool]) -> list[Log]:
    """The logs at some paths, in the order in which the calls were over."""
    found = (triage.judge_log(path, store, is_wanted) for path in paths)
    return sorted((Log(*one) for one in found if one is not None), key=lambda log: (log.sent, log.file.path))
