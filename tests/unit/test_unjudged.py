"""When a glider of which nothing can be judged is told: the rule alone, on what is known and the time."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gliderwatch.incidents.notices import Unjudged
from gliderwatch.incidents.notifications import NotificationState
from gliderwatch.incidents.open_threads import unacknowledged
from gliderwatch.incidents.overdue import Sign
from gliderwatch.incidents.unjudged import UnjudgedThread, announce, blindness
from gliderwatch.messages.notice_text import render
from gliderwatch.messages.template import escalated
from gliderwatch.messages.unjudged_text import CURES
from gliderwatch.model import Alert, Hindrance, Incident, Kind, NextSurfacing, Severity, Unusable
from gliderwatch.params import Attention

HOUR, DAY = 3600.0, 86400.0
T0 = 1_700_000_000.0
STEP = 4 * HOUR
USUAL = Attention()


@dataclass
class Sea:
    """`rules.unknown.Known` of a glider whose files come every four hours."""

    flagged: list[float] = field(default_factory=list)
    lost: list[Unjudged] = field(default_factory=list)
    came: list[Sign] = field(default_factory=list)
    interval: float = STEP
    glider: str = "electa"

    def dive(self, k: int, cause: Unusable | Hindrance | None = None, words: str = "") -> Sea:
        """What begins at the k-th step: judged, or not because of a cause."""
        start, end = T0 + k * STEP, T0 + (k + 1) * STEP - 900.0
        self.came.append(Sign(start, end if not isinstance(cause, Hindrance) else None, end))
        if cause is None and not words:
            self.flagged.append(end)
        else:
            self.lost.append(Unjudged(start, end, cause, words, "ab" if cause is Hindrance.NO_CACHE else ""))
        return self

    def expected(self, until: float) -> NextSurfacing | None:
        return NextSurfacing(T0, T0 + self.interval, 60.0, None, None, 0.0, 0.0, 0.0, "")

    def last_surfacing(self, until: float) -> None:
        return None

    def came_up(self, t: float) -> str:
        return ""

    def incidents(self) -> tuple[Incident, ...]:
        return ()

    def judged(self, until: float) -> float | None:
        return max((t for t in self.flagged if t <= until), default=None)

    def unjudged(self, since: float) -> tuple[Unjudged, ...]:
        return tuple(item for item in self.lost if item.start > since)

    def signs(self, since: float) -> tuple[Sign, ...]:
        return tuple(s for s in self.came if s.opened_at >= since)


def now(k: int) -> float:
    """When what began at the k-th step has come."""
    return T0 + (k + 1) * STEP


class Talk:
    """All that is said while things come, one a step."""

    def __init__(self, sea: Sea, attention: Attention = USUAL) -> None:
        self.sea, self.attention = sea, attention
        self.notified: UnjudgedThread | None = None
        self.alerts: list[Alert] = []

    def update(self, k: int, *cause: Unusable | Hindrance | str | None) -> list[Kind]:
        self.sea.dive(k, *cause)  # type: ignore[arg-type]
        self.notified, new = announce(self.notified, self.sea, self.attention, 24.0, now(k))
        self.alerts += map(render, new)
        return [a.kind for a in new]


@pytest.mark.parametrize("cause", [cause for cause in CURES if cause is not None])
def test_each_cause_is_told_with_its_cure_once_and_clears(cause: Unusable | Hindrance) -> None:
    talk = Talk(Sea())
    for k in range(10):
        talk.update(k, *((cause, "so it is") if k >= 3 else ()))
    (alert,) = talk.alerts
    assert alert.kind is Kind.UNKNOWN
    assert alert.severity == alert.audience == Severity.WARNING
    assert "CANNOT BE JUDGED" in alert.title and "so it is. " in alert.body
    assert "Main reason: 7 " in alert.body
    assert CURES[cause].format(cache="ab.cac")[1:] in alert.body
    assert talk.update(10) == [Kind.ALL_CLEAR] and talk.update(11) == []
    assert talk.alerts[-1].incident == alert.incident and talk.alerts[-1].audience == Severity.WARNING
    assert {a.id for a in talk.alerts} == {f"{alert.incident}/0", f"{alert.incident}/1"}


def test_every_cause_that_can_hold_for_long_has_a_cure() -> None:
    never = {Hindrance.GONE, Hindrance.RENAMED}  # they are not counted (`store.state_file`)
    assert (set(Hindrance) | set(Unusable)) - never <= CURES.keys()


def test_the_most_frequent_reason_comes_first() -> None:
    talk = Talk(Sea())
    for k in range(7):
        talk.update(
            k, *((Unusable.NO_HEADING, "no heading") if k % 3 == 0 else (Hindrance.NO_CACHE, "no cache"))
        )
    body = talk.alerts[0].body
    assert "Main reason: 4 files: no cache" in body and "- 3 dives: no heading" in body
    assert body.index("Copy ab.cac from") < body.index("Add m_heading")


@pytest.mark.parametrize(("dives", "hours", "n"), [(8, None, 8), (3, 24.0, 3), (None, 12.0, 4), (8, 12.0, 4)])
def test_by_dives_or_hours_whichever_is_first(dives: int | None, hours: float | None, n: int) -> None:
    talk = Talk(Sea(interval=HOUR), Attention(unknown_hours=hours, unknown_dives=dives))
    notified = [bool(talk.update(k, Hindrance.DAMAGED, "bad")) for k in range(n)]
    assert notified == [False] * (n - 1) + [True]


def test_a_glider_that_calls_once_a_day_is_given_two_calls() -> None:
    sea = Sea(interval=DAY)
    sea.lost = [Unjudged(T0, T0 + 26 * HOUR, Unusable.NOT_SURFACED, "no fix")]
    sea.came = [Sign(T0, T0 + 26 * HOUR, T0 + 26 * HOUR)]
    assert blindness(sea, USUAL, T0 + 26 * HOUR) is None
    sea.interval = 6 * HOUR
    assert blindness(sea, USUAL, T0 + 26 * HOUR) is not None


def test_a_pause_makes_another_deployment_of_it() -> None:
    talk = Talk(Sea())
    assert not any(talk.update(k, Unusable.NO_HEADING, "no heading") for k in (0, 1, 2, 10, 11, 12))
    assert talk.alerts == []


def test_short_files_are_no_dives() -> None:
    """Of tests on deck: one every ten minutes."""
    sea = Sea()
    for k in range(100):
        start = T0 + 600.0 * k
        sea.lost.append(Unjudged(start, start + 300.0, Hindrance.NO_CACHE, "no cache", "ab"))
        sea.came.append(Sign(start, None, start + 300.0))
    assert blindness(sea, USUAL, T0 + 17 * HOUR) is None


def test_silence_is_not_counted() -> None:
    """One file that was not read, and then nothing: that is overdue, and nothing else."""
    sea = Sea().dive(0).dive(1, Hindrance.NO_CACHE, "no cache")
    assert all(blindness(sea, USUAL, now(1) + k * HOUR) is None for k in range(0, 1000, 5))


def test_reminders_thin_out() -> None:
    talk = Talk(Sea())
    days = [now(k) / DAY for k in range(30 * 6) if talk.update(k, Unusable.NO_HEADING, "no heading")]
    assert [round(b - a) for a, b in pairwise(days)] == [1, 2, 4, 7, 7, 7]


def test_the_same_trouble_again_is_another_thread() -> None:
    talk = Talk(Sea())
    for k in range(20):
        talk.update(k, *((Unusable.NO_HEADING, "no heading") if k != 8 else ()))
    assert [a.kind for a in talk.alerts] == [Kind.UNKNOWN, Kind.ALL_CLEAR, Kind.UNKNOWN]
    assert talk.alerts[0].incident != talk.alerts[2].incident


@given(st.lists(st.booleans(), max_size=40), st.randoms())
def test_it_is_a_function_of_what_is_known(flagged: list[bool], luck) -> None:
    """In whatever order it came; and never while one of the last dives before the limit was judged."""
    sea = Sea()
    for k, healthy in enumerate(flagged):
        sea.dive(k, *(() if healthy else (Unusable.TURNING, "turning")))
    found = blindness(sea, USUAL, now(len(flagged)))
    for held in (sea.lost, sea.came, sea.flagged):
        luck.shuffle(held)
    assert blindness(sea, USUAL, now(len(flagged))) == found
    last = len(flagged) - next((k for k, healthy in enumerate(reversed(flagged)) if healthy), len(flagged))
    assert (found is not None) == (len(flagged) - last >= 7), (
        "six times four hours, less what is at the surface"
    )


def test_while_it_goes_on_nobody_has_taken_it_on() -> None:
    """Who waits for an acknowledgement hears of it; there is no incident to acknowledge, but a mute."""
    talk = Talk(Sea())
    for k in range(7):
        talk.update(k, Unusable.NO_HEADING, "no heading")
    (alert,) = talk.alerts
    assert unacknowledged(NotificationState(unknown=talk.notified), (), {}) == {alert.incident}
    assert "gliderwatch mute electa --hours 6" in escalated(alert, 1800.0).body
    talk.update(7)
    assert unacknowledged(NotificationState(unknown=talk.notified), (), {}) == frozenset()
