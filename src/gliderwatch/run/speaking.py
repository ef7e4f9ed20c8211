"""Who is told what: from the recipients of the configuration to the channels of an alert."""

from __future__ import annotations

from gliderwatch.config import Config
from gliderwatch.model import Alert, Kind
from gliderwatch.run.intake import Speaking

NOBODY = Speaking(channels=lambda alert: (), notices=lambda glider: False)


def speaking(config: Config) -> Speaking:
    """How alerts are routed by a configuration."""
    return Speaking(
        channels=lambda alert: channels(alert, config),
        notices=lambda glider: any(glider in r.surfacing for r in config.recipients.values()),
        attention=config.attention,
    )


def channels(alert: Alert, config: Config) -> list[str]:
    """The channels of all who are to get an alert, each once.

    A message of the operator's kind has no glider and goes by its severity alone.
    """
    names: dict[str, None] = {}
    for recipient in config.recipients.values():
        if alert.kind == Kind.SURFACING:
            wanted = alert.glider in recipient.surfacing
        else:
            theirs = not alert.glider or recipient.gliders is None or alert.glider in recipient.gliders
            wanted = theirs and alert.audience >= recipient.min_severity
        if wanted:
            names |= dict.fromkeys(recipient.channels)
    return list(names)
