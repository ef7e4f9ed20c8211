"""What is done with a file that is complete, as ledger, configuration and caches say."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

import dinkum
from gliderwatch.errors import MissingCache, Quarantine, Retry
from gliderwatch.service import judgement
from gliderwatch.service.backlog import Job
from gliderwatch.store.segments import Segments
from gliderwatch.store.state_file import File, Status, Store

CRC = "0abc12ef"
DATA = dinkum.header() + dinkum.cycles(dinkum.rows(4))


@pytest.fixture
def store() -> Iterator[Store]:
    store = Store.open(":memory:")
    yield store
    store.close()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A whole file; its cache is not there."""
    path = tmp_path / "unit_7-2024-250-1-3.sbd"
    path.write_bytes(DATA)
    return path


@pytest.fixture
def cache(tmp_path: Path) -> Path:
    """A folder with its cache."""
    folder = tmp_path / "cache"
    folder.mkdir()
    (folder / f"{CRC}.cac").write_bytes(dinkum.sensor_list())
    return folder


def judge(path: Path, store: Store, *caches: Path, known: bool = True) -> Job | File | None:
    return judgement.judge(path, store, caches, lambda glider: known and glider == "unit_7")


def noted(path: Path, store: Store, *caches: Path, known: bool = True) -> File:
    """A judgement that is a row, written to the ledger."""
    found = judge(path, store, *caches, known=known)
    assert isinstance(found, File)
    store.record(found, 0.0)
    return found


def take(job: Job | File | None, store: Store, status: Status = Status.TAKEN) -> None:
    assert isinstance(job, Job)
    store.record(replace(job.file, status=status), 0.0)


def test_a_new_file_is_to_be_decoded(path: Path, cache: Path, store: Store) -> None:
    job = judge(path, store, cache)
    assert isinstance(job, Job)
    assert (job.file.path, job.file.glider, job.file.segment) == (str(path), "unit_7", path.stem)
    assert (job.file.size, job.file.mtime_ns) == (len(DATA), path.stat().st_mtime_ns)


@pytest.mark.parametrize("status", judgement.DONE)
def test_a_file_that_is_done_with_is_left_alone_until_it_changes(
    path: Path, cache: Path, store: Store, status: Status
) -> None:
    take(judge(path, store, cache), store, status)
    assert judge(path, store, cache) is None
    path.write_bytes(DATA + b" ")
    assert isinstance(judge(path, store, cache), Job)
    take(judge(path, store, cache), store, status)
    os.utime(path, ns=(0, path.stat().st_mtime_ns + 1))
    assert isinstance(judge(path, store, cache), Job)


def test_a_file_without_its_cache_waits_for_it(path: Path, cache: Path, store: Store) -> None:
    file = noted(path, store)
    assert (file.status, file.crc) == (Status.WAITING, CRC)
    assert CRC in file.reason
    assert judge(path, store) is None
    assert isinstance(judge(path, store, cache), Job)


def test_a_file_that_holds_its_sensor_list_waits_for_no_cache(path: Path, store: Store) -> None:
    whole = dinkum.header(factored=False) + dinkum.sensor_list() + dinkum.cycles(dinkum.rows(4))
    path.write_bytes(whole)
    assert isinstance(judge(path, store), Job)


def test_a_file_of_a_stranger_is_left_until_the_glider_is_known(
    path: Path, cache: Path, store: Store
) -> None:
    file = noted(path, store, cache, known=False)
    assert file.status == Status.UNKNOWN
    assert "unit_7" in file.reason
    assert judge(path, store, cache, known=False) is None
    assert isinstance(judge(path, store, cache), Job)


@pytest.mark.parametrize("content", [b"", b"garbage", DATA[:60]])
def test_what_is_no_flight_data_is_quarantined_once(path: Path, store: Store, content: bytes) -> None:
    path.write_bytes(content)
    assert noted(path, store).status == Status.QUARANTINED
    assert judge(path, store) is None


def test_a_file_that_could_not_be_decoded_for_now_is_tried_again(
    path: Path, cache: Path, store: Store
) -> None:
    job = judge(path, store, cache)
    assert isinstance(job, Job)
    store.record(judgement.failed(job.file, Retry("the share is away")), 0.0)
    assert isinstance(judge(path, store, cache), Job)


def test_a_cache_folder_that_cannot_be_read_is_left_to_the_decoder_to_tell(
    path: Path, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    def closed(folder: Path) -> list[str]:
        raise PermissionError(13, "Permission denied", str(folder))

    monkeypatch.setattr(os, "listdir", closed)
    assert isinstance(judge(path, store, path.parent), Job)


def test_a_name_that_is_not_text_is_quarantined_and_can_be_kept(
    path: Path, cache: Path, store: Store
) -> None:
    odd = path.with_name(os.fsdecode(b"\xff\xfe.sbd"))
    path.rename(odd)
    file = noted(odd, store, cache)
    assert file.status == Status.QUARANTINED
    assert "UTF-8" in file.reason
    assert file.path.endswith(r"\udcff\udcfe.sbd")
    assert judge(odd, store, cache) is None


# --------------------------------------------------------------------------- files that went


def test_a_file_that_went_before_it_was_seen_is_nothing(path: Path, store: Store) -> None:
    path.unlink()
    assert judge(path, store) is None


def test_a_file_that_was_taken_may_go(path: Path, cache: Path, store: Store) -> None:
    take(judge(path, store, cache), store)
    path.unlink()
    assert judge(path, store, cache) is None


def test_a_waiting_file_that_went_says_so(path: Path, cache: Path, store: Store) -> None:
    noted(path, store)
    path.unlink()
    file = noted(path, store)
    assert (file.status, file.crc) == (Status.WAITING, "")
    assert "not there any more" in file.reason
    path.write_bytes(DATA)
    assert isinstance(judge(path, store, cache), Job)


def test_a_waiting_file_that_was_renamed_and_taken_then_is_done_with(
    path: Path, cache: Path, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    noted(path, store)
    another = path.rename(path.with_name("another.sbd"))
    monkeypatch.setattr(Segments, "is_held", lambda self, glider, name: True)
    assert noted(path, store).status == Status.DUPLICATE
    assert judge(path, store) is None
    another.rename(path)  # it had only been away: what is known of its segment may be less than it holds
    assert isinstance(judge(path, store, cache), Job)


def test_a_file_of_a_stranger_that_went_stays_as_it_was(path: Path, store: Store) -> None:
    noted(path, store, known=False)
    path.unlink()
    assert judge(path, store, known=False) is None


def test_a_file_in_a_closed_folder_did_not_go(
    path: Path, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    noted(path, store)

    def closed(self: Path, **_: object) -> os.stat_result:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "stat", closed)
    assert judgement.state(path) == (0, 0)
    assert "not there any more" not in noted(path, store).reason


# --------------------------------------------------------------------------- failures


@pytest.mark.parametrize(
    ("error", "status", "crc"),
    [
        (MissingCache("abc"), Status.WAITING, "abc"),
        (Retry("later"), Status.WAITING, ""),
        (Quarantine("never"), Status.QUARANTINED, ""),
        (ValueError("unforeseen"), Status.QUARANTINED, ""),
    ],
)
def test_an_error_decides_whether_a_file_waits(error: Exception, status: Status, crc: str) -> None:
    file = judgement.failed(File("/a.sbd", 1, 2, Status.WAITING, "g", "s", "before", "old"), error)
    assert (file.status, file.crc, file.reason) == (status, crc, str(error))
    assert (file.path, file.size, file.mtime_ns, file.glider, file.segment) == ("/a.sbd", 1, 2, "g", "s")
