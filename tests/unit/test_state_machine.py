"""From flags to incidents: the table of phases, counting, and what each flag says of each kind."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from alert_support import SLOW
from gliderwatch.incidents.state_machine import (
    TRANSITIONS,
    Event,
    Phase,
    RuleStates,
    advance,
    departure,
    is_severe,
)
from gliderwatch.model import Assessment, Incident, Kind, Severity
from gliderwatch.params import AnomalyRule, FalseAlarmRule, RuleParams

SPEEDS = {"0": 0.25, "1": 0.15, "S": 0.05, "F": 0.4, "2": 0.25, "-": None}
"""Dives by a letter: normal, slow, less than half the lower bound, fast, reference not believed, no flag."""


def dive(k: int, letter: str, **changes) -> Assessment:
    flag = {"S": 1, "F": 1, "-": None}.get(letter, int(letter) if letter.isdigit() else None)
    made = replace(SLOW, t_dive=1000.0 * k, t_surface=1000.0 * k + 800, flag=flag, speed=SPEEDS[letter])
    return replace(made, **changes)


def history(letters: str, rules: RuleParams | None = None) -> tuple[RuleStates, dict[str, Incident]]:
    """The state and the incidents, as last told, after dives given by their letters."""
    state, incidents = RuleStates(), {}
    for k, letter in enumerate(letters):
        before = state
        state, told = advance(state, dive(k, letter), rules or RuleParams())
        incidents |= {i.id: i for i in told}
        for watch, earlier in ((state.anomaly, before.anomaly), (state.false_alarm, before.false_alarm)):
            assert (watch.phase == Phase.OPEN) == (watch.incident is not None)
            assert any(a == earlier.phase and b == watch.phase for (a, _), b in TRANSITIONS.items())
    return state, incidents


def summary(letters: str, rules: RuleParams | None = None) -> list[tuple]:
    """Kind, first dive, opening dive, clearing dive (None: open) and count of the incidents."""
    _, incidents = history(letters, rules)
    dive_of = lambda t: None if t is None else int(t // 1000)  # noqa: E731
    return [
        (str(i.kind), dive_of(i.since), dive_of(i.opened_at), dive_of(i.cleared_at), i.dives)
        for i in incidents.values()
    ]


@pytest.mark.parametrize(
    "letters, expected",
    [
        ("0000", []),
        ("01000", []),  # one flagged dive is none yet
        ("0110", [("anomaly", 1, 2, None, 2)]),
        ("01100", [("anomaly", 1, 2, 4, 2)]),
        ("0101010", []),  # never two in a row
        ("01111011", [("anomaly", 1, 2, None, 6)]),  # one normal dive does not clear it
        ("0S", [("anomaly", 1, 1, None, 1)]),  # severe: at once
        ("01S", [("anomaly", 1, 2, None, 2)]),
        ("0FF", [("anomaly", 1, 2, None, 2)]),  # too fast counts too, and is never severe
        ("0F", []),
        ("01-1", [("anomaly", 1, 3, None, 2)]),  # a dive without a flag neither counts nor breaks
        ("011-0-0", [("anomaly", 1, 2, 6, 2)]),
        ("0121", [("anomaly", 1, 3, None, 2)]),  # flag 2 says nothing of an anomaly
        ("0112020", [("anomaly", 1, 2, 6, 2)]),
        ("022", [("false_alarm", 1, 2, None, 2)]),
        ("02211", [("false_alarm", 1, 2, 4, 2), ("anomaly", 3, 4, None, 2)]),  # flag 1 believes the flow
        ("01100110", [("anomaly", 1, 2, 4, 2), ("anomaly", 5, 6, None, 2)]),
        ("-----", []),
    ],
)
def test_counting(letters, expected):
    assert summary(letters) == expected


def test_thresholds_are_parameters():
    rules = RuleParams(
        anomaly=AnomalyRule(open_after=3, open_after_severe=2, clear_after=1, severity=Severity.WARNING),
        false_alarm=FalseAlarmRule(open_after=1, clear_after=3, severity=Severity.INFO),
    )
    assert summary("110", rules) == []
    assert summary("1110", rules) == [("anomaly", 0, 2, 3, 3)]
    assert summary("S", rules) == [] and summary("1S", rules) == [("anomaly", 0, 1, None, 2)]
    assert summary("20000", rules) == [("false_alarm", 0, 0, 3, 1)]
    _, incidents = history("2000111", rules)
    assert sorted((i.kind, i.severity) for i in incidents.values()) == [
        (Kind.ANOMALY, Severity.WARNING),
        (Kind.FALSE_ALARM, Severity.INFO),
    ]


def test_severe_is_never_harder_to_open_than_others():
    rules = RuleParams(anomaly=AnomalyRule(open_after=1, open_after_severe=3))
    assert summary("S", rules) == [("anomaly", 0, 0, None, 1)]


def test_an_incident_is_named_by_its_first_dive():
    _, incidents = history("0011")
    assert list(incidents) == ["electa/anomaly/2000"]


def test_the_worst_dive_is_the_one_furthest_out():
    state, _ = history("1")
    for k, speed in enumerate((0.20, 0.10, 0.30, 0.12), start=1):
        state, (incident,) = advance(state, dive(k, "1", speed=speed), RuleParams())
    assert incident.worst.speed == 0.10 and incident.last.speed == 0.12
    state, _ = history("2")
    for k, p_e in enumerate((0.5, 0.9, 0.4), start=1):
        state, (incident,) = advance(state, dive(k, "2", p_e=p_e), RuleParams())
    assert incident.worst.p_e == 0.9


def test_a_normal_dive_does_not_become_the_last_flagged_one():
    _, incidents = history("110")
    (incident,) = incidents.values()
    assert incident.last.t_dive == 1000.0


def test_departure_and_severity_without_numbers():
    nothing = replace(SLOW, speed=None, p_e=None)
    assert departure(nothing, Kind.ANOMALY) == 0.0 and departure(nothing, Kind.FALSE_ALARM) == 0.0
    assert not is_severe(nothing)
    assert not is_severe(replace(SLOW, speed=0.667 * SLOW.speed_min))
    assert is_severe(replace(SLOW, speed=-0.1))


def test_the_table_knows_every_event_that_can_happen():
    """What is not in the table cannot happen: nothing is cleared that is not open, nor opened twice."""
    missing = {(p, e) for p in Phase for e in Event} - set(TRANSITIONS)
    assert missing == {
        (Phase.OK, Event.CLEARED),
        (Phase.PENDING, Event.CLEARED),
        (Phase.OPEN, Event.CONFIRMED),
    }


def oracle(
    letters: str,
    wanted: str,
    silent: str,
    open_after: int,
    severe_after: int,
    clear_after: int,
    during: frozenset[int] = frozenset(),
):
    """The rule in plain words over the dives that say something: (first, opening, clearing dive).

    On dives ``during`` something else explains what is wanted: what was open is over.
    """
    out, row, normal, is_open = [], [], 0, False
    for k, letter in enumerate(letters):
        if letter in silent:
            continue
        if k in during:
            if is_open:
                out[-1][2] = k
            row, normal, is_open = [], 0, False
            continue
        if letter in wanted:
            normal = 0
            row.append(k)
            if not is_open and (len(row) >= open_after or (letter == "S" and len(row) >= severe_after)):
                is_open = True
                out.append([row[0], k, None])
        else:
            normal += 1
            if is_open and normal >= clear_after:
                is_open, row = False, []
                out[-1][2] = k
            elif not is_open:
                row = []
    return [tuple(x) for x in out]


@given(
    st.text("01SF2-", max_size=30), st.integers(1, 4), st.integers(1, 3), st.integers(1, 4), st.integers(1, 3)
)
def test_any_history_against_the_rule_in_plain_words(letters, open_a, severe, clear_a, open_f):
    rules = RuleParams(
        anomaly=AnomalyRule(open_after=open_a, open_after_severe=severe, clear_after=clear_a),
        false_alarm=FalseAlarmRule(open_after=open_f, clear_after=clear_a),
    )
    found = summary(letters, rules)
    anomalies = oracle(letters, "1SF", "2-", open_a, severe, clear_a)
    assert [x[1:4] for x in found if x[0] == "anomaly"] == anomalies
    open_on = {k for _, a, b in anomalies for k in range(a, len(letters) if b is None else b)}
    others = oracle(letters, "2", "-", open_f, 99, clear_a, frozenset(open_on))
    assert [x[1:4] for x in found if x[0] == "false_alarm"] == others


def near_the_bound(k, speed):
    """A dive whose speed is normal, where the usual one is known."""
    known = {"usual_speed": 0.23}
    return dive(k, "0", speed=speed, speed_min=0.18, speed_max=0.3, evidence=known)


def test_an_anomaly_is_not_over_just_inside_the_bound():
    slow = [replace(near_the_bound(k, 0.1), flag=1) for k in (1, 2)]
    state = RuleStates()
    for each in (*slow, *(near_the_bound(k, 0.181) for k in (3, 4, 5))):
        state, _ = advance(state, each, RuleParams())
    assert state.anomaly.incident is not None
    for k in (6, 7):
        state, _ = advance(state, near_the_bound(k, 0.22), RuleParams())
    assert state.anomaly.incident is None


def test_a_speed_that_is_hardly_known_is_not_severe():
    slow = replace(near_the_bound(1, 0.05), flag=1)
    assert is_severe(replace(slow, evidence={"speed_sigma": 0.02}))
    assert not is_severe(replace(slow, evidence={"speed_sigma": 0.1}))
