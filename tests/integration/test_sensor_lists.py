"""Sensor lists: their checksum in real files; those inside of files, kept for others."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

import dinkum
from gliderwatch.errors import Quarantine
from gliderwatch.slocum.caches import SensorLists, checksum, list_text, lists_folder
from gliderwatch.slocum.cycles import parse_sensor_list
from gliderwatch.slocum.header import parse_header, plain, read_header

WHOLE = dinkum.header(factored=False) + dinkum.sensor_list() + dinkum.cycles(dinkum.rows(4))


def own_lists(folder: Path) -> Iterator[tuple[str, bytes]]:
    """The checksum in the header, and the list, of each unfactored file of flight data."""
    for path in sorted(folder.rglob("*.[smd][bc]d")):
        try:
            content = plain(path.read_bytes(), 1 << 28)
            header = parse_header(content)
        except Quarantine:
            continue
        if not header.factored:
            _, end = parse_sensor_list(content, header.length, header.n_sensors)
            yield header.crc, content[header.length : end]


@pytest.mark.real
def test_real_lists_have_the_checksum_that_names_them(shared_data: Path) -> None:
    caches = sorted(p for p in shared_data.rglob("*") if p.suffix.lower() in {".cac", ".ccc"})
    lists = [(path.stem.lower(), path.read_bytes()) for path in caches]
    assert len(lists) >= 14
    inside = list(own_lists(shared_data))
    assert inside
    for crc, text in [*lists, *inside]:
        assert checksum(text) == crc == f"{dinkum.checksum(text):08x}"
        for copy in (text, text.replace(b"\n", b"\r\n"), dinkum.compress(text)):
            assert list_text(copy, crc) == text


@pytest.fixture
def lists(tmp_path: Path) -> SensorLists:
    """Those beside a state file."""
    return SensorLists(lists_folder(tmp_path / "state.sqlite"))


def whole(path: Path, content: bytes = WHOLE) -> Path:
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("packed", [False, True])
def test_the_list_of_a_whole_file_is_kept_once(lists: SensorLists, tmp_path: Path, packed: bool) -> None:
    path = whole(tmp_path / "a.sbd", dinkum.compress(WHOLE) if packed else WHOLE)
    kept = lists.keep(path, read_header(path))
    assert kept == tmp_path / "state.sqlite.lists" / f"{dinkum.CRC}.cac"
    assert kept.read_bytes() == dinkum.sensor_list()
    assert lists.keep(path, read_header(path)) is None
    assert list(lists.folder.iterdir()) == [kept]


@pytest.mark.parametrize(
    "content",
    [
        dinkum.header() + dinkum.cycles(dinkum.rows(4)),
        WHOLE.replace(b"m_pitch", b"m_pitsh"),
        WHOLE[: len(dinkum.header(factored=False)) + 200],
    ],
    ids=["factored", "damaged", "cut"],
)
def test_what_is_no_whole_list_is_not_kept(lists: SensorLists, tmp_path: Path, content: bytes) -> None:
    path = whole(tmp_path / "a.sbd", content)
    assert lists.keep(path, read_header(path)) is None
    assert not lists.folder.exists()


def test_no_more_lists_are_kept_than_have_room(
    lists: SensorLists, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gliderwatch.slocum.caches.MOST", 3)
    for i in range(1, 6):
        crc = f"0000000{i}"
        head = dinkum.header(factored=False, crc=crc)
        path = whole(tmp_path / f"{i}.sbd", head + dinkum.sensor_list(crc=crc))
        kept = lists.keep(path, read_header(path))
        assert kept is not None
        os.utime(kept, ns=(i, i))
    assert sorted(path.name for path in lists.folder.iterdir()) == [
        "00000003.cac",
        "00000004.cac",
        "00000005.cac",
    ]
