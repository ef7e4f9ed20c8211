import math

import pytest

from gliderwatch.model import Flag
from gliderwatch.papers.flags import FlowMaxima, flag, p_e, update

RANGE = {"speed_min": 0.15, "speed_max": 0.25}


def test_maxima_only_grow():
    maxima = FlowMaxima()
    for flow, reference in [(0.1, 0.0), (0.3, 0.2), (0.2, 0.1)]:
        maxima = update(maxima, flow, reference)
    assert maxima == FlowMaxima(0.3, 0.2)


def test_p_e_by_hand():
    # |(0.3, 0) - (0, 0.4)| = 0.5 over twice the greater maximum 0.4
    assert p_e((0.3, 0.0), (0.0, 0.4), FlowMaxima(0.3, 0.4)) == pytest.approx(0.625)


def test_p_e_remembers_stronger_flow():
    assert p_e((0.1, 0.0), (0.0, 0.0), FlowMaxima(0.5, 0.2)) == pytest.approx(0.1)


def test_p_e_of_no_flow_at_all_is_zero():
    assert p_e((0.0, 0.0), (0.0, 0.0), FlowMaxima()) == 0.0


def test_p_e_of_opposite_flows_is_one():
    assert p_e((0.0, 0.2), (0.0, -0.2), FlowMaxima(0.2, 0.2)) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("error", "speed", "expected"),
    [
        (0.0, 0.20, Flag.NORMAL),
        (0.0, 0.15, Flag.NORMAL),
        (0.0, 0.25, Flag.NORMAL),
        (0.07, 0.20, Flag.NORMAL),
        (0.07, 0.149, Flag.ANOMALY),
        (0.07, 0.251, Flag.ANOMALY),
        (0.0701, 0.149, Flag.FALSE_ALARM),
        (0.0701, 0.20, Flag.FALSE_ALARM),
    ],
)
def test_flag(error, speed, expected):
    assert flag(error, 0.07, speed, **RANGE) is expected


@pytest.mark.parametrize("bad", [math.nan, math.inf, None])
def test_unknown_flow_is_refused(bad):
    with pytest.raises(ValueError, match="finite"):
        p_e((0.1, bad), (0.0, 0.0), FlowMaxima(0.1, 0.1))
    with pytest.raises(ValueError, match="finite"):
        p_e((0.1, 0.0), (bad, 0.0), FlowMaxima(0.1, 0.1))


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_unknown_numbers_are_refused(bad):
    with pytest.raises(ValueError, match="finite"):
        update(FlowMaxima(), bad, 0.1)
    with pytest.raises(ValueError, match="finite"):
        update(FlowMaxima(), 0.1, bad)
    with pytest.raises(ValueError, match="finite"):
        flag(bad, 0.07, 0.2, **RANGE)
    with pytest.raises(ValueError, match="finite"):
        flag(0.0, 0.07, bad, **RANGE)
