"""Who gets which alert: from the recipients of the configuration to the outbox."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field

from gliderwatch.config import Config, Recipient
from gliderwatch.health.rule import Limits
from gliderwatch.health.rules import usual_limits
from gliderwatch.incidents.notifications import NotificationState
from gliderwatch.incidents.open_threads import unacknowledged
from gliderwatch.incidents.send_schedule import Standing, Wait, deliveries
from gliderwatch.model import Alert, Kind, Severity
from gliderwatch.params import Attention
from gliderwatch.store.state_file import Store


@dataclass(frozen=True, slots=True)
class Routing:
    """Who is notified: ``channels`` of an alert (a mapping says what they wait for), of which gliders
    surfacing notices are wanted, how the silence of a glider is taken, and the ``limits`` of its rules of
    health."""

    channels: Callable[[Alert], Iterable[str]]
    notices: Callable[[str], bool]
    attention: Callable[[str], Attention] = field(default=lambda glider: Attention())
    limits: Callable[[str], Mapping[str, Limits]] = field(default=lambda glider: usual_limits())


# ----------------------------------------
# Who gets what: from the recipients of the configuration to the channels of an alert.

NOBODY = Routing(channels=lambda alert: (), notices=lambda glider: False)
Waits = dict[str, list[Wait]]
"""What the recipients of a message by each channel wait for."""


def routing_of(config: Config) -> Routing:
    """How alerts are routed by a configuration."""
    return Routing(
        channels=lambda alert: channels(alert, config),
        notices=lambda glider: any(glider in r.surfacing for r in config.recipients.values()),
        attention=config.attention,
        limits=config.health,
    )


def channels(alert: Alert, config: Config) -> Waits:
    """The channels of all who are to get an alert, each with what they wait for.

    Only what belongs to an incident can be acknowledged.
    """
    if alert.kind == Kind.SURFACING:
        return waits((r for r in config.recipients.values() if alert.glider in r.surfacing), False)
    if alert.kind == Kind.OPERATOR:
        return waits(operators(config, alert.audience), bool(alert.incident))
    wanted = (
        r
        for r in config.recipients.values()
        if (not alert.glider or r.gliders is None or alert.glider in r.gliders)
        and alert.audience >= r.min_severity
    )
    return waits(wanted, bool(alert.incident))


def operators(config: Config, audience: Severity) -> list[Recipient]:
    """Who is notified that the watch itself is in trouble; without such, all who want the message."""
    recipients = list(config.recipients.values())
    return [r for r in recipients if r.operator] or [r for r in recipients if audience >= r.min_severity]


def waits(recipients: Iterable[Recipient], can_be_acknowledged: bool) -> Waits:
    """The channels of some recipients, each with what those wait for who share it."""
    found: Waits = {}
    for recipient in recipients:
        for channel in recipient.channels:
            found.setdefault(channel, []).append(recipient.wait(can_be_acknowledged))
    return found


# ----------------------------------------
# Messages into the outbox: who waits for what is decided here, by pure rules; the store keeps the rows.

Channels = Callable[[Alert], Iterable[str]]
"""The channels of an alert: a mapping says what the recipients of each wait for (`rules.waiting.Wait`), of
names alone they get it at once."""


def post_alert(
    store: Store, alert: Alert, channels: Iterable[str], now: float, open_threads: Collection[str] = ()
) -> None:
    """Put a message into the outbox of its channels, each for the time when it is due there.

    ``open_threads`` are open and not acknowledged. A message of a known id is left alone.
    """

    def standing(channel: str) -> Standing:
        delivered, escalates = store.standing(alert.incident, channel, now)
        return Standing(delivered, alert.incident in open_threads, escalates)

    store.post(alert, deliveries(alert, channels, now, standing), now)


def post_alerts(
    store: Store,
    glider: str,
    notified: NotificationState,
    alerts: Iterable[Alert],
    channels: Channels,
    now: float,
) -> None:
    """Keep messages about a glider, and that people were notified, as `post_due`."""
    open_threads = unacknowledged(notified, store.facts(glider).incidents(), store.notes.acks(glider))
    post_due(store, glider, notified, open_threads, alerts, channels, now)


def post_due(
    store: Store,
    glider: str,
    notified: NotificationState,
    open_threads: frozenset[str],
    alerts: Iterable[Alert],
    channels: Channels,
    now: float,
) -> None:
    """Keep messages about a glider, and that people were ``notified``.

    What is held until it escalates is withdrawn, but for ``open_threads``: what is open and nobody has
    acknowledged.
    """
    store.keep_notified(glider, notified, open_threads, now)
    for alert in alerts:
        post_alert(store, alert, channels(alert), now, open_threads)


def withdraw_answered(store: Store, glider: str, now: float, *, quiet: bool = False) -> frozenset[str]:
    """The threads that are open and that nobody has acknowledged, none of a glider that is `quiet`.

    What is held of the others until it escalates is withdrawn.
    """
    open_threads = frozenset[str]()
    if not quiet:
        incidents, acks = store.facts(glider).incidents(), store.notes.acks(glider)
        open_threads = unacknowledged(store.notified(glider), incidents, acks)
    store.withdraw(glider, open_threads, now)
    return open_threads
