"""All gliders silent at once: one message for the shore side, not one for each glider."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from gliderwatch.model import Alert, Segment
from gliderwatch.params import GliderParams
from gliderwatch.service import transaction
from gliderwatch.service.daemon import OverdueTimer
from gliderwatch.service.replay import Request, replay
from gliderwatch.service.routing import Routing
from gliderwatch.simulate.delivery import write_mission
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Scenario
from gliderwatch.slocum.decode import decode
from gliderwatch.store.state_file import File, Status, Store

HOUR, DAY = 3600.0, 86400.0
START = Scenario().start
NAMES = ("angus", "bruce", "clyde", "dora")
SILENT = START + DAY
BACK = SILENT + 18 * HOUR

Fleet = tuple[Path, list[tuple[Path, Segment]]]


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Fleet:
    """Four gliders of which nothing comes for eighteen hours: the dockserver is down."""
    folder = tmp_path_factory.mktemp("fleet")
    found = []
    for seed, glider in enumerate(NAMES):
        mission = simulate(Scenario(seed=seed + 20, glider=glider, days=2.2))
        for path in write_mission(folder / "gliders", folder / "cache", mission):
            segment = decode(path, [folder / "cache"])
            if SILENT < segment.last_t < BACK:
                path.unlink()
            else:
                found.append((path, segment))
    return folder, sorted(found, key=lambda f: f[1].last_t)


class Shore:
    """The daemon's ticks and files, by the clock of the files."""

    def __init__(self, channels: Callable[[Alert], list[str]] = lambda a: ["mail"]) -> None:
        self.store = Store.open(":memory:")
        self.speaking = Routing(channels, lambda g: False)
        self.ticking = OverdueTimer(self.store)
        self.alerts: list[Alert] = []
        self.now = 0.0

    def live(self, segments: list[Segment], until: float) -> list[Alert]:
        """What is said while these come, and until a time."""
        before = len(self.alerts)
        for segment in [*segments, None]:
            end = until if segment is None else segment.last_t
            while self.now and self.now < end:
                alerts, pause = self.ticking.tick(NAMES, self.speaking, lambda g: False, self.now, self.now)
                self.alerts += alerts
                self.now = min(end, self.now + max(pause, 1.0))
            self.now = end
            if segment is not None:
                name = segment.id.name
                file = File(f"/{name}", 1, 1, Status.WAITING, segment.id.glider, name)
                taken = transaction.process_file(
                    self.store, file, segment, GliderParams(), self.speaking, end
                )
                self.alerts += taken.alerts
        return self.alerts[before:]


def of(fleet: Fleet, *, after: float = 0.0, before: float = 1e12, without: str = "") -> list[Segment]:
    return [s for _, s in fleet[1] if after < s.last_t < before and s.id.glider != without]


def kinds(alerts: list[Alert]) -> list[tuple[str, str]]:
    return [(a.glider, str(a.kind)) for a in alerts]


def test_one_message_for_four_gliders_and_one_all_clear(fleet: Fleet) -> None:
    shore = Shore()
    said = shore.live(of(fleet, before=SILENT), BACK)
    assert {a.glider for a in said} == {said[0].glider}, kinds(said)
    assert [str(a.kind) for a in said] == ["overdue", *["reminder"] * (len(said) - 1)]
    assert "all 4 silent: dockserver?" in said[0].title
    for name in set(NAMES) - {said[0].glider}:
        assert name in said[0].body
    assert "gets a message of its own" in said[0].body
    over = shore.live(of(fleet, after=BACK), BACK + 8 * HOUR)
    assert kinds(over) == [(said[0].glider, "all_clear")]
    assert "gets a message of its own" in over[0].body


def test_a_glider_that_does_not_come_back_with_the_others_is_told_by_itself(fleet: Fleet) -> None:
    shore = Shore()
    said = shore.live(of(fleet, before=SILENT), BACK)
    lost = next(name for name in NAMES if name != said[0].glider)
    after = shore.live(of(fleet, after=BACK, without=lost), BACK + 10 * HOUR)
    told = [a for a in after if a.glider == lost]
    assert [str(a.kind) for a in told] == ["overdue"], kinds(after)
    assert "dockserver" not in told[0].title and "3 of 3 other gliders call" in told[0].body
    assert told[0].time < BACK + 8 * HOUR


def test_it_reaches_whoever_follows_any_of_them(fleet: Fleet) -> None:
    """Each glider has a pilot of its own."""
    shore = Shore(lambda a: [f"pilot of {a.glider}"])
    shore.live(of(fleet, before=SILENT), BACK)
    shore.live(of(fleet, after=BACK), BACK + 8 * HOUR)
    rows = shore.store._db.execute(
        "SELECT alert, count(DISTINCT channel) FROM outbox GROUP BY alert"
    ).fetchall()
    assert {tuple(row)[1] for row in rows} == {4} and len(rows) == len(shore.alerts)


def test_a_replay_says_the_same(fleet: Fleet) -> None:
    shore = Shore()
    shore.live(of(fleet), BACK)
    folder, _ = fleet
    told = replay(Request((folder / "gliders",), (folder / "cache",))).store.alerts()
    ours = [replace(a, html="") for a in shore.alerts]
    assert [a for a in ours if "overdue" in a.incident] == [
        replace(a, html="") for a in told if "overdue" in a.incident
    ]
