"""What rules of health find becomes incidents and notices: once each, worse, reminded of, over."""

from __future__ import annotations

import itertools
from dataclasses import replace

import pytest

from alert_support import SLOW, incident
from dives_by_letters import Talk
from gliderwatch.health.rule import Finding
from gliderwatch.health.rules import RULES
from gliderwatch.incidents.acknowledgement import acknowledge_thread
from gliderwatch.incidents.health import HealthThread, announce, health_incidents
from gliderwatch.incidents.notices import HealthFound, HealthOver, HealthReminder, Notice, Situation
from gliderwatch.messages.health_text import blocks
from gliderwatch.messages.notice_text import render
from gliderwatch.model import Fix, Incident, Kind, Severity

T0, HOUR, DAY = 1.7e9, 3600.0, 86400.0
Row = tuple[float, dict[str, Finding | None]]


def finding(t: float, severity: Severity = Severity.WARNING, rule: str = "vacuum") -> Finding:
    last = tuple((t - HOUR * k, 27000.0 - 100 * k) for k in range(10, 0, -1))
    return Finding(
        rule, severity, t - HOUR, "vacuum 5.90 inHg, twice in a row below 6.00 inHg", "vacuum", last
    )


def rows(*found: Severity | None, start: float = T0, step: float = 3 * HOUR) -> list[Row]:
    times = [start + step * k for k in range(len(found))]
    return [(t, {"vacuum": None if s is None else finding(t, s)}) for t, s in zip(times, found, strict=True)]


def notices(all_rows: list[Row], **ack: Severity) -> list[Notice]:
    """The notices as the rows come one after another."""
    threads: tuple[HealthThread, ...] = ()
    out, acks = [], {}
    for n in range(1, len(all_rows) + 1):
        threads, due = announce(threads, "a", all_rows[:n], Fix(T0, 1.0, 2.0), acks, 24.0)
        out += due
        if threads and "severity" in ack:
            identity = threads[0].id
            acks = {identity: acknowledge_thread(identity, ack["severity"], "ann", "", T0)}
    return out


W, C = Severity.WARNING, Severity.CRITICAL


def test_found_once_worse_once_and_over_after_four_normal_ones() -> None:
    found = notices(rows(None, W, W, W, C, C, None, None, None, W, None, None, None, None, None))
    assert [type(n.content) for n in found] == [HealthFound, HealthFound, HealthOver]
    first, worse, over = found
    assert (first.kind, first.severity, worse.severity) == (Kind.HEALTH, W, C)
    assert (over.kind, over.audience) == (Kind.ALL_CLEAR, C)
    assert len({n.thread for n in found}) == 1 and len({n.id for n in found}) == 3
    assert first.thread == f"a/health/vacuum/{T0 + 2 * HOUR:.0f}"


def test_reminders_until_somebody_takes_it_on() -> None:
    long = rows(*[W] * 60)  # a week
    assert [type(n.content) for n in notices(long)] == [HealthFound] + [HealthReminder] * 4
    assert [type(n.content) for n in notices(long, severity=W)] == [HealthFound]
    worse = rows(*[W] * 20, *[C] * 20)
    kinds = [type(n.content) for n in notices(worse, severity=W)]
    assert kinds[:2] == [HealthFound, HealthFound] and HealthReminder in kinds


def test_comes_again_in_a_thread_of_its_own() -> None:
    again = rows(W, *[None] * 4, W, None)
    found = notices(again)
    assert [type(n.content) for n in found] == [HealthFound, HealthOver, HealthFound]
    assert found[0].thread != found[2].thread


@pytest.mark.parametrize(("days", "together"), [(6.5, True), (7.5, False)])
def test_what_is_back_within_a_week_of_its_end_is_over_after_a_week_without(
    days: float, together: bool
) -> None:
    """A vacuum of 6.00 inHg: four incidents in 15 days told a pilot nothing."""
    quiet = [None] * round(8 * days)
    found = notices(rows(W, *[None] * 4, W, *quiet, W, *[None] * 60))
    more = [HealthReminder, HealthOver] if together else [HealthOver, HealthFound, HealthOver]
    assert [type(n.content) for n in found] == [HealthFound, HealthOver, HealthFound, *more]
    over = next(n for n in found[3:] if type(n.content) is HealthOver)
    assert over.time - found[2].time == ((days * together + 7) * DAY + 3 * HOUR * together)


@pytest.mark.parametrize(("days", "is_back"), [(6.5, True), (7.5, False)])
def test_what_comes_a_week_after_its_end_is_over_as_the_first_was(days: float, is_back: bool) -> None:
    found = notices(rows(W, *[None] * (4 + round(8 * days) - 1), W, *[None] * 60))
    assert [type(n.content) for n in found] == [HealthFound, HealthOver, HealthFound, HealthOver]
    assert found[3].time - found[2].time == (7 * DAY if is_back else 12 * HOUR)


def test_row_in_which_a_rule_has_nothing_to_look_at_says_nothing() -> None:
    silent: list[Row] = [(T0 + 10 * HOUR * k, {}) for k in range(1, 9)]
    (one,) = health_incidents("a", [*rows(W), *silent])
    assert one.cleared_at is None


def test_late_data_that_take_the_finding_back_withdraw_it() -> None:
    threads, (found,) = announce((), "a", rows(None, W), None, {}, None)
    threads, (over,) = announce(threads, "a", rows(None, None), None, {}, None)
    assert isinstance(over.content, HealthOver) and over.content.is_withdrawn
    assert over.thread == found.thread
    assert announce(threads, "a", rows(None, None, None), None, {}, None)[1] == []


def test_late_data_that_move_its_beginning_keep_the_thread() -> None:
    threads, (found,) = announce((), "a", rows(None, W, W), None, {}, None)
    threads, none = announce(threads, "a", rows(W, W, W), None, {}, None)
    assert none == [] and [t.id for t in threads] == [found.thread]


def test_what_was_over_long_before_it_was_known_is_no_news() -> None:
    old = rows(W, *[None] * 20)
    assert announce((), "a", old, None, {}, None) == ((), [])


def test_message_says_what_the_rule_and_the_last_ten_values() -> None:
    (notice,) = notices(rows(C))
    alert = render(notice)
    assert alert.title == "a VACUUM: vacuum 5.90 inHg"
    assert "Last values: ▁▂▃▃▄▅▆▆▇█ vacuum 7.68 inHg to 7.94 inHg, 2023-11-14 12:13 UTC" in alert.body
    assert "`health.vacuum`" in alert.body and "01° 00.000' N" in alert.body
    for each in notices(rows(*[W] * 20, *[None] * 5)):
        assert render(each).title.startswith(("a VACUUM", "a STILL VACUUM", "a ALL CLEAR: vacuum"))


@pytest.mark.parametrize("rule", [rule.name for rule in RULES])
def test_every_rule_has_words(rule: str) -> None:
    (_, notice), *_ = [announce((), "a", [(T0, {rule: finding(T0, C, rule)})], None, {}, None)]
    (alert,) = map(render, notice)
    assert rule.replace("_", " ").upper() in alert.title


def test_blocks_rise_with_values() -> None:
    assert blocks([1.0, 2.0, 3.0]) == "▁▅█"
    assert all(a <= b for a, b in itertools.pairwise(blocks([float(v) for v in range(10)])))


def rolling(cleared: float | None = None, low: float = -0.1) -> Incident:
    """An anomaly from `T0` + 2 h on of a glider that rolls by 0.4 rad where `low` to 0.2 are usual."""
    evidence = {"roll_mean": 0.4, "roll_mean_low": low, "roll_mean_high": 0.2 if low < 0 else 0.5}
    return incident(replace(SLOW, evidence=evidence), since=T0 + 2 * HOUR, cleared_at=cleared)


def roll(n: int, of: int) -> list[Row]:
    """`of` rows of which the first `n` find a roll."""
    times = [T0 + 3 * HOUR * k for k in range(1, of + 1)]
    return [(t, {"roll": finding(t, W, "roll") if k < n else None}) for k, t in enumerate(times)]


def test_roll_beside_an_anomaly_that_rolls_is_no_incident_of_its_own() -> None:
    assert announce((), "a", roll(1, 1), None, {}, 24.0, (rolling(),)) == ((), [])
    straight = rolling(low=0.3)  # slow, but it rolls as usual
    assert len(announce((), "a", roll(1, 1), None, {}, 24.0, (straight,))[1]) == 1
    vacuum = announce((), "a", rows(W), None, {}, 24.0, (rolling(),))[1]
    assert len(vacuum) == 1


def test_roll_reported_before_the_anomaly_joins_it_without_an_all_clear() -> None:
    threads, (first,) = announce((), "a", roll(1, 1), None, {}, 24.0)
    for n in range(2, 60):
        threads, none = announce(threads, "a", roll(n, n), None, {}, 24.0, (rolling(),))
        assert none == [] and threads[0].is_over
    for n in range(60, 66):
        threads, none = announce(threads, "a", roll(59, n), None, {}, 24.0, (rolling(),))
        assert none == []
    over = rolling(cleared=T0 + 200 * HOUR)
    assert announce(threads, "a", roll(59, 66), None, {}, 24.0, (over,))[1] == []
    (again,) = announce(threads, "a", roll(70, 70), None, {}, 24.0, (over,))[1]  # it still rolls
    assert isinstance(again.content, HealthFound) and again.thread == first.thread


def test_all_clear_says_what_is_still_open() -> None:
    *_, over = notices(rows(W, *[None] * 4))
    assert isinstance(over.content, HealthOver)
    content = replace(over.content, situation=Situation(others=(rolling(),)))
    alert = render(replace(over, content=content))
    assert alert.title == "a anomaly STILL OPEN, vacuum is over"
    assert "Go on with what is still open" in alert.body


def test_trend_is_over_after_two_days_of_files() -> None:
    def leak(k: int, is_there: bool) -> Row:
        t = T0 + 3 * HOUR * k
        return t, {"slow_leak": finding(t, W, "slow_leak") if is_there else None}

    (still,) = health_incidents("a", [leak(0, True), *(leak(k, False) for k in range(1, 16))])
    (over,) = health_incidents("a", [leak(0, True), *(leak(k, False) for k in range(1, 17))])
    assert still.cleared_at is None and over.cleared_at is not None


def test_the_reminders_of_an_incident_of_dives_are_those_of_what_is_not_worse() -> None:
    """One fault, an oil leak: slow, and a poor vacuum. Two rows of reminders would be twelve in 15 days."""
    long, worse = rows(*[W] * 60), rows(*[C] * 60)
    for found, reminded, expected in ((long, W, 0), (long, C, 0), (long, None, 4), (worse, W, 4)):
        threads: tuple[HealthThread, ...] = ()
        kinds = []
        for n in range(1, len(found) + 1):
            threads, due = announce(threads, "a", found[:n], None, {}, 24.0, (), reminded)
            kinds += [type(each.content) for each in due]
        assert kinds == [HealthFound] + [HealthReminder] * expected


def test_the_reminder_of_an_incident_names_what_is_open_of_health() -> None:
    talk = Talk()
    talk.update("0110")
    threads, _ = announce((), "electa", rows(W, W), None, {}, 24.0)
    talk.notified = replace(talk.notified, health=threads)
    assert talk.update("0110" + "1" * 12) == ["reminder"]
    assert "So is the vacuum since " in " ".join(talk.alerts[-1].body.split())
