"""Watches the folders of a dockserver and puts what changes on a queue. Nothing is ever written there."""

from __future__ import annotations

import ctypes
import errno
import logging
import os
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

from watchdog.events import (
    DirCreatedEvent,
    DirMovedEvent,
    FileClosedEvent,
    FileCreatedEvent,
    FileModifiedEvent,
    FileMovedEvent,
    FileSystemEvent,
    FileSystemEventHandler,
)
from watchdog.observers.api import BaseObserver, ObservedWatch
from watchdog.observers.inotify import InotifyFullEmitter
from watchdog.observers.inotify_c import (
    InotifyConstants,
    InotifyEvent,
    InotifyFD,
    inotify_add_watch,
    inotify_init,
)
from watchdog.observers.polling import PollingObserverVFS

from gliderwatch.slocum.folders import (
    IGNORED,
    Found,
    Place,
    expand,
    find_places,
    is_cache,
    is_folder,
    is_log,
    is_science,
    kind,
    scan,
)

# The journal is read by people. Watchdog warns, with all that it watches, of each folder that it meets
# twice, by its event and as it walks the folder above, and calls it an error that an emitter is stopped.
warnings.filterwarnings("ignore", "Callback with id", RuntimeWarning)
logging.getLogger("watchdog.observers.inotify").setLevel(logging.CRITICAL)

_BESIDE = frozenset({"to-glider", "configuration"})
"""Folders beside `from-glider` without data: not polled, for a share may be slow."""
_STOP_SECONDS = 2.0
_LIMITS = (errno.ENOSPC, errno.EMFILE)
_CURE = "raise fs.inotify.max_user_watches and max_user_instances with sysctl, or set observer: polling,"
_INOTIFY: list[type[FileSystemEvent]] = [
    FileClosedEvent,
    FileModifiedEvent,
    FileMovedEvent,
    DirCreatedEvent,
    DirMovedEvent,
]
_POLLING: list[type[FileSystemEvent]] = [FileCreatedEvent, *_INOTIFY]


@dataclass(frozen=True, slots=True)
class FileChanged:
    """A file of flight data or a log was written, came or went; ``glider_folder`` as in `Found`."""

    path: Path
    glider_folder: str


@dataclass(frozen=True, slots=True)
class ScienceChanged:
    """A science file of a glider was written, came or went: the flight file beside it may need it."""

    path: Path


@dataclass(frozen=True, slots=True)
class CacheChanged:
    """A cache file was written, or came: files that wait for one can be tried again."""

    path: Path


@dataclass(frozen=True, slots=True)
class TreeChanged:
    """A folder came, or is watched from now on: scan, for files may have come to it unseen."""

    path: Path


@dataclass(frozen=True, slots=True)
class EventsLost:
    """Inotify could not keep up and lost events: restart the watcher, and scan."""


Change = FileChanged | ScienceChanged | CacheChanged | TreeChanged | EventsLost


class Sink(Protocol):
    """Where changes are put, from watchdog's threads: a queue."""

    def put(self, change: Change, /) -> object:
        """Takes a change and does not wait."""


class Watcher:
    """Puts a `Change` on a queue for whatever happens in the given folders.

    `roots`, the paths of `explicit` (by glider) and `caches` may hold glob patterns, and may not
    exist yet: `refresh`, to be called before every rescan, finds what came and went. The polling
    observer looks every `poll_seconds`. Where the system lets inotify watch no more, polling takes
    its place until the next start, and `problems` says so. With `logs` also the logs of calls are watched.
    All methods are for one thread.
    """

    def __init__(
        self,
        roots: Sequence[str | Path],
        explicit: Mapping[str, Sequence[str | Path]],
        caches: Sequence[str | Path],
        on_change: Sink,
        observer: Literal["inotify", "polling"] = "inotify",
        poll_seconds: float = 5.0,
        logs: bool = True,
    ) -> None:
        self._logs = logs
        self._roots, self._explicit, self._cache_patterns = roots, explicit, caches
        self._queue, self._kind, self._poll_seconds = on_change, observer, poll_seconds
        self._observer: BaseObserver | None = None
        self._instead = ""
        self._watches: dict[Path, tuple[ObservedWatch, tuple[int, int]]] = {}
        self._places: list[Place] = []
        self._caches: list[Path] = []
        self._unwatched: list[str] = []
        self._unread: list[str] = []

    @property
    def problems(self) -> tuple[str, ...]:
        """What could not be watched, as of the last `refresh`, or read, as of the last `scan`, and why."""
        return (*filter(None, [self._instead]), *self._unwatched, *self._unread)

    def cache_folders(self) -> tuple[Path, ...]:
        """The cache folders that exist now."""
        return tuple(path for path in expand(self._cache_patterns) if is_folder(path))

    def scan(self) -> Iterator[Found]:
        """All files of flight data that are there now, each once, folder by folder."""
        self._unread = []
        found = scan(find_places(self._roots, self._explicit), self._unread)
        return (file for file in found if self._logs or not is_log(file.path.name))

    def start(self) -> None:
        """Begins to watch. What cannot be watched is in `problems`; `alive` tells whether it can at all."""
        self._instead = ""
        try:
            self._begin()
        except OSError as error:
            if self._polls():
                self._unwatched = [f"folders cannot be watched: {error.strerror or error}"]
            else:
                self._poll_instead("folders", error)

    def _begin(self) -> None:
        observer: BaseObserver
        if self._polls():
            observer = PollingObserverVFS(os.lstat, _polled, polling_interval=self._poll_seconds)
        else:
            observer = _InotifyObserver(lambda: self._queue.put(EventsLost()))
        observer.start()
        self._observer = observer
        self.refresh()

    def _polls(self) -> bool:
        return self._kind == "polling" or bool(self._instead)

    def _poll_instead(self, what: str, error: OSError) -> None:
        """Look at everything again and again, as inotify watches no more; until the next start."""
        self.stop()
        self._instead = (
            f"inotify cannot watch {what} ({error.strerror or error}): all folders are polled every"
            f" {self._poll_seconds:g} s; {_CURE} and restart"
        )
        try:
            self._begin()
        except OSError as worse:
            self._unwatched = [f"folders cannot be watched: {worse.strerror or worse}"]

    def refresh(self) -> None:
        """Watches folders that came or were replaced, and leaves those that went."""
        if self._observer is None:
            return
        self._places = find_places(self._roots, self._explicit)
        self._caches = expand(self._cache_patterns)
        recursive = dict.fromkeys(self._caches, False) | {place.path: True for place in self._places}
        for path in [path for path in self._watches if not self._valid(path, self._observer)]:
            self._leave(path, self._observer)
        for path in self._watches.keys() - recursive.keys():
            self._leave(path, self._observer)
        self._unwatched = []
        for path in recursive.keys() - self._watches.keys():
            try:
                self._watch(path, recursive[path], self._observer)
            except OSError as error:
                if error.errno in _LIMITS and not self._polls():
                    self._poll_instead(str(path), error)
                    return
                self._unwatched.append(f"{path} cannot be watched: {error.strerror or error}")
        if not self._polls() and (full := _full()) is not None:
            self._poll_instead("every folder", full)

    def alive(self) -> bool:
        """Whether every thread that watches lives; that of a folder that is gone need not."""
        observer = self._observer
        if observer is None or not observer.is_alive():
            return False
        reads = not isinstance(observer, _InotifyObserver) or observer.reader.is_alive()
        emitters = [emitter for emitter in observer.emitters if is_folder(Path(emitter.watch.path))]
        return reads and all(emitter.is_alive() for emitter in emitters)

    def restart(self) -> None:
        """Begins again with a new observer."""
        self.stop()
        self.start()

    def stop(self) -> None:
        """Ends all threads."""
        observer, self._observer = self._observer, None
        self._watches.clear()
        if observer is not None:
            observer.stop()
            observer.join(_STOP_SECONDS)

    def _watch(self, path: Path, recursive: bool, observer: BaseObserver) -> None:
        identity = _identity(path)
        if not is_folder(path):
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR))
        events = _POLLING if self._polls() else _INOTIFY
        watch = observer.schedule(_Handler(self), str(path), recursive=recursive, event_filter=events)
        self._watches[path] = (watch, identity)
        self._queue.put(TreeChanged(path))

    def _leave(self, path: Path, observer: BaseObserver) -> None:
        watch, _ = self._watches.pop(path)
        with suppress(KeyError, OSError):  # what watchdog kept of it may have ended with the folder
            observer.unschedule(watch)

    def _valid(self, path: Path, observer: BaseObserver) -> bool:
        """Whether a watch still sees the folder at its path: it may be gone, or another one by now."""
        watch, identity = self._watches[path]
        try:
            same = _identity(path) == identity
        except OSError:
            return False
        return same and any(emitter.watch == watch and emitter.is_alive() for emitter in observer.emitters)

    def _changed(self, path: Path, is_directory: bool, is_growing: bool) -> None:
        """Report a change; of what grows only a log is read before its writer has closed it."""
        reads_on = self._logs and is_log(path.name)
        if is_growing and not reads_on and not self._polls():
            return
        if is_directory:
            self._queue.put(TreeChanged(path))
        elif is_cache(path.name) and path.parent in self._caches:
            self._queue.put(CacheChanged(path))
        elif reads_on or kind(path.name) or is_science(path.name):
            below = (place.glider_folder(path) for place in self._places)
            glider_folder = next((folder for folder in below if folder), None)
            if glider_folder:
                is_flight = kind(path.name) is not None
                self._queue.put(FileChanged(path, glider_folder) if is_flight else ScienceChanged(path))


class _Reader(InotifyFD):
    """Reads what inotify reports for all folders, and reports an overflow of its queue as such.

    Watchdog alone would watch again what is at each path at that moment, if anything is, and never look
    again: a root that is away just then would be unwatched for good.
    """

    def __init__(self, on_overflow: Callable[[], object]) -> None:
        super().__init__()
        self._on_overflow = on_overflow

    def handle_event(self, event: InotifyEvent) -> None:
        """Pass on one event."""
        if event.is_queue_overflow:
            self._on_overflow()
        else:
            super().handle_event(event)


class _InotifyObserver(BaseObserver):
    """Watchdog's observer by inotify with a `_Reader` of our own, which runs from the start."""

    def __init__(self, on_overflow: Callable[[], object]) -> None:
        self.reader = _Reader(on_overflow)
        self.reader.start()
        # The full emitter reports a file that was moved in apart from one that has only been begun.
        super().__init__(InotifyFullEmitter, inotify_fd=self.reader)

    def on_thread_stop(self) -> None:
        """End the emitters, then the reader they are served by."""
        super().on_thread_stop()
        self.reader.stop()
        self.reader.join()


class _Handler(FileSystemEventHandler):
    def __init__(self, watcher: Watcher) -> None:
        self._watcher = watcher

    def on_any_event(self, event: FileSystemEvent) -> None:
        for path in (event.src_path, event.dest_path):
            # An exception here would end watchdog's thread in silence; the rescan finds the file.
            with suppress(Exception):
                if path:
                    is_growing = isinstance(event, FileModifiedEvent)
                    self._watcher._changed(Path(os.fsdecode(path)), event.is_directory, is_growing)


def _full() -> OSError | None:
    """Why no more folders can be watched; None: they can. Watchdog is silent on sub-folders it left out."""
    instance = inotify_init()
    if instance < 0:
        return None  # there may be no further instance, but the one that watches is there
    try:
        added = inotify_add_watch(instance, b"/", InotifyConstants.IN_DELETE_SELF)
        number = ctypes.get_errno()
    finally:
        os.close(instance)
    return OSError(number, "inotify watch limit reached") if added < 0 and number == errno.ENOSPC else None


def _identity(path: Path) -> tuple[int, int]:
    status = path.stat()
    return status.st_dev, status.st_ino


def _polled(folder: str | None) -> Iterator[os.DirEntry[str]]:
    with os.scandir(folder) as entries:
        return iter([entry for entry in entries if entry.name.lower() not in IGNORED | _BESIDE])
