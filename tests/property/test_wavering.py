"""One fault is few messages that do not contradict each other; `benchmarks/messages.py` asks hundreds."""

import pytest

from wavering import count, drawn, told, wavers, without_chance


@pytest.mark.parametrize("seed", range(4))
def test_one_fault_is_few_messages_none_of_which_contradicts_the_one_before(seed):
    """Two seconds: a glider is simulated for four days, and all of its files are taken in."""
    scenario = without_chance(drawn(seed, days=4.0, first=1.5, last=2.0), 3.0)
    messages = told(scenario)
    assert count(messages, 48.0) <= 4
    assert wavers(messages) == []
