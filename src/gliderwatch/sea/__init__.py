"""The current at a glider: its model, its forecast, and files of an ocean model."""

from __future__ import annotations
