"""gliderwatch: watches a glider dockserver and alerts the pilot when a glider flies abnormally."""

from __future__ import annotations

from importlib.metadata import version

__version__ = version("gliderwatch")
