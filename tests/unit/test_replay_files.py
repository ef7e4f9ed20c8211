"""Files that were opened in one order and sent in another."""

from __future__ import annotations

from gliderwatch.errors import Quarantine
from gliderwatch.model import Segment, SegmentId
from gliderwatch.service.backlog import Job
from gliderwatch.service.replay_files import LONGEST, ReplayOrder
from gliderwatch.slocum.header import Header
from gliderwatch.store.state_file import File, Status
from missions import segment


def job(glider: str, opened: float, sent: float | None) -> Job:
    """A file of a glider, opened and sent at some times (s); None: it cannot be read."""
    name = f"{glider}-{opened:g}"
    made: Segment | Exception = Quarantine("broken")
    if sent is not None:
        made = segment(name, opened, {}, last=sent, glider=glider)
    header = Header.__new__(Header)
    object.__setattr__(header, "id", SegmentId(opened, glider, name))
    return Job(File(f"/{name}", 1, 1, Status.WAITING), header, made)


def turns(*jobs: Job) -> list[tuple[str, float]]:
    """Names and times of sending as they come out."""
    order = sorted(jobs, key=lambda j: j.header.id)
    found = ReplayOrder(order)
    return [(j.header.id.name, sent) for one in order for j, sent in found.after(one)]


def test_in_the_order_of_sending() -> None:
    long, one, two = job("a", 0.0, 100.0), job("b", 10.0, 50.0), job("b", 60.0, 120.0)
    assert turns(long, one, two) == [("b-10", 50.0), ("a-0", 100.0), ("b-60", 120.0)]


def test_each_glider_in_the_order_of_opening() -> None:
    """Even where a clock that was set says something else."""
    assert [name for name, _ in turns(job("a", 0.0, 100.0), job("a", 10.0, 50.0))] == ["a-0", "a-10"]


def test_nobody_waits_for_a_mission_of_years_later() -> None:
    early, late = [job("a", 10.0 * k, 10.0 * k + 9) for k in range(5)], job("b", 1e9, 1e9 + 9)
    found = ReplayOrder([*early, late])
    out = [[j.header.id.name for j, _ in found.after(one)] for one in early]
    assert out == [[f"a-{10 * k}"] for k in range(5)]


def test_one_that_cannot_be_read_was_sent_before_the_next_was_opened() -> None:
    assert turns(job("a", 0.0, None), job("a", 100.0, 190.0)) == [("a-0", 100.0), ("a-100", 190.0)]
    assert turns(job("a", 5.0, None)) == [("a-5", 5.0)]
    assert turns(job("a", 5.0, None), job("a", 1e8, 1e8 + 9))[0] == ("a-5", 5.0 + LONGEST)
