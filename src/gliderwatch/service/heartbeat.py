"""The daemon looks after itself: is all well, and who is to know.

Whether the decoder comes round, the beat of a dead man's switch, and `Upkeep`, which puts these, the messages
to the operator and the numbers for Prometheus together for the daemon.
"""

from __future__ import annotations

import threading
import time
import urllib.request
from http.client import HTTPException
from pathlib import Path
from urllib.parse import urlsplit

import structlog

from gliderwatch import __version__
from gliderwatch.config import Config, secrets
from gliderwatch.delivery.channels import scrub
from gliderwatch.delivery.dispatcher import Dispatcher
from gliderwatch.errors import ConfigError
from gliderwatch.model import Alert
from gliderwatch.service.backlog import Job
from gliderwatch.service.metrics import Metrics
from gliderwatch.service.operator_alerts import Operator
from gliderwatch.service.transaction import FileOutcome
from gliderwatch.store.state_file import Store

log = structlog.get_logger(__name__)

STALLED = 60.0
"""Seconds without progress after which the dispatcher counts as stuck."""
ANSWER = 15.0
"""Seconds to wait for the server of the URL."""
DECODING = 120.0
"""Seconds in which a file of no size is decoded or given up: the decoder's own limit, and as much again."""
_PER_BYTE = 1e-6
"""Seconds more for each byte, as the decoder allows."""


class Decoding:
    """Whether the decoder comes round. Times are monotonic (s)."""

    def __init__(self) -> None:
        self._since: float | None = None
        self._largest = 0

    def expect(self, size: int) -> None:
        """A file of `size` bytes is going to be decoded."""
        self._largest = max(self._largest, size)

    def look(self, at_work: int, now: float) -> None:
        """So many files are in work now."""
        if not at_work:
            self._since, self._largest = None, 0
        elif self._since is None:
            self._since = now

    def done(self, now: float) -> None:
        """A file has been decoded, or given up."""
        self._since = now

    def late(self, now: float) -> float:
        """Seconds since something was done, beyond what the largest file may take; negative while well."""
        return float("-inf") if self._since is None else now - self._since - self._allowed()

    def _allowed(self) -> float:
        return DECODING + _PER_BYTE * self._largest


class Heartbeat:
    """Touches a file and fetches a URL, in a thread of its own: neither may hold up the watch.

    A share that hangs or a server that does not answer delays only the next sign, which is then left out.
    """

    def __init__(self, file: Path | None, url: str | None, seconds: float) -> None:
        self._file, self._url, self._seconds = file, url, seconds
        self._next = float("-inf")
        self._thread: threading.Thread | None = None

    @classmethod
    def of(cls, config: Config) -> Heartbeat:
        """As configured. Raises ConfigError where the URL cannot be used."""
        settings = config.heartbeat
        file = Path(settings.file) if settings.file is not None else None
        return cls(file, address(config), settings.minutes * 60.0)

    def beat(self, now: float) -> None:
        """All is well at `now` (monotonic, s): give a sign if one is due."""
        if now < self._next or (self._file is None and self._url is None):
            return
        if self._thread is not None and self._thread.is_alive():
            log.warning("heartbeat is late: the one before has not come back")
        else:
            self._thread = threading.Thread(target=self._give, name="heartbeat", daemon=True)
            self._thread.start()
        self._next = now + self._seconds

    def _give(self) -> None:
        if self._file is not None:
            try:
                self._file.touch()
            except OSError as error:
                log.warning("heartbeat not given", path=str(self._file), reason=error.strerror)
        if self._url is not None:
            reason = fetch(self._url)
            if reason:
                log.warning("heartbeat not given", reason=reason)


def fetch(url: str) -> str | None:
    """Fetch a URL; what went wrong, in words without its secrets, None when nothing did."""
    request = urllib.request.Request(url, headers={"User-Agent": f"gliderwatch/{__version__}"})
    try:
        with urllib.request.urlopen(request, timeout=ANSWER) as answer:
            answer.read(1)
    except (OSError, HTTPException, ValueError) as error:  # a refusal (HTTPError) is an OSError too
        return scrub(f"{urlsplit(url).hostname}: {str(error) or type(error).__name__}", url)
    return None


def address(config: Config) -> str | None:
    """The URL to fetch with its references filled in. Raises ConfigError where it cannot be used."""
    template = config.heartbeat.url
    if template is None:
        return None
    found = secrets.resolve(template.get_secret_value(), config.folder)
    try:
        parts = urlsplit(found)
        usable = parts.scheme in {"http", "https"} and bool(parts.hostname) and parts.port != 0
    except ValueError:
        raise ConfigError("is no URL") from None
    if not usable:
        raise ConfigError("must be an http or https URL")
    return found


class Upkeep:
    """All that looks after the daemon itself; used in its thread.

    Made from a configuration and the store of the daemon; `use` comes before all else.
    """

    def __init__(self, config: Config, store: Store) -> None:
        state = Path(config.state.path)
        self._store = store
        self._operator = Operator(store, state, config, time.time(), time.monotonic())
        self._metrics = Metrics(state, config)

    def use(self, config: Config) -> None:
        """Go by these settings. Raises ConfigError where the URL of the heartbeat cannot be used."""
        self._config, self._heartbeat, self._decoding = config, Heartbeat.of(config), Decoding()
        self._metrics.forget(config)
        self._metrics.serve(config.metrics)

    def stop(self) -> None:
        """Nothing is served any more."""
        self._metrics.stop()

    def queued(self, job: Job) -> None:
        """A file is going to be decoded."""
        self._decoding.expect(job.file.size)

    def decoded(self, job: Job) -> None:
        """A file has been decoded, or given up."""
        self._decoding.done(time.monotonic())
        begun = getattr(job, "begun", None)
        if begun is not None:
            self._metrics.decode.observe(time.monotonic() - begun)

    def processed(self, outcome: FileOutcome, seconds: float | None = None) -> None:
        """A file led to an outcome; to process it took so many `seconds`, if it was decoded."""
        self._operator.came(outcome.file.glider, time.monotonic())
        self._metrics.came(outcome.file, time.time())
        self._metrics.assessed(outcome.assessments)
        if seconds is not None:
            self._metrics.assess.observe(seconds)
            self._decoding.done(time.monotonic())  # what was decoded meanwhile had to wait for this loop

    def is_well(self, dispatcher: Dispatcher, in_work: int) -> bool:
        """Whether dispatcher and workers, with so much in work, make progress, as this loop does."""
        now = time.monotonic()
        self._decoding.look(in_work, now)
        late, decoder_late = now - dispatcher.progress(), self._decoding.late(now)
        is_stuck = not dispatcher.alive() or late > STALLED
        if is_stuck:
            log.error("dispatcher is stuck: no sign of life given", seconds=round(late))
        if decoder_late > 0:
            log.error("decoder is stuck: no sign of life given", seconds=round(decoder_late))
        return not is_stuck and decoder_late <= 0

    def beat(self, is_well: bool, at_hand: int) -> tuple[Alert, ...]:
        """At each beat of the daemon: messages to the operator, and a sign of life where all `is_well`."""
        now, monotonic, metrics = time.time(), time.monotonic(), self._metrics
        metrics.serve(self._config.metrics)
        metrics.beat(is_well, at_hand)
        if metrics.is_served():
            metrics.look(self._store, self._config, now)
        limits = self._config.operator
        alerts = self._operator.look(self._config, limits, now, monotonic)
        # a daemon that can tell nobody anything is not well: the dead man's switch tells
        if is_well and not self._operator.is_unheard(self._config):
            self._heartbeat.beat(monotonic)
        return alerts
