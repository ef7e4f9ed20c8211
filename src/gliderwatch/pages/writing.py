"""Pages as files for any web server: each is whole at every moment, whatever stops who writes it."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gliderwatch.errors import GliderwatchError
from gliderwatch.figures.coast import Land
from gliderwatch.health.rule import Limits
from gliderwatch.pages.fields import fields_of, read_field
from gliderwatch.pages.reading import read_fleet
from gliderwatch.pages.render import Frame, both_pages, field_file, field_page, file_of, fleet_page
from gliderwatch.pages.view import GliderView
from gliderwatch.params import Attention
from gliderwatch.store.state_file import Store

FLEET = "index.html"
FLEET_DUE, GLIDER_DUE = 900.0, 5400.0
"""Seconds after which a page counts as stale: half as long again as it takes until the next one."""
LEFT_OVER = 3600.0
"""Seconds after which what a killed writer left is removed."""


def write_fleet(
    store: Store,
    folder: Path,
    attention: dict[str, Attention],
    batteries: dict[str, Limits | None],
    now: float,
    land: Land,
) -> None:
    """Write the page of all gliders, those of `attention`, and those of fields. Raises GliderwatchError where
    that cannot be."""
    views = read_fleet(store, sorted(attention), lambda name: attention[name], now, batteries=batteries)
    frame, seas = Frame(now, now + FLEET_DUE), list[str]()
    for name in fields_of(store, now):
        sea = read_field(store, name, now)
        if sea is not None:
            put(folder / field_file(name), field_page(sea, frame, land))
            seas.append(name)
    put(folder / FLEET, fleet_page(views, frame, land, seas))


def write_glider(view: GliderView, folder: Path, land: Land) -> None:
    """Write the pages of one glider. Raises GliderwatchError where that cannot be."""
    frame = Frame(view.now, view.now + GLIDER_DUE)
    page, sheet = both_pages(view, frame, land)
    put(folder / file_of(view.name), page)
    put(folder / file_of(view.name, "-sheet"), sheet)


def put(path: Path, text: str) -> None:
    """Put a file in the place of an earlier one (`replacing`). Raises GliderwatchError."""
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8")


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Where to write what is then put in the place of an earlier file, for all to read: a reader sees the one
    or the other, whole.

    Raises GliderwatchError where it cannot be written.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield part
        with part.open("rb") as file:
            os.fsync(file.fileno())
        part.chmod(0o644)
        part.replace(path)
    except OSError as error:
        raise GliderwatchError(
            f"page {path} cannot be written: {error.strerror}. What to do: let the user of the service write "
            "to the folder, or name another in pages.folder"
        ) from None


def clear(folder: Path, now: float | None = None) -> None:
    """Remove what a writer left that was killed long ago."""
    before = (time.time() if now is None else now) - LEFT_OVER
    for part in folder.glob(".*.part"):
        if part.stat().st_mtime < before:
            part.unlink(missing_ok=True)
