"""What a dockserver holds: files, headers, sensor lists, and how they become a `model.Segment`."""

from __future__ import annotations
