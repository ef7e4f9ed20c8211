import locale
import os
from datetime import UTC, datetime
from pathlib import Path

import pytest

import dinkum
from gliderwatch.errors import Quarantine, Retry
from gliderwatch.ingest import header as header_module
from gliderwatch.ingest.header import read_header, read_regular
from gliderwatch.model import SegmentId


@pytest.fixture
def read(tmp_path):
    def _read(content: bytes):
        path = tmp_path / "00010003.sbd"
        path.write_bytes(content)
        return read_header(path)

    return _read


def test_what_a_header_holds(read):
    header = read(dinkum.header("USF-Sam-2024-250-1-3", crc="0ABC12EF") + dinkum.cycles(dinkum.rows()))
    assert header.id == SegmentId(dinkum.OPENED_AT, "usf-sam", "USF-Sam-2024-250-1-3")
    assert (header.mission, header.kind, header.crc) == ("test.mi", "sbd", "0abc12ef")
    assert (header.factored, header.n_held, header.n_sensors) == (True, 12, 13)


def test_the_header_of_a_compressed_file_whatever_its_name(read):
    content = dinkum.header() + dinkum.cycles(dinkum.rows(2000))
    assert read(dinkum.compress(content)) == read(content)


def test_only_the_start_of_a_file_is_needed(read):
    content = dinkum.header()
    assert read(content).length == len(content)


@pytest.mark.parametrize("n", [0, 1, 22, 73, 200, -1])
def test_a_file_cut_in_its_header_is_quarantined_at_once(read, n):
    with pytest.raises(Quarantine):
        read(dinkum.header()[:n])


@pytest.mark.parametrize(
    ("tags", "says"),
    [
        ({"encoding_ver": 4}, "encoding version 4 belongs to glider software that came in July 2003"),
        ({"encoding_ver": 6}, "encoding version 6 belongs to glider software newer than this"),
        ({"encoding_ver": 0}, "encoding version 0"),
        ({"filename_extension": "tbd"}, "tbd data, not flight data"),
        ({"full_filename": "unit"}, "GLIDER-YEAR-DAY-MISSION-SEGMENT"),
        ({"full_filename": "../../x-2024-250-1-3"}, "full_filename"),
        ({"full_filename": "x" * 200 + "-2024-250-1-3"}, "full_filename"),
        ({"full_filename": "<b>-2024-250-1-3"}, "full_filename"),
        ({"mission_name": "a\x1b[2Jb"}, "mission_name"),
        ({"mission_name": "m" * 65}, "mission_name"),
        ({"sensor_list_crc": "../../etc"}, "sensor_list_crc"),
        ({"sensor_list_factored": 2}, "sensor_list_factored"),
        ({"state_bytes_per_cycle": 0}, "contradict"),
        ({"sensors_per_cycle": 14}, "contradict"),
        ({"total_num_sensors": 99999}, "contradict"),
        ({"total_num_sensors": -1}, "total_num_sensors"),
        ({"num_ascii_tags": 99}, "header"),
        ({"num_ascii_tags": 3}, "num_ascii_tags"),
        ({"num_ascii_tags": "1e3"}, "num_ascii_tags"),
        ({"fileopen_time": "Thu_Jan__1_00:00:00_1970"}, "1970"),
        ({"fileopen_time": "Sat_Sep_31_19:32:03_2024"}, "fileopen_time"),
        ({"fileopen_time": "Sat_Okt__7_19:32:03_2024"}, "fileopen_time"),
        ({"fileopen_time": "Sat_Sep__7_24:32:03_2024"}, "fileopen_time"),
        ({"fileopen_time": "now"}, "fileopen_time"),
    ],
)
def test_a_header_with_a_wrong_value_is_quarantined_with_the_reason(read, tags, says):
    with pytest.raises(Quarantine, match=says):
        read(dinkum.header(**tags))


@pytest.mark.parametrize("content", [b"hello\n" * 200, b"\x00" * 3000, b"<html></html>"])
def test_another_file_is_told_from_a_data_file(read, content):
    with pytest.raises(Quarantine, match="not a Slocum data file"):
        read(content)


def test_a_line_that_is_there_twice_is_damage(read):
    content = dinkum.header().replace(b"all_sensors:", b"encoding_ver:")
    with pytest.raises(Quarantine, match="twice"):
        read(content)


def test_a_line_that_is_missing_is_damage(read):
    with pytest.raises(Quarantine, match="mission_name"):
        read(dinkum.header().replace(b"mission_name", b"mission_mane"))


@pytest.mark.parametrize("month", range(1, 13))
def test_months_are_english_whatever_the_locale(read, month):
    before = locale.setlocale(locale.LC_ALL)
    opened = datetime(2024, month, 3, 4, 5, 6, tzinfo=UTC).timestamp()
    content = dinkum.header(opened_at=opened)
    for name in ("de_DE.UTF-8", "fr_FR.UTF-8", "C"):
        try:
            locale.setlocale(locale.LC_ALL, name)
        except locale.Error:
            continue
        try:
            assert read(content).id.opened_at == opened
        finally:
            locale.setlocale(locale.LC_ALL, before)


def test_a_fifo_is_not_waited_for(tmp_path):
    path = tmp_path / "00010003.sbd"
    os.mkfifo(path)
    with pytest.raises(Quarantine, match="not a regular file"):
        read_header(path)


def test_a_folder_is_not_a_file(tmp_path):
    before = len(list(Path("/proc/self/fd").iterdir()))
    with pytest.raises(Quarantine, match="not a regular file"):
        read_header(tmp_path)
    assert len(list(Path("/proc/self/fd").iterdir())) == before


def test_a_file_that_is_away_may_come_back(tmp_path):
    with pytest.raises(Retry, match="No such file"):
        read_header(tmp_path / "00010003.sbd")


def test_a_file_that_changes_while_it_is_read_is_read_again_later(tmp_path, monkeypatch):
    path = tmp_path / "00010003.sbd"
    path.write_bytes(b"12345")
    assert read_regular(path, 100)[0] == b"12345"
    fstat = os.fstat

    def growing(fd):
        status = fstat(fd)
        with path.open("ab") as file:
            file.write(b"6")
        return status

    monkeypatch.setattr(header_module.os, "fstat", growing)
    with pytest.raises(Retry, match="changed while it was read"):
        read_regular(path, 100)


def test_a_file_of_the_first_gliders_is_named_as_such(read):
    """Until version 4 the header had no tags of the sensor list (dbd_file_format.txt)."""
    early = [line for line in dinkum.header().splitlines(keepends=True) if b"sensor_list" not in line]
    content = b"".join(early).replace(b"num_ascii_tags:    14", b"num_ascii_tags:    12")
    content = content.replace(b"encoding_ver:    5", b"encoding_ver:    2")
    with pytest.raises(Quarantine, match="version 2 belongs to glider software of September 2001 to"):
        read(content)
