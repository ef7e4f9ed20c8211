from pathlib import Path

import pytest

from gliderwatch.slocum.folders import Settling

LONG = Path("/r/electa/from-glider/electa-2022-308-3-2.sbd")
SHORT = Path("/r/electa/from-glider/00930002.sbd")


@pytest.fixture
def settling():
    return Settling(10.0)


def test_a_long_name_is_complete_at_once(settling):
    settling.observe(LONG, 100, 1, now=5.0)
    assert settling.next_deadline(5.0) == 0.0
    assert settling.ready(5.0) == [LONG]


def test_an_8x3_name_waits_until_it_has_been_still(settling):
    settling.observe(SHORT, 100, 1, now=5.0)
    assert settling.ready(5.0) == []
    assert settling.next_deadline(7.0) == 8.0
    assert settling.ready(14.999) == []
    assert settling.ready(15.0) == [SHORT]


@pytest.mark.parametrize("state", [(101, 1), (100, 2), (99, 1)])
def test_growth_begins_the_wait_anew(settling, state):
    settling.observe(SHORT, 100, 1, now=0.0)
    settling.observe(SHORT, *state, now=9.0)
    assert settling.ready(18.9) == []
    assert settling.ready(19.0) == [SHORT]


def test_seeing_the_same_state_again_does_not_prolong_the_wait(settling):
    for now in (0.0, 4.0, 9.0):
        settling.observe(SHORT, 100, 1, now)
    assert settling.ready(10.0) == [SHORT]


def test_the_age_of_a_file_does_not_matter_for_its_clock_is_the_gliders(settling):
    settling.observe(SHORT, 100, mtime_ns=1, now=1e9)
    assert settling.ready(1e9) == []


def test_a_state_passes_once_and_a_new_one_again(settling):
    settling.observe(LONG, 100, 1, now=0.0)
    assert settling.ready(0.0) == [LONG]
    settling.observe(LONG, 100, 1, now=1.0)
    assert settling.ready(1.0) == []
    assert settling.next_deadline(1.0) is None
    settling.observe(LONG, 200, 2, now=2.0)
    assert settling.ready(2.0) == [LONG]


def test_what_is_forgotten_does_not_pass_and_may_pass_again(settling):
    settling.observe(SHORT, 100, 1, now=0.0)
    settling.forget(SHORT)
    assert settling.next_deadline(0.0) is None
    assert settling.ready(100.0) == []
    settling.observe(LONG, 100, 1, now=0.0)
    settling.ready(0.0)
    settling.forget(LONG)
    settling.observe(LONG, 100, 1, now=1.0)
    assert settling.ready(1.0) == [LONG]


def test_what_is_there_no_more_is_forgotten_though_not_what_still_waits(settling):
    settling.observe(LONG, 100, 1, now=0.0)
    settling.ready(0.0)
    settling.observe(SHORT, 100, 1, now=0.0)
    settling.only({str(LONG)})
    assert settling.passed(LONG) == (100, 1)
    settling.only(set())
    assert settling.passed(LONG) is None
    assert settling.ready(20.0) == [SHORT]
    settling.observe(LONG, 100, 1, now=21.0)
    assert settling.ready(21.0) == [LONG]


def test_nothing_waits_in_the_beginning(settling):
    assert settling.next_deadline(0.0) is None
    assert settling.ready(0.0) == []


def test_those_that_waited_longest_come_first(settling):
    other = SHORT.with_name("00930001.sbd")
    settling.observe(SHORT, 1, 1, now=0.0)
    settling.observe(other, 1, 1, now=1.0)
    settling.observe(LONG, 1, 1, now=2.0)
    assert settling.ready(20.0) == [LONG, SHORT, other]
