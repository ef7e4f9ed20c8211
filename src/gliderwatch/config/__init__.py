"""The settings: one YAML file, read with line numbers, checked, and turned into plain values.

The only place that reads settings from files and the environment. `load` gives a `Config` or
raises `ConfigError` with every problem in it; `check` looks at the folders and channels that it
names.
"""

from __future__ import annotations

from gliderwatch.config.check import check, linked_gliders
from gliderwatch.config.document import Problem
from gliderwatch.config.fields import expand
from gliderwatch.config.loading import Config, load
from gliderwatch.config.schema import Channel, Dockserver, Glider, Recipient, State

__all__ = [
    "Channel",
    "Config",
    "Dockserver",
    "Glider",
    "Problem",
    "Recipient",
    "State",
    "check",
    "expand",
    "linked_gliders",
    "load",
]
