"""The settings: one YAML file, read with line numbers, checked, and turned into plain values.

The only place that reads settings from files and the environment. `load` gives a `Config` or
raises `ConfigError` with every problem in it; `check` looks at the folders and channels that it
names.
"""

from gliderwatch.config.checking import Link, check, linked_gliders
from gliderwatch.config.loading import load
from gliderwatch.config.paths import expand
from gliderwatch.config.problem import Problem
from gliderwatch.config.root import Config
from gliderwatch.config.sections import Glider
from gliderwatch.config.service import Channel, Dockserver, Recipient, State

__all__ = [
    "Channel",
    "Config",
    "Dockserver",
    "Glider",
    "Link",
    "Problem",
    "Recipient",
    "State",
    "check",
    "expand",
    "linked_gliders",
    "load",
]
