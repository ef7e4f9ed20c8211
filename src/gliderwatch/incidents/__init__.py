"""From flags to incidents, and what people are to be notified of. No text, no SQL. Pure."""

from __future__ import annotations
