"""Order and fairness of the files that wait to be decoded and taken."""

from __future__ import annotations

import pytest

from gliderwatch.errors import Quarantine
from gliderwatch.model import SegmentId
from gliderwatch.service.backlog import AHEAD, FEWEST, HELD, LONG, RUN, Backlog, Job
from gliderwatch.slocum.header import Header
from gliderwatch.store.state_file import File, Status

DONE = Quarantine("for the sake of the test")


def job(glider: str, opened_at: float, path: str = "") -> Job:
    name = f"{glider}-2024-1-0-{opened_at:.0f}"
    header = Header(SegmentId(opened_at, glider, name), "m.mi", "sbd", "0", True, 9, 9, 100)
    return Job(File(path or f"/{name}.sbd", 1, 1, Status.WAITING, glider, name), header)


def started(backlog: Backlog, n: int) -> list[Job]:
    """The next n files, all being decoded now."""
    jobs = [backlog.next() for _ in range(n)]
    return [job for job in jobs if job is not None]


def make_long(backlog: Backlog) -> None:
    """Let there be so many files that they are taken in runs."""
    for opened_at in range(LONG):
        backlog.add(job("of another", opened_at))


def test_files_of_a_glider_are_decoded_oldest_first() -> None:
    backlog = Backlog()
    for opened_at in (3.0, 1.0, 2.0):
        backlog.add(job("a", opened_at))
    assert [j.header.id.opened_at for j in started(backlog, 9)] == [1.0, 2.0, 3.0]


def test_gliders_take_turns_by_runs_and_one_that_had_none_at_hand_is_next() -> None:
    backlog = Backlog()
    for glider in ("a", "b"):
        for opened_at in range(RUN + 2):
            backlog.add(job(glider, opened_at))
    begun = started(backlog, 3)
    backlog.add(job("c", 9.0))
    begun += started(backlog, 2 * RUN)
    turns = "".join(j.header.id.glider for j in begun)
    assert turns == "aba" + "c" + "a" * (RUN - 2) + "b" * (RUN - 1) + "aa"


def test_a_run_waits_for_its_files_and_is_taken_by_none_else() -> None:
    backlog = Backlog()
    for opened_at in range(RUN + 1):
        backlog.add(job("a", opened_at))
    begun = started(backlog, RUN + 1)
    make_long(backlog)
    for one in begun[: RUN - 1]:
        backlog.finish(one, DONE)
    assert backlog.ready("a") == []
    backlog.finish(begun[RUN - 1], DONE)
    assert backlog.ready("a") == begun[:RUN]
    backlog.begin_run("a", RUN)
    backlog.finish(begun[RUN], DONE)
    assert backlog.ready("a") == [] and backlog.decoded("a") is None
    assert backlog.end_run("a") == begun[:RUN]
    assert [backlog.decoded("a") for _ in begun] == begun


def test_a_list_that_is_short_is_taken_file_by_file() -> None:
    """Until it is long, and again after nothing was at hand."""
    backlog, files = Backlog(), range(LONG - 1)
    for opened_at in files:
        backlog.add(job("a", opened_at))
    begun = started(backlog, RUN)
    for one in begun:
        backlog.finish(one, DONE)
    assert backlog.ready("a") == begun[:1]
    backlog.add(job("b", 1.0))
    assert backlog.ready("a") == begun
    while (more := backlog.next()) is not None:
        backlog.finish(more, DONE)
        while backlog.decoded("a") or backlog.decoded("b"):
            pass
    assert not len(backlog)
    for opened_at in range(3):
        backlog.add(job("c", opened_at))
    begun = started(backlog, 3)
    for one in begun:
        backlog.finish(one, DONE)
    assert backlog.ready("c") == begun[:1]


def test_few_files_do_not_wait_for_each_other() -> None:
    backlog = Backlog()
    for opened_at in range(FEWEST - 1):
        backlog.add(job("a", opened_at))
    first, *_ = started(backlog, 9)
    make_long(backlog)
    backlog.finish(first, DONE)
    assert backlog.ready("a") == [first]


def test_what_is_decoded_at_once_has_its_bounds_but_for_newcomers() -> None:
    """And then no run waits for more files, which do not come."""
    backlog = Backlog()
    for n in range(HELD):
        for opened_at in range(FEWEST):
            backlog.add(job(f"g{n}", opened_at))
    begun = started(backlog, HELD)
    assert len(begun) == HELD and backlog.is_full and backlog.next() is None
    backlog.finish(begun[0], DONE)
    assert backlog.ready("g0") == [begun[0]]
    for one in begun[1:]:
        backlog.finish(one, DONE)
        assert backlog.ready(one.header.id.glider) == [one]  # its turn is later
    backlog.add(job("new", 1.0))
    newcomer = backlog.next()
    assert newcomer is not None and newcomer.header.id.glider == "new" and backlog.next() is None


def test_a_run_waits_for_the_rest_of_its_turn_while_runs_let_go_what_is_held() -> None:
    """Else nearly all files of many gliders would be taken one by one, as soon as many are held."""
    backlog = Backlog()
    gliders = [f"g{n}" for n in range(HELD + RUN)]
    for glider in gliders:
        for opened_at in range(2 * RUN):
            backlog.add(job(glider, opened_at))
    runs, decoding, alone = list[str](), list[Job](), 0
    while len(backlog):
        while len(decoding) < 4 and (begun := backlog.next()) is not None:
            decoding.append(begun)
        if decoding:
            one = decoding.pop(0)
            backlog.finish(one, DONE)
            glider = one.header.id.glider
        else:
            assert runs, "it goes on"
            glider = runs.pop(0)
            for _ in backlog.end_run(glider):
                backlog.decoded(glider)
        found = backlog.ready(glider)
        if len(found) > 1:
            backlog.begin_run(glider, len(found))
            runs.append(glider)
        elif found:
            backlog.decoded(glider)
            alone += 1
    assert alone <= 2 * len(gliders)


def test_a_file_is_taken_after_those_before_it() -> None:
    backlog = Backlog()
    for opened_at in (1.0, 2.0):
        backlog.add(job("a", opened_at))
    first, second = started(backlog, 2)
    backlog.finish(second, DONE)
    assert backlog.decoded("a") is None
    backlog.finish(first, DONE)
    assert backlog.decoded("a") is first
    assert backlog.decoded("a") is second
    assert backlog.decoded("a") is None


def test_a_slow_file_delays_its_own_glider_alone() -> None:
    backlog = Backlog()
    slow, other = job("a", 1.0), job("b", 1.0)
    backlog.add(slow)
    backlog.add(other)
    started(backlog, 2)
    backlog.finish(other, DONE)
    assert backlog.decoded("b") is other
    assert backlog.decoded("a") is None


def test_no_more_of_a_glider_are_decoded_than_are_soon_taken() -> None:
    backlog = Backlog()
    for opened_at in range(AHEAD + 5):
        backlog.add(job("a", float(opened_at)))
    backlog.add(job("b", 1.0))
    at_work = started(backlog, AHEAD + 6)
    assert [j.header.id.glider for j in at_work].count("a") == AHEAD
    assert [j.header.id.glider for j in at_work].count("b") == 1
    backlog.finish(at_work[0], DONE)
    assert backlog.next() is None, "decoded, but not taken yet"
    assert backlog.decoded("a") is at_work[0]
    assert backlog.next() is not None


def test_it_counts_what_is_at_hand_and_what_is_being_decoded() -> None:
    backlog = Backlog()
    for opened_at in (1.0, 2.0):
        backlog.add(job("a", opened_at))
    assert (len(backlog), backlog.decoding, backlog.more("a")) == (2, 0, True)
    first, second = started(backlog, 2)
    assert (len(backlog), backlog.decoding) == (2, 2)
    backlog.finish(first, DONE)
    assert (len(backlog), backlog.decoding) == (2, 1)
    backlog.decoded("a")
    assert (len(backlog), backlog.more("a")) == (1, True)
    backlog.finish(second, DONE)
    backlog.decoded("a")
    assert (len(backlog), backlog.decoding, backlog.more("a")) == (0, 0, False)


@pytest.mark.parametrize("begin", [False, True])
def test_a_file_that_is_at_hand_is_not_put_in_twice(begin: bool) -> None:
    backlog = Backlog()
    first = job("a", 1.0)
    backlog.add(first)
    if begin:
        backlog.next()
    backlog.add(job("a", 1.0))
    assert len(backlog) == 1
    assert len(started(backlog, 9)) == (0 if begin else 1)


def test_a_file_can_come_again_once_it_was_taken() -> None:
    backlog = Backlog()
    first = job("a", 1.0)
    backlog.add(first)
    backlog.next()
    backlog.finish(first, DONE)
    backlog.decoded("a")
    again = job("a", 1.0)
    backlog.add(again)
    assert backlog.next() is again


def test_two_files_of_one_segment_are_both_kept() -> None:
    backlog = Backlog()
    for path in ("/long.sbd", "/00010001.sbd"):
        backlog.add(job("a", 1.0, path))
    assert [j.file.path for j in started(backlog, 3)] == ["/00010001.sbd", "/long.sbd"]


def test_a_glider_that_had_nothing_at_hand_is_next():
    backlog = Backlog()
    for glider in ("a", "b", "c"):
        for opened_at in (1.0, 2.0, 3.0):
            backlog.add(job(glider, opened_at))
    assert [j.header.id.glider for j in started(backlog, 4)] == ["a", "b", "c", "a"]
    backlog.add(job("d", 9.0))
    backlog.add(job("d", 10.0))
    assert [j.header.id.glider for j in started(backlog, 4)] == ["d", "a", "b", "b"]
    assert (backlog.behind("d"), backlog.behind("a"), backlog.behind("e")) == (2, 3, 0)
