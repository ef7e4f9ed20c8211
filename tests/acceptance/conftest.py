"""Fixtures of the tests of the daemon."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from acceptance.angus import angus
from acceptance.support import TRACEBACK, Daemon, Site


@pytest.fixture
def site(tmp_path: Path) -> Site:
    """A dockserver with angus, before his first file."""
    return angus(tmp_path)


@pytest.fixture
def daemon(site: Site) -> Iterator[Daemon]:
    """A daemon that watches the site; whatever it goes through, it shows no traceback."""
    with Daemon(site) as daemon:
        yield daemon
    assert TRACEBACK not in daemon.text()
