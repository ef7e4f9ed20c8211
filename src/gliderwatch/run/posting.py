"""Messages into the outbox: who waits for what is decided here, by pure rules; the store keeps the rows."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable

from gliderwatch.model import Alert
from gliderwatch.rules.announce import Said, unanswered
from gliderwatch.rules.waiting import Standing, deliveries
from gliderwatch.store.sqlite import Store

Channels = Callable[[Alert], Iterable[str]]
"""The channels of an alert: a mapping says what the recipients of each wait for (`rules.waiting.Wait`), of
names alone they get it at once."""


def post_alert(
    store: Store, alert: Alert, channels: Iterable[str], now: float, open_threads: Collection[str] = ()
) -> None:
    """Put a message into the outbox of its channels, each for the time when it is due there.

    ``open_threads`` are those that go on and that nobody has taken on. A message of a known id is left alone.
    """

    def standing(channel: str) -> Standing:
        told, escalates = store.standing(alert.incident, channel, now)
        return Standing(told, alert.incident in open_threads, escalates)

    store.post(alert, deliveries(alert, channels, now, standing), now)


def post_alerts(
    store: Store, glider: str, said: Said, alerts: Iterable[Alert], channels: Channels, now: float
) -> None:
    """Keep messages about a glider, and that they have been sent to people.

    What is held of incidents that are over by then is withdrawn (`withdraw_answered`).
    """
    store.keep_said(glider, said)
    open_threads = withdraw_answered(store, glider, now)
    for alert in alerts:
        post_alert(store, alert, channels(alert), now, open_threads)


def withdraw_answered(store: Store, glider: str, now: float, *, quiet: bool = False) -> frozenset[str]:
    """The threads that go on and that nobody has taken on, none of a glider that is `quiet`.

    What is held of the others until it escalates is withdrawn.
    """
    open_threads = frozenset[str]()
    if not quiet:
        incidents, acks = store.known(glider).incidents(), store.notes.acks(glider)
        open_threads = unanswered(store.said(glider), incidents, acks)
    store.withdraw(glider, open_threads, now)
    return open_threads
