"""The silence of simulated gliders through the whole path: live by an injected clock, and replayed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from gliderwatch.incidents.send_schedule import Wait
from gliderwatch.model import Alert, Call, Kind, Segment, SegmentId, Severity
from gliderwatch.params import Attention, GliderParams
from gliderwatch.service import transaction
from gliderwatch.service.daemon import HOLD, TICK, OverdueTimer
from gliderwatch.service.replay import Request, replay
from gliderwatch.service.routing import Routing
from gliderwatch.simulate.delivery import write_mission
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Scenario
from gliderwatch.slocum.calls import Dialog
from gliderwatch.slocum.decode import decode
from gliderwatch.slocum.header import read_header
from gliderwatch.store.state_file import File, Status, Store
from missions import segment as made

HOUR, DAY = 3600.0, 86400.0
START = Scenario().start


class Live:
    """A daemon without files and threads: segments come in, the clock ticks; it may be killed."""

    def __init__(self, path: Path | str = ":memory:", attention: Attention = Attention()) -> None:  # noqa: B008
        self.path, self.now, self.monotonic = path, 0.0, 0.0
        self.alerts: list[Alert] = []
        self.gliders: list[str] = []
        self.speaking = Routing(lambda a: ["mail"], lambda g: False, lambda g: attention)
        self.start()

    def start(self) -> None:
        self.store = Store.open(self.path)
        self.ticking = OverdueTimer(self.store)

    def kill(self) -> None:
        self.store.close()
        self.start()

    def take(self, segment: Segment, now: float | None = None) -> list[str]:
        """A file comes, by default when its last sample was taken."""
        self.gliders = sorted({*self.gliders, segment.id.glider})
        self.now = segment.last_t if now is None else now
        file = File(f"/{segment.id.name}", 1, 1, Status.WAITING, segment.id.glider, segment.id.name)
        taken = transaction.process_file(self.store, file, segment, GliderParams(), self.speaking, self.now)
        return self._told(taken.alerts)

    def tick(self, now: float, is_busy: Callable[[str], bool] = lambda glider: False) -> list[str]:
        """One tick at a time by a clock that runs evenly."""
        self.monotonic += now - self.now
        self.now = now
        alerts, self.pause = self.ticking.tick(self.gliders, self.speaking, is_busy, now, self.monotonic)
        return self._told(alerts)

    def until(self, end: float) -> list[str]:
        """Tick as the daemon does until a time."""
        said, pause = [], 0.0
        while self.now + pause < end:
            said += self.tick(self.now + pause)
            pause = self.pause
        return said

    def _told(self, alerts: Sequence[Alert]) -> list[str]:
        self.alerts += alerts
        return [str(a.kind) for a in alerts]


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[tuple[Path, Segment]]]:
    """Two gliders over two days; both are silent for most of the second one, one of them for longer."""
    folder = tmp_path_factory.mktemp("fleet")
    found = []
    for seed, glider, silent in ((11, "angus", 20 * HOUR), (12, "bruce", 12 * HOUR)):
        mission = simulate(Scenario(seed=seed, glider=glider, days=2.5))
        for path in write_mission(folder / "gliders", folder / "cache", mission):
            segment = decode(path, [folder / "cache"])
            if START + DAY < segment.last_t < START + DAY + silent:
                path.unlink()
            else:
                found.append((path, segment))
    return folder, sorted(found, key=lambda f: f[1].last_t)


def of(glider: str, fleet: tuple[Path, list[tuple[Path, Segment]]]) -> list[Segment]:
    return [s for _, s in fleet[1] if s.id.glider == glider]


def gap(segments: Sequence[Segment]) -> int:
    """The number of the first segment after the silence."""
    return max(range(1, len(segments)), key=lambda i: segments[i].last_t - segments[i - 1].last_t)


def test_live_says_what_a_replay_says(fleet) -> None:
    """Same ids, times, titles and texts; the alarm when it was due, the end when it called."""
    folder, files = fleet
    live = Live()
    live.gliders = ["angus", "bruce"]
    live.now = files[0][1].last_t
    for _, segment in files:
        live.until(segment.last_t)
        live.take(segment)
    told = replay(Request((folder / "gliders",), (folder / "cache",))).store.alerts()
    assert live.alerts == told
    assert {a.glider for a in told} == {"angus"}, "bruce, who is back first, is silent as all others are"
    assert [str(a.kind) for a in told] == ["overdue", *["reminder"] * (len(told) - 2), "all_clear"]
    assert [a.severity for a in told[:2]] == [Severity.WARNING, Severity.CRITICAL]
    before, after = of("angus", fleet)[gap(of("angus", fleet)) - 1 :][:2]
    assert before.last_t < told[0].time < told[-1].time <= after.last_t
    assert "dockserver and modem first: the other glider is silent as well" in told[0].body
    assert "dockserver" not in told[-2].title, "by then bruce calls"


def test_a_replay_knows_when_each_message_would_have_come(fleet) -> None:
    folder, _ = fleet
    store = replay(Request((folder / "gliders" / "angus",), (folder / "cache",))).store
    segments = of("angus", fleet)
    expected = store.facts("angus").expected(segments[gap(segments) - 1].last_t)
    assert expected is not None
    margin = max(3 * HOUR, expected.t - expected.after, 3 * expected.t_sigma) + 2400
    alerts = store.alerts()
    assert [a.time for a in alerts[:-1]] == pytest.approx(
        [expected.t + margin * 2**k for k in range(len(alerts) - 1)]
    )


def test_nothing_is_said_twice_after_a_kill(fleet, tmp_path: Path) -> None:
    segments = of("angus", fleet)
    calm, killed = Live(), Live(tmp_path / "state.sqlite")
    for live in (calm, killed):
        live.gliders, live.now = ["angus"], segments[0].last_t
    for segment in segments[: gap(segments) + 1]:
        for live in (calm, killed):
            while live.now < segment.last_t:
                live.until(min(live.now + HOUR, segment.last_t))
                live.now = min(live.now + 60.0, segment.last_t)
                if live is killed:
                    live.kill()
            live.take(segment)
    assert [a.id for a in killed.alerts] == [a.id for a in calm.alerts]
    assert killed.store.alerts() == killed.alerts


def test_a_replay_is_silent_between_two_deployments(tmp_path: Path) -> None:
    for k, days in enumerate((0.0, 35.0)):
        mission = simulate(Scenario(seed=k, glider="angus", days=0.5, start=START + days * DAY))
        write_mission(tmp_path / f"gliders/{k}", tmp_path / "cache", mission)
    report = replay(Request((tmp_path / "gliders",), (tmp_path / "cache",)))
    assert [a for a in report.store.alerts() if "overdue" in a.incident] == []
    assert report.store.extent("angus")[0] > 8


def silent(fleet, path: Path | str = ":memory:", **attention) -> tuple[Live, list[Segment], float]:
    """Angus before his silence, what comes after it, and when he is overdue."""
    segments = of("angus", fleet)
    n = gap(segments)
    live = Live(path, Attention(**attention))
    for segment in segments[:n]:
        live.take(segment)
    live.tick(live.now + 60.0)
    due = transaction.next_tick(live.store, "angus", live.speaking, live.now)
    return live, segments[n:], due if due is not None else float("inf")


@pytest.mark.parametrize("jitter", [0.0, 1e-5])
def test_tests_on_deck_are_not_missed(jitter: float) -> None:
    """Eight files of half an hour with hours between them; positions are old ones, or differ by a metre."""
    live, said = Live(), []
    for k in range(8):
        opened = START + 7 * HOUR * k
        t = [opened + 60.0 * i for i in range(30)]
        lat = [(x, 27.5 + jitter * ((7 * i + k) % 5)) for i, x in enumerate(t)]
        held = {"fix_lat": lat, "fix_lon": [(x, -84.0) for x in t], "depth": [(x, -0.2) for x in t]}
        held |= {"pitch": [(x, 0.02) for x in t], "heading": [(x, 1.0) for x in t]}
        said += live.take(made(f"angus-2024-119-{k}-0", opened, held, glider="angus"))
        said += live.until(live.now + 6 * HOUR)
    assert said + live.until(live.now + 5 * DAY) == []


def test_it_ticks_when_it_is_due(fleet) -> None:
    live, _, due = silent(fleet)
    assert live.pause == TICK
    live.tick(due - 20.0)
    assert live.pause == pytest.approx(20.0)
    assert live.tick(due) == ["overdue"]


def test_a_glider_whose_files_are_at_hand_is_left(fleet) -> None:
    live, _, due = silent(fleet)
    assert live.tick(due, is_busy=lambda glider: True) == []
    assert live.tick(due + 60.0) == ["overdue"]


class TestClock:
    def test_a_jump_ahead_and_back_raises_nothing(self, fleet) -> None:
        live, _, due = silent(fleet)
        before = due - 2 * HOUR
        live.tick(before)
        for offset in (DAY, 0.0):
            alerts, pause = live.ticking.tick(
                ["angus"], live.speaking, lambda g: False, before + 60 + offset, live.monotonic + 60
            )
            assert alerts == () and 0 < pause <= HOLD
        live.now, live.monotonic = before + 60, live.monotonic + 60
        assert live.tick(before + 60 + HOLD) == []
        assert live.tick(due) == ["overdue"]

    def test_a_jump_that_stays_is_believed_after_a_minute(self, fleet) -> None:
        live, _, due = silent(fleet)
        live.tick(due - DAY / 4)
        m = live.monotonic
        for seconds, said in ((1.0, 0), (HOLD - 1.0, 0), (HOLD + 2.0, 1)):
            alerts, _ = live.ticking.tick(
                ["angus"], live.speaking, lambda g: False, due + seconds, m + seconds
            )
            assert len(alerts) == said


class TestSignsOfLife:
    def test_a_file_that_waits_for_its_cache(self, fleet) -> None:
        live, after, due = silent(fleet)
        live.tick(due)
        header = after[0].id
        file = File(
            "/x", 1, 1, Status.WAITING, "angus", header.name, "cache is missing", "ab", header.opened_at
        )
        taken = transaction.record_file(live.store, file, GliderParams(), live.speaking, after[0].last_t)
        assert [str(a.kind) for a in taken.alerts] == ["all_clear"]

    def test_a_file_of_a_glider_that_is_not_configured_is_none(self, fleet) -> None:
        live, after, due = silent(fleet)
        live.tick(due)
        header = after[0].id
        file = File("/x", 1, 1, Status.UNKNOWN, "angus", header.name, "not configured", "", header.opened_at)
        assert (
            transaction.record_file(live.store, file, GliderParams(), live.speaking, due + HOUR).alerts == ()
        )

    def test_the_header_of_a_file_that_cannot_be_read(self, fleet) -> None:
        """What `judgement.judge` makes of a file tells when it was opened."""
        from gliderwatch.service.judgement import judge

        path, segment = fleet[1][0]
        assert read_header(path).id == segment.id
        found = judge(path, Store.open(":memory:"), [], lambda glider: True)
        assert isinstance(found, File) and found.opened_at == segment.id.opened_at

    def test_history_is_none(self, fleet) -> None:
        live, after, due = silent(fleet)
        live.tick(due)
        old = of("angus", fleet)[2]
        identity = SegmentId(old.id.opened_at + 60.0, "angus", "angus-of-before")
        assert live.take(replace(old, id=identity), due + HOUR) == []
        assert live.take(after[0]) == ["all_clear"]

    def test_files_of_a_call_in_time_that_come_late(self, fleet) -> None:
        folder, _ = fleet
        live, after, due = silent(fleet)
        live.tick(due)
        mission = simulate(Scenario(seed=11, glider="angus", days=2.5))
        paths = write_mission(folder / "whole", folder / "cache", mission)
        whole = [decode(path, [folder / "cache"]) for path in paths]
        late = next(
            s for s in whole if s.id.opened_at > of("angus", fleet)[gap(of("angus", fleet)) - 1].id.opened_at
        )
        assert live.take(after[0]) == ["all_clear"]
        assert live.take(late, after[0].last_t) == ["correction"]


class TestEscalation:
    """Who is second hears of a silence that nobody cares for in half an hour."""

    @pytest.fixture
    def overdue(self, fleet) -> tuple[Live, list[Segment], float]:
        live, after, due = silent(fleet)
        live.speaking = replace(
            live.speaking, channels=lambda a: {"mail": [Wait()], "sms": [Wait(after=HOUR / 2)]}
        )
        assert live.tick(due) == ["overdue"]
        return live, after, due

    def waiting(self, live: Live) -> dict[str, float]:
        return {u.alert: u.held_until for u in live.store.undelivered() if u.channel == "sms"}

    def test_it_waits_and_is_withdrawn_when_the_glider_calls(self, overdue) -> None:
        live, after, due = overdue
        assert self.waiting(live) == {live.alerts[-1].id: due + HOUR / 2}
        assert live.take(after[0], due + HOUR / 4) == ["all_clear"]
        assert self.waiting(live) == {}
        assert [u.alert for u in live.store.undelivered()] == [a.id for a in live.alerts[-2:]], "by mail"

    def test_who_was_told_of_it_is_told_of_its_end(self, overdue) -> None:
        live, after, due = overdue
        assert live.take(after[0], due + HOUR) == ["all_clear"]
        assert self.waiting(live) == {live.alerts[-2].id: due + HOUR / 2, live.alerts[-1].id: 0.0}

    @pytest.mark.parametrize("attention", [Attention(recovered=True), Attention(muted_until=2e9)])
    def test_it_is_withdrawn_where_the_configuration_mutes_the_glider(self, overdue, attention) -> None:
        live, _, due = overdue
        live.speaking = replace(live.speaking, attention=lambda glider: attention)
        transaction.notify_pilots(live.store, "angus", GliderParams(), live.speaking, due + HOUR / 4)
        assert self.waiting(live) == {}


class TestQuiet:
    def test_recovered(self, fleet) -> None:
        live, after, _ = silent(fleet, recovered=True)
        assert live.until(START + 2 * DAY) == [] and live.take(after[0]) == []

    def test_muted_and_then_told_once(self, fleet) -> None:
        end = START + DAY + 16 * HOUR
        live, after, _ = silent(fleet, muted_until=end)
        assert live.until(end) == []
        assert live.tick(end + 1.0) == ["overdue"]
        assert live.alerts[0].severity == Severity.CRITICAL
        assert live.take(after[0]) == ["all_clear"]

    def test_muted_until_after_its_call(self, fleet) -> None:
        live, after, _ = silent(fleet, muted_until=START + 10 * DAY)
        assert live.until(after[0].last_t) == [] and live.take(after[0]) == []

    @pytest.mark.parametrize("attention", [Attention(recovered=True), Attention(muted_until=2e9)])
    def test_of_all_kinds(self, fleet, attention: Attention) -> None:
        """Also of surfacing notices, which come again when the mute ends; all is assessed meanwhile."""
        live = Live(attention=attention)
        live.speaking = replace(live.speaking, notices=lambda glider: True)
        segments = of("angus", fleet)
        assert [said for segment in segments[:4] for said in live.take(segment)] == []
        assert live.store.assessments("angus")
        live.speaking = replace(live.speaking, attention=lambda glider: Attention(muted_until=0.0))
        assert live.take(segments[4]) == ["surfacing"]

    def test_who_is_recovered_is_not_compared_with(self, fleet) -> None:
        live, _, due = silent(fleet)
        for segment in of("bruce", fleet)[:8]:
            live.take(segment, live.now)
        live.speaking = replace(live.speaking, attention=lambda g: Attention(recovered=g == "bruce"))
        assert live.gliders == ["angus", "bruce"] and live.tick(due) == ["overdue"]
        assert "the only one at sea" in live.alerts[-1].body

    def test_hours_as_configured(self, fleet) -> None:
        live, _, due = silent(fleet, overdue_hours=0.5)
        expected = live.store.facts("angus").expected(live.now)
        assert expected is not None and due == expected.t + 0.5 * HOUR

    def test_an_archive_cries_no_wolf(self, fleet) -> None:
        live = Live()
        for segment in of("angus", fleet):
            live.take(segment, START + 5 * DAY)
        assert live.until(START + 8 * DAY) == []
        assert live.alerts == []

    def test_off_for_a_week(self, fleet, tmp_path: Path) -> None:
        live, _, due = silent(fleet, tmp_path / "state.sqlite")
        live.kill()
        assert live.tick(due + 7 * DAY) == ["overdue"]
        live.kill()
        assert live.tick(due + 7 * DAY + 60.0) == []

    def test_off_for_a_month(self, fleet) -> None:
        live, _, due = silent(fleet)
        assert live.tick(due + 31 * DAY) == []


def test_a_glider_that_calls_and_sends_no_file_is_not_overdue(
    fleet: tuple[Path, list[tuple[Path, Segment]]],
) -> None:
    def silence(*, calls: bool) -> set[str]:
        live, said = Live(), set[str]()
        for _, segment in fleet[1]:
            if segment.id.glider == "angus" and segment.last_t <= START + DAY:
                said |= set(live.take(segment))
        for k in range(1, 13):
            t = live.now + 6 * HOUR
            said |= set(live.until(t))
            if calls:
                call = Call("angus", f"{k}.log", t, t + 200, over=True, mission="a.mi", mission_t=t)
                file = File(f"/{k}.log", 1, 1, Status.TAKEN, "angus")
                dialog = Dialog(call)
                taken = transaction.process_log(
                    live.store, file, dialog, GliderParams(), live.speaking, t + 200
                )
                said |= {str(a.kind) for a in taken.alerts}
            live.now = t + 200
        return said

    assert Kind.OVERDUE in silence(calls=False)
    assert silence(calls=True) == {Kind.CALL}
