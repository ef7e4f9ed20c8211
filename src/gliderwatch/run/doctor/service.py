"""The service: its configuration, state file, channels, and whether it runs."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable
from pathlib import Path

from gliderwatch.alerts import message
from gliderwatch.alerts.channels import Channel, DeliveryError
from gliderwatch.alerts.samples import sample
from gliderwatch.alerts.words import duration
from gliderwatch.config import Config, Problem
from gliderwatch.errors import ConfigError, DamagedError, StateError
from gliderwatch.model import Alert, Kind, Severity
from gliderwatch.run.doctor.finding import Finding, Findings, Level, error, note, ok, warning
from gliderwatch.run.life import STALE, is_held, silence
from gliderwatch.store.database import SCHEMA
from gliderwatch.store.watch_health import Failing, failing, quick_check, schema_version

_START = "systemctl start gliderwatch; journalctl -u gliderwatch tells why it ended"
_STUCK = "systemctl restart gliderwatch; please report it, with its log"


def of_check(topic: str, problems: Iterable[Problem], *keys: str) -> list[Finding]:
    """What `gliderwatch check` found of keys that begin so."""
    return [
        Finding(
            Level.ERROR if p.severity == "error" else Level.WARNING,
            topic,
            f"line {p.where.rpartition(':')[2]}: {p.text}",
            p.cure,
        )
        for p in problems
        if p.text.startswith(keys)
    ]


def state(config: Config, problems: Iterable[Problem]) -> Findings:
    """Whether the state file opens, is whole, and of a schema that is known."""
    found = of_check("state", problems, "state.")
    yield from found
    path = Path(config.state.path)
    if any(f.level == Level.ERROR for f in found):
        return
    if not path.exists():
        yield note("state", f"{path} is not there yet: the service makes it at its first start")
        return
    try:
        version, told = schema_version(path), quick_check(path)
    except DamagedError as problem:
        told, version = str(problem), SCHEMA
    except StateError as problem:
        yield error("state", str(problem), "ask as the user of the service; else see docs/state-file.md")
        return
    if told != "ok":
        cure = "stop the service, move the file away, start: all is learnt anew from the files"
        yield error("state", f"{path} is damaged: {told}", cure)
    elif version < SCHEMA:
        yield note("state", f"{path} is whole; schema {version} becomes {SCHEMA} at the next start")
    else:
        yield ok("state", f"{path} is whole, schema {version}")


def channels(config: Config, problems: Iterable[Problem], send: bool) -> Findings:
    """Whether channels can be reached and do deliver; with `send`, a test message goes through each."""
    problems = list(problems)
    yield from of_check("channels", problems, "channels", "recipients")
    urls = {name: f"channels.{name}.url: " for name in config.channels}
    bad = {name for name, key in urls.items() if any(p.text.startswith(key) for p in problems)}
    waiting = _failing(Path(config.state.path))
    for name in config.channels:
        trouble = waiting.get(name)
        if name in bad:
            continue
        said, refused = ("took a test message", try_channel(config, name)) if send else _reached(config, name)
        if refused is not None:
            cure = "compare its URL; can this machine reach the server?"
            yield error("channels", f"{name} cannot be used: {refused}", cure)
        elif trouble is not None:
            late = duration(max(0.0, time.time() - trouble.since))
            text = (
                f"{name}: {trouble.messages} messages not delivered, the oldest for {late}: {trouble.error}"
            )
            yield warning("channels", text, f"gliderwatch test-alert --channel {name}")
        else:
            yield ok("channels", f"{name} {said}")


def _failing(path: Path) -> dict[str, Failing]:
    """Channels that fail, as the state file tells; none where it cannot: `state` says why."""
    try:
        return failing(path, time.time()) if path.exists() else {}
    except StateError:
        return {}


def sign(config: Config, problems: Iterable[Problem]) -> Findings:
    """Whether a sign of life can be given to a dead man's switch."""
    settings, found = config.heartbeat, of_check("heartbeat", problems, "heartbeat.")
    if settings.file is not None:
        file = Path(settings.file)
        if not os.access(file if file.exists() else file.parent, os.W_OK):
            found.append(error("heartbeat", f"{file} cannot be written by this user", "name another file"))
    if not found and (settings.url is not None or settings.file is not None):
        found = [ok("heartbeat", f"every {settings.minutes:g} min while all is well")]
    yield from found


def sample_for(kind: str) -> Alert:
    """A whole message of a kind, as it would come now."""
    return sample(Kind(kind), time.time())


def try_channel(config: Config, name: str, alert: Alert | None = None) -> str | None:
    """Send a test message, or an `alert`; why it was not delivered, None when it was."""
    try:
        Channel(name, config.channel_url(name).get_secret_value()).send(alert or _test(name, time.time()))
    except (DeliveryError, ConfigError) as problem:
        return str(problem)
    return None


def _test(name: str, now: float) -> Alert:
    return message.operator(
        "test of a channel",
        f"If you can read this, the channel {name} of gliderwatch works.",
        now,
        alert_id=f"test/{name}/{now:.3f}",
        severity=Severity.INFO,
        audience=Severity.INFO,
    )


def _reached(config: Config, name: str) -> tuple[str, str | None]:
    """What is known of a channel to which nothing is sent, and why it cannot be used (None: it can)."""
    try:
        answers = Channel(name, config.channel_url(name).get_secret_value()).reach()
    except (DeliveryError, ConfigError) as problem:
        return "", str(problem)
    return "has a server that answers" if answers else "has a good URL (tried only with --send)", None


def daemon(config: Config) -> Findings:
    """Whether the service runs and gives signs of life."""
    path = Path(config.state.path)
    last, runs = silence(path), is_held(path)
    if not runs:
        since = "" if last is None else f" (last sign of life {duration(last)} ago)"
        yield warning("service", f"does not run{since}", _START)
    elif last is None or last >= STALE:
        yield error("service", f"runs, but gives no sign of life for {duration(last or 0.0)}", _STUCK)
    else:
        yield ok("service", f"runs, last sign of life {last:.0f} s ago")
