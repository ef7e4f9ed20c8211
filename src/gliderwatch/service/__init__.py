"""The daemon and the replay: two sources of events for one path."""

from __future__ import annotations
