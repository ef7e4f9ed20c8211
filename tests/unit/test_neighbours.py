"""When it is reported that a glider differs from its neighbours, and when that is over."""

from dataclasses import replace

from gliderwatch.fleet.cross_check import Check, Fault, Hypothesis
from gliderwatch.incidents.neighbours import Comparison, announce
from gliderwatch.messages.notice_text import render
from gliderwatch.model import Kind, Severity

T, HOUR = 1.7e9, 3600.0
LOSS = Hypothesis("a", Fault.LOSS, T - 30 * HOUR, 9, 0.4, 0.05, 50.0)
SURE, CLEAR = Check(("b", "c"), 9e3, LOSS, None), Check(("b", "c"), 9e3, None, None)
ALL = Check(("b", "c"), 9e3, None, None, replace(LOSS, glider="", fault=Fault.TURN))


def reported(*checks: Check | None):
    state, out = None, []
    for k, check in enumerate(checks):
        state, notices = announce("a", state, check, T + k * 3 * HOUR)
        out += notices
    return state, [render(each) for each in out]


def test_two_surfacings_in_a_row_and_once():
    assert reported(SURE)[1] == []
    assert reported(SURE, CLEAR, SURE)[1] == []
    state, alerts = reported(SURE, SURE, SURE, SURE)
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


def test_on_one_course_what_all_share_is_a_current():
    assert reported(*[replace(ALL, one_way=0.9)] * 3)[1] == []


def test_what_all_share_is_one_message_for_all():
    first = reported(ALL, ALL)[1][0]
    _, notices = announce("b", Comparison(T, Fault.TURN, 1), ALL, T + 3 * HOUR)
    other = render(notices[0])
    assert first.id == other.id
    assert first.severity == Severity.WARNING
    assert "one error that they share" in first.body
