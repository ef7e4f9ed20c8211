"""When it is reported that a glider differs from its neighbours, and when that is over."""

from dataclasses import replace

import numpy as np

from gliderwatch.fleet.cross_check import Check, Hypothesis
from gliderwatch.fleet.flow import DiveCurrent, Fault, FleetFlow
from gliderwatch.fleet.reference import FleetReference, Standing
from gliderwatch.incidents.neighbours import Comparison, announce
from gliderwatch.messages.notice_text import render
from gliderwatch.model import Fix, Kind, Severity

T, HOUR = 1.7e9, 3600.0
LOSS = Hypothesis("a", Fault.LOSS, T - 30 * HOUR, 9, 0.4, 0.05, 50.0)
HERE, ERROR = DiveCurrent("a", Fix(T, 50.0, 1.0), Fix(T, 50.0, 1.0), 0.1, 0.2), 0.02**2 * np.eye(2)


def beside(fault: Hypothesis | None) -> FleetReference:
    others = FleetFlow(np.zeros(2), ERROR, ("b", "c"), 9e3)
    return FleetReference(HERE, others, (np.zeros(2), ERROR), Check(("b", "c"), 9e3, fault, None), fault)


SURE, CLEAR = beside(LOSS), beside(None)
ALL = beside(replace(LOSS, glider="", fault=Fault.TURN))


def stood(found: FleetReference | None) -> tuple[Standing | None, FleetReference | None]:
    """How it stood, and the flow that is asked for only where there is a fault."""
    if found is None:
        return None, None
    return Standing(found.check, found.fault), None if found.fault is None else found


def reported(*found: FleetReference | None):
    state, out = None, []
    for k, each in enumerate(found):
        state, notices = announce("a", state, *stood(each), T + k * 3 * HOUR)
        out += notices
    return state, [render(each) for each in out]


def test_it_is_reported_once():
    assert reported(CLEAR, None)[1] == []
    state, alerts = reported(CLEAR, SURE, SURE, SURE)
    assert [(a.kind, a.severity) for a in alerts] == [(Kind.NEIGHBOURS, Severity.CRITICAL)]
    assert alerts[0].title == "a LOSES SPEED by 40 %, say its neighbours"
    assert "makes 40 % less way through the water than it believes" in alerts[0].body
    assert "b, c" in alerts[0].body
    assert state.id == alerts[0].incident == f"a/neighbours/loss/{LOSS.since:.0f}"


def test_it_is_not_reported_again_for_a_week_nor_called_over():
    assert len(reported(SURE, SURE, None, CLEAR, CLEAR, CLEAR, SURE, SURE)[1]) == 1
    _, alerts = reported(*[SURE] * 60)
    assert [a.kind for a in alerts] == [Kind.NEIGHBOURS] * 2
    assert alerts[1].time - alerts[0].time > 7 * 86400


def test_what_all_share_is_one_message_for_all():
    first = reported(ALL)[1][0]
    _, notices = announce("b", Comparison(T), *stood(ALL), T + 3 * HOUR)
    other = render(notices[0])
    assert first.id == other.id
    assert first.severity == Severity.WARNING
    assert "one error that they share" in first.body
