"""Alerts on their way to people: channels, mail, and the dispatcher of the outbox."""

from __future__ import annotations
