"""What a glider tells in its calls, from the growing log to the messages: through the store, as it comes."""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path

import pytest

from gliderwatch.incidents.acknowledgement import acknowledge_thread
from gliderwatch.incidents.open_threads import unacknowledged
from gliderwatch.model import Alert, Happening, Kind, SegmentId, Severity
from gliderwatch.params import GliderParams
from gliderwatch.service import judgement, transaction
from gliderwatch.service.replay import Request, replay
from gliderwatch.service.replay_files import unassessed
from gliderwatch.service.routing import Routing
from gliderwatch.store.state_file import Status, Store

T0 = 1737876100.0
HOUR = 3600.0
SPEAKING = Routing(channels=lambda alert: ["mail"], notices=lambda glider: False)
ABORTING = "62.87 28 behavior ?_-1: abort_the_mission(1): (24)MS_ABORT_LEAK\n"
FELL = "Mission completed ABNORMALLY\nSEQUENCE: Running lastgasp.mi on try 0\n"
PROMPT = "GliderDos A 24 >"
DONE = "zModem transfer DONE for file 01030033.scd\n"
LOST = "Connection Event: Carrier Detect lost.\n"


def history(count: int, cause: str = "LEAK", t: float | None = T0 - HOUR) -> str:
    text = f"ABORT HISTORY: total since reset: {count}\n"
    if count:
        text += f"ABORT HISTORY: last abort cause: MS_ABORT_{cause}\n"
    if count and t is not None:
        at = datetime.fromtimestamp(t, UTC).strftime("%Y-%m-%dT%H:%M:%S")
        text += f"ABORT HISTORY: last abort time: {at}\n"
    return text


def status(t: float, mission: str = "ew33.mi", *, lat: float = 61.0) -> str:
    at = datetime.fromtimestamp(t, UTC).strftime("%a %b %e %H:%M:%S %Y")
    running = f"MissionName:{mission} MissionNum:electa-2025-022-0-33 (0103.0033)\n" if mission else ""
    return (
        f"Connection Event: Carrier Detect found.\n{running}Vehicle Name: electa\n"
        f"Curr Time: {at} MT:  263958\n"
        f"GPS Location:  {lat * 100:.3f} N   228.117 E measured     40.692 secs ago\n"
    )


class Dock:
    """A store, and the logs that come to it."""

    def __init__(self, folder: Path, store: Store) -> None:
        self.folder, self.store, self.now = folder, store, T0

    def write(self, t: float, text: str, *, mode: str = "w") -> Path:
        stamp = datetime.fromtimestamp(t + 15, UTC).strftime("%Y%m%dT%H%M%S")
        path = self.folder / f"electa_{stamp}_network_net_0.log"
        with path.open(mode, newline="") as file:
            file.write(text.replace("\n", "\r\n"))
        return path

    def come(self, path: Path, now: float) -> list[Alert]:
        found = judgement.judge_log(path, self.store, lambda glider: glider == "electa")
        if found is None:
            return []
        return list(transaction.process_log(self.store, *found, GliderParams(), SPEAKING, now).alerts)

    def call(self, t: float, text: str) -> list[Alert]:
        return self.come(self.write(t, text), t + 300)


@pytest.fixture
def dock(tmp_path: Path) -> Iterator[Dock]:
    with closing(Store.open(tmp_path / "state.sqlite")) as store:
        yield Dock(tmp_path, store)


def titles(alerts: list[Alert]) -> list[str]:
    return [alert.title for alert in alerts]


class TestAborts:
    def test_abort_is_told_while_the_call_goes_on_and_once(self, dock: Dock) -> None:
        path = dock.write(T0, status(T0) + history(0))
        assert dock.come(path, T0) == []
        dock.write(T0, ABORTING, mode="a")
        (alert,) = dock.come(path, T0 + 1)
        assert alert.title == "electa ABORTED: leak"
        assert (alert.kind, alert.severity) == (Kind.ABORT, Severity.CRITICAL)
        for _ in range(100):
            dock.write(T0, ABORTING + history(1, t=T0) + "Mission completed ABNORMALLY\n", mode="a")
            assert dock.come(path, T0 + 2) == []

    def test_prompt_after_an_abort_is_told_in_the_same_thread(self, dock: Dock) -> None:
        path = dock.write(T0, status(T0) + ABORTING)
        (first,) = dock.come(path, T0)
        dock.write(T0, FELL + PROMPT, mode="a")
        (second,) = dock.come(path, T0 + 10)
        assert second.title == "electa RUNS lastgasp.mi: it fell out of its mission"
        assert "waits at the prompt GliderDos A 24" in second.body
        assert second.incident == first.incident
        assert dock.call(T0 + HOUR, status(T0 + HOUR, "", lat=61.1) + PROMPT) == []

    def test_history_in_the_first_log_is_no_alarm(self, dock: Dock) -> None:
        (alert,) = dock.call(T0, status(T0) + history(3) + DONE)
        assert (alert.severity, alert.title) == (
            Severity.INFO,
            "electa had ABORTED before: leak, 2025-01-26 06:21 UTC",
        )
        for k in range(1, 5):
            assert dock.call(T0 + k * 6 * HOUR, status(T0 + k * 6 * HOUR) + history(3) + DONE) == []

    def test_history_that_changes_is_news(self, dock: Dock) -> None:
        assert dock.call(T0, status(T0) + history(0) + DONE) == []
        t = T0 + 6 * HOUR
        (one,) = dock.call(t, status(t) + history(1, "OVERDEPTH", t - HOUR) + DONE)
        assert one.title == "electa ABORTED: too deep"
        assert dock.call(t + HOUR, status(t + HOUR, "lastgasp.mi") + history(1, "OVERDEPTH", t - HOUR)) == []

    def test_reset_is_no_news_and_all_is_clear_in_a_mission(self, dock: Dock) -> None:
        dock.call(T0, status(T0) + history(2) + DONE)
        t = T0 + 6 * HOUR
        assert dock.call(t, status(t) + history(0) + DONE) == []
        t += 6 * HOUR
        (one,) = dock.call(t, status(t, "") + ABORTING + PROMPT)
        t += 6 * HOUR
        (clear,) = dock.call(t, status(t) + history(1, t=t - 6 * HOUR) + DONE)
        assert (clear.kind, clear.incident) == (Kind.ALL_CLEAR, one.incident)
        t += 6 * HOUR
        (again,) = dock.call(t, status(t, "") + ABORTING)
        assert again.title == "electa ABORTED: leak" and again.incident != one.incident

    def test_pilot_who_ends_the_mission_raises_no_alarm(self, dock: Dock) -> None:
        text = "I heard a Control-C\nMission completed ABNORMALLY\nGliderDos A 11 >"
        alerts = dock.call(T0, status(T0) + text)
        assert {a.severity for a in alerts} == {Severity.INFO}

    @pytest.mark.parametrize(
        ("text", "title", "severity"),
        [
            ("!!HARDWARE IN EMERGENCY MODE!!\n", "electa IS IN EMERGENCY MODE", Severity.CRITICAL),
            ("drop_the_weight = 1\n", "electa DROPPED ITS WEIGHT", Severity.CRITICAL),
            (PROMPT, "electa WAITS AT GLIDERDOS: it does not fly", Severity.WARNING),
            ("SEQUENCE: About to run initial.mi\n", "electa RUNS initial.mi", Severity.CRITICAL),
        ],
    )
    def test_what_else_is_told(self, dock: Dock, text: str, title: str, severity: Severity) -> None:
        (alert,) = dock.call(T0, status(T0) + text)
        assert alert.title.startswith(title) and alert.severity is severity
        assert "61° 00.000' N" in alert.body

    def test_old_log_is_history(self, dock: Dock) -> None:
        assert dock.come(dock.write(T0, status(T0) + ABORTING + PROMPT), T0 + 30 * 86400) == []


class TestWithoutFile:
    def test_two_in_a_row_are_a_warning_and_a_file_ends_it(self, dock: Dock) -> None:
        made = [
            dock.call(t, status(t, lat=61 + k / 10) + (DONE if k in (0, 4) else "") + LOST)
            for k, t in enumerate(T0 + 6 * HOUR * k for k in range(5))
        ]
        assert [titles(alerts) for alerts in made] == [
            [],
            ["electa CALLED and sent no file"],
            ["electa CALLS WITHOUT A FILE: 2 in a row"],
            [],
            ["electa ALL CLEAR: it sends files again"],
        ]
        assert [a.severity for alerts in made for a in alerts] == [0, 1, 0]

    def test_several_connections_of_one_surfacing_are_one_call(self, dock: Dock) -> None:
        back = "I will call you back in 2 minutes\n"
        assert dock.call(T0, status(T0) + back + LOST) == []
        assert dock.call(T0 + 400, status(T0 + 400) + DONE + LOST) == []

    def test_file_that_came_by_another_way_counts(self, dock: Dock) -> None:
        with dock.store.transaction():
            dock.store.record_sign(SegmentId(T0 - 6 * HOUR, "electa", "electa-2025-025-0-3"), T0 - 60.0, T0)
        assert dock.call(T0, status(T0) + LOST) == []


@pytest.mark.parametrize("said_at", [T0 + 6 * HOUR, None])
def test_order_of_arrival_does_not_matter_for_the_end(tmp_path: Path, said_at: float | None) -> None:
    """Nor whether the first history says when the abort was: a line of it may be lost."""
    none_before = "" if said_at is None else history(0)
    texts = [none_before + DONE, ABORTING + FELL + PROMPT, history(1, t=said_at) + DONE, LOST]
    ends = set()
    for order in itertools.permutations(range(4)):
        folder = tmp_path / "".join(map(str, order))
        folder.mkdir()
        with closing(Store.open(folder / "state.sqlite")) as store:
            dock = Dock(folder, store)
            for k in order:
                t = T0 + 6 * HOUR * k
                dock.come(
                    dock.write(t, status(t, "" if k == 1 else "ew33.mi", lat=61 + k) + texts[k]), T0 + 9e4
                )
            said = store.notified("electa")
            reported = tuple(sorted(report.what for e in said.aborts for report in e.reports))
            ends.add((tuple(e.cleared is None for e in said.aborts), reported, said.empty is not None))
            aborts = [a for a in store.alerts() if a.title == "electa ABORTED: leak"]
            assert len(aborts) == 1
    each_once = (Happening.ABORTING, Happening.GLIDER_DOS, Happening.LAST_MISSION)
    assert ends == {((False,), each_once, True)}, "all clear, and a call without a file"


def test_nothing_is_lost_where_the_service_is_killed(tmp_path: Path) -> None:
    """What was read is kept in the transaction of its messages: the next start goes on behind it."""
    text = status(T0) + ABORTING + FELL
    with closing(Store.open(tmp_path / "state.sqlite")) as store:
        dock = Dock(tmp_path, store)
        path = dock.write(T0, text[:150])
        dock.come(path, T0)
    path.write_bytes(text.replace("\n", "\r\n").encode())
    rng = random.Random(1)
    for _ in range(5):
        with closing(Store.open(tmp_path / "state.sqlite")) as store:
            dock = Dock(tmp_path, store)
            dock.come(path, T0 + rng.random())
            assert [a.kind for a in store.alerts()] == [Kind.ABORT]


def test_log_that_names_no_glider_waits_and_one_of_another_is_unknown(dock: Dock) -> None:
    path = dock.write(T0, "Connection Event: Carrier Detect found.\n")
    dock.come(path, T0)
    (file,) = dock.store.files(Status.WAITING)
    assert "Vehicle Name:" in str(unassessed(dock.store, ()))
    assert "Vehicle Name:" in file.reason
    dock.write(T0, "Vehicle Name: nemo\n", mode="a")
    dock.come(path, T0)
    assert [f.glider for f in dock.store.files(Status.UNKNOWN)] == ["nemo"]


def test_replay_of_two_real_calls_of_which_one_sent_nothing(shared_data: Path) -> None:
    report = replay(Request((shared_data / "logs",)))
    alerts = report.store.alerts()
    assert [(a.kind, a.severity) for a in alerts] == [(Kind.CALL, Severity.INFO)]
    assert report.files[Status.TAKEN] == 2
    assert unassessed(report.store, ()) is None, "of logs alone no dive is expected"


class TestAnnouncedFiles:
    """A file that was announced in a call and never came is named, whatever name it would have."""

    BOTH = "Starting zModem transfer of 01030033.scd to/from electa size is 8208\n" + DONE + LOST

    def test_one_that_never_came_is_named_an_hour_later(self, dock: Dock) -> None:
        dock.call(T0, status(T0) + self.BOTH)
        known = dock.store.facts("electa")
        assert known.not_come(T0 - HOUR, T0 + 0.9 * HOUR) == ()
        assert known.not_come(T0 - HOUR, T0 + 1.1 * HOUR) == ((T0, "01030033.scd"),)

    def test_one_that_came_under_its_full_name_is_not(self, dock: Dock) -> None:
        dock.call(T0, status(T0) + self.BOTH)
        dock.store.record_sign(SegmentId(T0 - 4 * HOUR, "electa", "electa-2025-022-0-33"), None, T0 + 100)
        assert dock.store.facts("electa").not_come(T0 - HOUR, T0 + 2 * HOUR) == ()

    def test_science_files_are_not_looked_for(self, dock: Dock) -> None:
        science = self.BOTH.replace(".scd", ".tcd")
        dock.call(T0, status(T0) + science)
        assert dock.store.facts("electa").not_come(T0 - HOUR, T0 + 2 * HOUR) == ()


class TestAbortsThatGoOn:
    """Reminders come until somebody takes an abort on"""

    def prompt(self, dock: Dock, t: float) -> list[Alert]:
        return dock.call(t, status(t, "", lat=61.0 + (t - T0) / 1e6) + PROMPT)

    def test_reminder_after_a_day_and_none_once_acknowledged(self, dock: Dock) -> None:
        (first,) = dock.call(T0, status(T0) + ABORTING)
        (prompt,) = self.prompt(dock, T0 + 6 * HOUR)
        assert prompt.incident == first.incident
        assert self.prompt(dock, T0 + 26 * HOUR) == []  # not within a day of the last message
        (again,) = self.prompt(dock, T0 + 49 * HOUR)
        assert again.kind is Kind.REMINDER and again.incident == first.incident
        assert again.title == "electa STILL ABORTED: leak"
        ack = acknowledge_thread(first.incident, Severity.CRITICAL, "ann", "", T0 + 50 * HOUR)
        dock.store.notes.acknowledge("electa", ack)
        assert self.prompt(dock, T0 + 120 * HOUR) == []
        said, incidents = dock.store.notified("electa"), dock.store.facts("electa").incidents()
        assert unacknowledged(said, incidents, dock.store.notes.acks("electa")) == frozenset()
        assert unacknowledged(said, incidents, {}) == {first.incident}
