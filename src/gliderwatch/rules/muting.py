"""A glider that is muted in the configuration, by a command, or both. Pure."""

from __future__ import annotations

from dataclasses import replace

from gliderwatch.params import Attention


def with_mute(configured: Attention, until: float | None) -> Attention:
    """How a glider is taken that a command mutes until a time (s; None: it does not): the later mute counts.

    >>> with_mute(Attention(muted_until=5.0), 9.0).muted_until
    9.0
    >>> with_mute(Attention(muted_until=9.0), 5.0).muted_until
    9.0
    """
    if until is None or (configured.muted_until is not None and configured.muted_until >= until):
        return configured
    return replace(configured, muted_until=until)
