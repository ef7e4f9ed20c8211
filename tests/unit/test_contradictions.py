"""What messages once contradicted themselves with, and what is said now in the same case.

One case for each such text; `tests/property/test_wavering.py` looks for them on random missions.
"""

from collections.abc import Callable
from dataclasses import replace

import pytest

import written
from alert_support import DISAGREE, SLOW, incident
from dives_by_letters import Talk
from dives_by_letters import dive as by_letter
from gliderwatch.estimation.glider import Estimate, step
from gliderwatch.incidents.state_machine import RuleStates, advance, is_severe
from gliderwatch.messages.causes import DRAG, FLOW
from gliderwatch.messages.evidence import weigh
from gliderwatch.model import Kind, Severity
from gliderwatch.params import GliderParams, RuleParams
from joint_support import mission, ways
from silent import CALL, HOUR, INTERVAL, MARGIN, T0, Clock, Sea, expected
from wavering import words

WHO = {"alert_id": "a1", "audience": Severity.CRITICAL}
DUE = T0 + INTERVAL + MARGIN


def one_line(text: str) -> str:
    return " ".join(text.split())


def of_silence(clock: Clock) -> str:
    return " | ".join(one_line(f"{a.title}. {a.body}") for a in clock.alerts)


def silent_until_due() -> Clock:
    clock = Clock(Sea().call(T0 - INTERVAL).call(T0))
    clock.at(DUE)
    return clock


def normal_again_while_an_anomaly_is_open() -> str:
    """Measurements disagree, then the glider is slow, and they agree: the anomaly goes on."""
    talk = Talk()
    for letters in ("022", "02211", "022111", "0221110", "02211101"):
        talk.update(letters)
    return " | ".join(one_line(f"{a.title}. {a.body}") for a in talk.alerts)


def cleared_at_the_bound() -> str:
    """Slow dives, then dives that are just inside of the range of 0.18 to 0.28."""
    state = RuleStates()
    for k, speed in enumerate((0.1, 0.1, *(0.179 + 0.001 * k for k in range(8)))):
        near = by_letter(k, "0", speed=speed, speed_min=0.179, evidence={"usual_speed": 0.23})
        state, _ = advance(state, replace(near, flag=int(speed < 0.179)), RuleParams())
    return "open" if state.anomaly.incident is not None else "cleared at 0.179 with the bound at 0.179"


def severe_where_hardly_known() -> str:
    vague = by_letter(1, "1", speed=0.05, speed_min=0.18, evidence={"speed_sigma": 0.1, "usual_speed": 0.23})
    _, opened = advance(RuleStates(), vague, RuleParams())
    return "critical on one dive of 0.05 +- 0.10" if is_severe(vague) or opened else "waits for the next"


def own_speed_beside_the_range_of_the_speed_through_water() -> str:
    """W 20 % low: 0.184 m/s are 0.17 through the water, below 0.18."""
    low = replace(SLOW, speed_min=0.18, speed_max=0.28, evidence={"onboard_speed": 0.184})
    for_it, against = weigh(low, Kind.ANOMALY, DRAG)
    return " | ".join((*for_it, *against))


def flow_and_reference_apart(flow_sigma: float) -> str:
    apart = replace(
        DISAGREE,
        p_e=0.2,
        reference_u=SLOW.flow_u - 0.16,
        reference_v=SLOW.flow_v,
        evidence={"flow_sigma": flow_sigma},
    )
    for_it, against = weigh(apart, Kind.FALSE_ALARM, FLOW)
    return " | ".join((*for_it, *against))


def unknown_speed_beside_a_learnt_range() -> str:
    """A glider that has learnt its range, and a dive of which no track is known."""
    state, params = Estimate(), GliderParams()
    dives = mission(ways(14, 3, lambda k: 0.7 * (k // 5)))
    for dive in dives[:-1]:
        state, _ = step(state, dive, params, "p")
    _, blind = step(state, replace(dives[-1], track=None), params, "p")
    assert blind.speed is None
    return one_line(written.surfacing(blind, None, alert_id="a").body)


def range_whose_upper_bound_is_none() -> str:
    wide = replace(SLOW, speed_min=0.44, speed_max=1.3, evidence={**SLOW.evidence, "usual_speed": 0.5})
    return one_line(written.opened(incident(wide), wide, **WHO).body)


def overdue_before_it_calls_again() -> str:
    clock = silent_until_due()
    second = T0 + INTERVAL + 2 * MARGIN
    clock.sea.call(second - HOUR)
    clock.at(second)
    return of_silence(clock)


def late_by_five_minutes() -> str:
    clock = silent_until_due()
    clock.sea.call(DUE - 120, at=DUE + 180)
    clock.sea.files[-1] = replace(clock.sea.files[-1], last_t=DUE - 120)
    clock.at(DUE + 180)
    return of_silence(clock)


def interval_grows() -> str:
    """From 2.6 h to 6 h."""
    sea = Sea()
    sea.expected = lambda until: expected(T0, t=T0 + 2.6 * HOUR)  # type: ignore[method-assign]
    for k in (3, 2, 1, 0):
        sea.call(T0 - k * 2.6 * HOUR)
    clock = Clock(sea)
    clock.exactly(T0 + 6 * HOUR, T0 + CALL)
    return of_silence(clock) or "nothing"


@pytest.mark.parametrize(
    ("made", "never", "instead"),
    [
        (normal_again_while_an_anomaly_is_open, "ALL CLEAR|again|is over", "now more likely"),
        (cleared_at_the_bound, "cleared", "open"),
        (severe_where_hardly_known, "critical", "waits"),
        (own_speed_beside_the_range_of_the_speed_through_water, "within the normal range", "out of the"),
        (lambda: flow_and_reference_apart(0.01), "agree: 0.16|within their errors", "0.16 m/s apart, which"),
        (lambda: flow_and_reference_apart(0.08), "agree: 0.16", "0.16 m/s apart, within their errors"),
        (unknown_speed_beside_a_learnt_range, r"normal 0\.15|0\.75", r"\(normal 0\.20-0\.31\)"),
        (range_whose_upper_bound_is_none, r"1\.30", r"\(normal above 0\.44\)"),
        (overdue_before_it_calls_again, "STILL OVERDUE", "calls again"),
        (late_by_five_minutes, "came late", "calls again"),
        (interval_grows, "OVERDUE", "nothing"),
    ],
)
def test_what_once_contradicted_itself(made: Callable[[], str], never: str, instead: str) -> None:
    text = made()
    assert not words(never, text), text
    assert words(instead, text), text
