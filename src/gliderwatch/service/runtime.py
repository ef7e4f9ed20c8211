"""What the daemon is made of: everything that follows from one configuration, replaced as a whole."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from queue import SimpleQueue

import structlog

from gliderwatch.config import Config, expand
from gliderwatch.delivery import links
from gliderwatch.delivery.channels import Channel
from gliderwatch.delivery.dispatcher import Dispatcher, Sender
from gliderwatch.errors import GliderwatchError
from gliderwatch.model import Segment
from gliderwatch.sea.ocean_field import Field
from gliderwatch.service.backlog import Backlog, Job
from gliderwatch.service.fields import FleetField, fields_of
from gliderwatch.service.layers import science_of
from gliderwatch.service.mail_pictures import MailPictures
from gliderwatch.service.page_writer import PagesWritten
from gliderwatch.service.relays import BatchesCame, RelayExchange, relay_settings
from gliderwatch.service.routing import Routing, routing_of
from gliderwatch.service.run import Processed, Run, RunWorkers
from gliderwatch.slocum.caches import SensorLists, lists_folder
from gliderwatch.slocum.decode import Decoder
from gliderwatch.slocum.folders import Settling
from gliderwatch.slocum.watch import Change, Watcher
from gliderwatch.store.outbox import Outbox

# ----------------------------------------
# The files of an ocean model, read again when they change.

log = structlog.get_logger(__name__)


class OceanCache:
    """The field of the `ocean:` section; nothing is read while no glider is compared with it."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._seen: tuple[tuple[str, int, int], ...] | None = None
        self._field: Field | None = None

    def field(self, glider: str) -> Field | None:
        """The field to compare a glider with; None where none is wanted or the files cannot be read."""
        if self._config.glider(glider).reference not in ("model", "fleet") or not self._config.ocean.files:
            return None
        seen = tuple(_state(path) for path in expand(self._config.ocean.files))
        if seen != self._seen:
            self._seen, self._field = seen, self._read()
        return self._field

    def _read(self) -> Field | None:
        from gliderwatch.sea.ocean_files import Box, read_field  # noqa: PLC0415 (xarray is slow to load)

        ocean = self._config.ocean
        area = None if ocean.area is None else Box(**dict(ocean.area))
        try:
            return read_field(ocean.files, area, ocean.stale_hours * 3600)
        except GliderwatchError as error:
            log.warning(
                "ocean model cannot be read: dives get no reference flow",
                paths=list(ocean.files),
                reason=str(error),
            )
            return None


def _state(path: Path) -> tuple[str, int, int]:
    try:
        status = path.stat()
    except OSError:
        return str(path), 0, 0
    return str(path), status.st_size, status.st_mtime_ns


# ----------------------------------------
# What the daemon is made of: everything that follows from one configuration, replaced as a whole.


@dataclass(frozen=True, slots=True)
class Decoded:
    """News of the decoder: a job of a backlog is done."""

    backlog: Backlog
    job: Job
    future: Future[Segment]

    @property
    def outcome(self) -> Segment | Exception:
        """The segment, or why there is none."""
        error = self.future.exception()
        return error if isinstance(error, Exception) else self.future.result()


@dataclass(frozen=True, slots=True)
class Ran:
    """News of a worker: a run of a glider's files is processed, or could not be."""

    backlog: Backlog
    glider: str
    future: Future[Processed]


News = Change | Decoded | Ran | PagesWritten | BatchesCame | signal.Signals


@dataclass(frozen=True, slots=True)
class Runtime:
    """A configuration and what works by it; ``pictures`` draws those of mails."""

    config: Config
    news: SimpleQueue[News]
    workers: int
    routing: Routing
    settling: Settling
    watcher: Watcher
    decoder: Decoder
    workers_of_runs: RunWorkers
    lists: SensorLists
    backlog: Backlog
    dispatcher: Dispatcher
    ocean: OceanCache
    fields: tuple[FleetField, ...]
    channels: dict[str, Channel]
    pictures: MailPictures
    relays: RelayExchange | None = None

    def start(self, before: Runtime | None = None) -> None:
        """Begin to work, in place of the parts before."""
        if before is None or before.dispatcher is not self.dispatcher:
            self.dispatcher.start()
        if self.relays is not None and (before is None or before.relays is not self.relays):
            self.relays.start()
        self.watcher.start()

    def stop(self, after: Runtime | None = None) -> None:
        """End all work; the decoder, and a dispatcher that the parts after go on with, are left to them."""
        self.watcher.stop()
        if after is None:
            self.decoder.close()
            self.workers_of_runs.stop()
        if after is None or after.dispatcher is not self.dispatcher:
            self.dispatcher.stop()
            self.pictures.stop()
        if self.relays is not None and (after is None or after.relays is not self.relays):
            self.relays.stop()

    def cache_folders(self) -> tuple[Path, ...]:
        """Where sensor lists are now: the cache folders, then the lists that came inside of files."""
        return (*self.watcher.cache_folders(), self.lists.folder)

    def feed(self) -> None:
        """Keep the decoder busy, with no more than it can take."""
        while self.backlog.decoding < 2 * self.workers and (job := self.backlog.next()) is not None:
            job.begun = time.monotonic()
            self.decoder.submit(Path(job.file.path)).add_done_callback(partial(self._decoded, job))

    def process(self, glider: str, run: Run, is_kept: Sequence[bool]) -> None:
        """Have a run of a glider's next files processed by a worker."""
        future = self.workers_of_runs.submit(run, self.config.glider(glider), is_kept)
        self.backlog.begin_run(glider, len(run.segments))
        future.add_done_callback(lambda done: self.news.put(Ran(self.backlog, glider, done)))

    def _decoded(self, job: Job, future: Future[Segment]) -> None:
        self.news.put(Decoded(self.backlog, job, future))


def _send_alike(before: Runtime, config: Config, channels: dict[str, Channel]) -> bool:
    """Whether messages go out as they did before: by channels that are as they were, with the same links, and
    maps of the same files."""
    return (
        before.config.web.public_url == config.web.public_url
        and before.config.maps.files == config.maps.files
        and before.channels.keys() == channels.keys()
        and all(channel.is_as(before.channels[name]) for name, channel in channels.items())
    )


def _sending(
    config: Config, wake: threading.Event, before: Runtime | None
) -> tuple[Dispatcher, dict[str, Channel], MailPictures]:
    """What sends messages, by which channels and with which pictures; those before, where they are alike."""
    state = Path(config.state.path)
    pictures = MailPictures(state, config.attention, time.time, config.maps.files)
    channels = {name: config.channel(name, pictures) for name in config.channels}
    if before is not None and _send_alike(before, config, channels):
        before.pictures.attention = config.attention
        return before.dispatcher, before.channels, before.pictures
    return _dispatcher(config, channels, state, wake), channels, pictures


def _dispatcher(
    config: Config, channels: dict[str, Channel], state: Path, wake: threading.Event
) -> Dispatcher:
    """What sends messages by some channels, with links where the configuration has a public address."""
    senders: dict[str, Sender] = dict(channels)
    if config.web.public_url is not None:
        senders = links.linked(senders, str(config.web.public_url), state)
    return Dispatcher(lambda: Outbox(state), senders, time.time, wake)


def build(
    config: Config,
    news: SimpleQueue[News],
    wake: threading.Event,
    workers: int,
    before: Runtime | None = None,
) -> Runtime:
    """The parts of a configuration, not started.

    Raises ConfigError where a secret is missing, GliderwatchError where links cannot be signed.

    With the channels of the parts before their dispatcher goes on: a message that is on its way when the
    configuration is read again is then not sent a second time. Their decoder goes on always, with its worker
    processes.
    """
    dispatcher, channels, pictures = _sending(config, wake, before)
    watcher = Watcher(
        config.dockserver.roots,
        {name: glider.paths for name, glider in config.gliders.items()},
        config.dockserver.cache,
        news,
        config.dockserver.observer,
        logs=config.dockserver.logs,
    )
    ocean, routing, relays = OceanCache(config), routing_of(config), _relays(config, news, before)
    lists = SensorLists(lists_folder(Path(config.state.path)))
    # shared: what follows can no longer refuse the configuration
    decoder = Decoder((), max_workers=workers) if before is None else before.decoder
    runs = RunWorkers() if before is None else before.workers_of_runs
    parts = Runtime(
        config,
        news,
        workers,
        routing,
        Settling(config.dockserver.settle_seconds),
        watcher,
        decoder,
        runs,
        lists,
        Backlog(),
        dispatcher,
        ocean,
        fields_of(config),
        channels,
        pictures,
        relays,
    )
    decoder.science = science_of(config)
    decoder.cache_folders = parts.cache_folders()
    return parts


def _relays(config: Config, news: SimpleQueue[News], before: Runtime | None) -> RelayExchange | None:
    """The exchange with other relays; the one before, where its settings are the same."""
    settings = relay_settings(config)
    if settings is None:
        return None
    if before is not None and before.relays is not None and before.relays.settings == settings:
        return before.relays
    return RelayExchange(settings, Path(config.state.path), news.put)
