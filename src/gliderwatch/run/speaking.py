"""Who is told what: from the recipients of the configuration to the channels of an alert."""

from __future__ import annotations

from collections.abc import Iterable

from gliderwatch.config import Config, Recipient
from gliderwatch.model import Alert, Kind, Severity
from gliderwatch.rules.waiting import Wait
from gliderwatch.run.intake import Speaking

NOBODY = Speaking(channels=lambda alert: (), notices=lambda glider: False)
Waits = dict[str, list[Wait]]
"""What the recipients of a message by each channel wait for."""


def speaking(config: Config) -> Speaking:
    """How alerts are routed by a configuration."""
    return Speaking(
        channels=lambda alert: channels(alert, config),
        notices=lambda glider: any(glider in r.surfacing for r in config.recipients.values()),
        attention=config.attention,
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
    """Who hears that the watch itself is in trouble; where there are none, all who want such messages."""
    recipients = list(config.recipients.values())
    return [r for r in recipients if r.operator] or [r for r in recipients if audience >= r.min_severity]


def waits(recipients: Iterable[Recipient], can_be_acknowledged: bool) -> Waits:
    """The channels of some recipients, each with what those wait for who share it."""
    found: Waits = {}
    for recipient in recipients:
        for channel in recipient.channels:
            found.setdefault(channel, []).append(recipient.wait(can_be_acknowledged))
    return found
