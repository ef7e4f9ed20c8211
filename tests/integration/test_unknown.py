"""A blind watch speaks: files that come and cannot be judged, live and replayed, with real files."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from gliderwatch.errors import GliderwatchError, MissingCache, Quarantine
from gliderwatch.model import Alert, Kind, Segment, Severity
from gliderwatch.params import Attention, GliderParams
from gliderwatch.service import judgement, run, transaction
from gliderwatch.service.backlog import Job
from gliderwatch.service.replay import Request, replay
from gliderwatch.service.routing import Routing
from gliderwatch.simulate.delivery import write_mission
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Scenario
from gliderwatch.slocum.decode import decode
from gliderwatch.slocum.header import read_header
from gliderwatch.store.state_file import File, Status, Store

HOUR, DAY = 3600.0, 86400.0
HEALTHY = 40
"""Dives before the trouble."""


class Live:
    """A daemon without threads: files come at the end of their calls and are judged as the daemon does."""

    def __init__(self, caches: Sequence[Path], attention: Attention = Attention()) -> None:  # noqa: B008
        self.store, self.caches = Store.open(":memory:"), caches
        self.speaking = Routing(lambda a: ["mail"], lambda g: False, lambda g: attention)
        self.alerts: list[Alert] = []

    def come(self, path: Path, now: float) -> None:
        found = judgement.judge(path, self.store, self.caches, lambda glider: True)
        if isinstance(found, File):
            self._note(found, now)
        elif isinstance(found, Job):
            self._take(found.file, path, now)

    def _take(self, file: File, path: Path, now: float) -> None:
        try:
            segment = decode(path, self.caches)
            taken = transaction.process_file(self.store, file, segment, GliderParams(), self.speaking, now)
        except GliderwatchError as error:
            self._note(judgement.failed(file, error), now)
        else:
            self.alerts += taken.alerts

    def _note(self, file: File, now: float) -> None:
        self.alerts += transaction.record_file(self.store, file, GliderParams(), self.speaking, now).alerts

    @property
    def unknown(self) -> list[Alert]:
        return [a for a in self.alerts if "/unknown/" in a.incident]


@pytest.fixture(scope="module")
def mission(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[tuple[Path, Segment]]]:
    """Files of a healthy glider: some forty dives, and ten days more."""
    folder = tmp_path_factory.mktemp("mission")
    made = simulate(Scenario(seed=5, glider="angus", days=17.0))
    paths = write_mission(folder / "gliders", folder / "cache", made)
    found = [(path, decode(path, [folder / "cache"])) for path in paths]
    return folder, sorted(found, key=lambda f: f[1].id)


@pytest.fixture(scope="module")
def begun(mission) -> Store:
    """What the files before the trouble lead to: as they are, and from where they lie."""
    folder, files = mission
    return fed(Live([folder / "cache"]), [(path, s.last_t) for path, s in files], onset(files)).store


@pytest.fixture
def copied(mission, tmp_path: Path) -> tuple[Path, list[tuple[Path, float]]]:
    """A folder of its own with these files, and when each of them came (s)."""
    folder, files = mission
    out = []
    (tmp_path / "cache").symlink_to(folder / "cache")
    for path, segment in files:
        copy = tmp_path / "gliders" / path.name
        copy.parent.mkdir(exist_ok=True)
        copy.write_bytes(path.read_bytes())
        out.append((copy, segment.last_t))
    return tmp_path, out


def other_sensors(path: Path) -> None:
    """The file as after a change of the sbd list: its header names a cache that is nowhere."""
    data = path.read_bytes()
    crc = read_header(path).crc.encode()
    at = data.lower().index(crc)
    path.write_bytes(data[:at] + b"deadbeef" + data[at + 8 :])


def garbled(path: Path) -> None:
    """The file with nothing intact behind its header."""
    path.write_bytes(path.read_bytes()[: read_header(path).length] + 2000 * b"\xa5")


def cut(path: Path) -> None:
    """The file cut behind its header: no more is in it, which is no damage."""
    path.write_bytes(path.read_bytes()[: read_header(path).length + 17])


def onset(files: Sequence[tuple[Path, float]]) -> int:
    """The number of the first file of the trouble."""
    return HEALTHY + 2


def fed(live: Live, files: Sequence[tuple[Path, float]], count: int | None = None) -> Live:
    for path, at in files[:count]:
        live.come(path, at)
    return live


def gone_on(live: Live, begun: Store, files: Sequence[tuple[Path, float]], count: int | None = None) -> Live:
    """The same where the files before the trouble are those of `begun`."""
    begun._db.backup(live.store._db)
    return fed(live, files[onset(files) : count])


def is_told_once_and_in_time(live: Live, files: Sequence[tuple[Path, float]]) -> Alert:
    first, *more = live.unknown
    began = files[onset(files)][1]
    assert (first.kind, first.severity) == (Kind.UNKNOWN, Severity.WARNING)
    assert began < first.time <= began + 27 * HOUR
    assert {a.kind for a in more} == {Kind.REMINDER} and 3 <= len(more) <= 4, "they thin out over ten days"
    assert [a for a in live.alerts if a.kind == Kind.OVERDUE] == []
    assert first.title.startswith("angus CANNOT BE JUDGED for ")
    return first


def test_healthy_dives_say_nothing(copied) -> None:
    folder, files = copied
    live = fed(Live([folder / "cache"]), files)
    assert Counter(a.flag for a in live.store.assessments("angus"))[0] > HEALTHY + 40
    assert live.unknown == []


def test_files_that_wait_for_a_cache(copied, begun: Store) -> None:
    folder, files = copied
    for path, _ in files[onset(files) :]:
        other_sensors(path)
    live = gone_on(Live([folder / "cache"]), begun, files)
    assert len(live.store.files(Status.WAITING)) > 60
    first = is_told_once_and_in_time(live, files)
    assert f"cache file deadbeef.cac is missing: not in {folder / 'cache'}" in first.body
    assert "Copy deadbeef.cac from the dockserver" in first.body


def test_files_that_are_all_quarantined(copied, begun: Store) -> None:
    folder, files = copied
    for path, _ in files[onset(files) :]:
        garbled(path)
    live = gone_on(Live([folder / "cache"]), begun, files)
    assert len(live.store.files(Status.QUARANTINED)) > 60
    first = is_told_once_and_in_time(live, files)
    assert "files: damaged" in first.body
    assert "Copy the files from the glider or the dockserver again" in first.body


def test_files_in_which_there_is_nothing(copied, begun: Store) -> None:
    folder, files = copied
    for path, _ in files[onset(files) :]:
        cut(path)
    live = gone_on(Live([folder / "cache"]), begun, files)
    assert len(live.store.files(Status.TAKEN)) == len(files)
    first = is_told_once_and_in_time(live, files)
    assert "its file holds no data" in first.body and "send them from the glider again" in first.body


def test_files_that_an_error_of_the_program_quarantines(
    copied, begun: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, files = copied
    live = gone_on(Live([folder / "cache"]), begun, files, onset(files))

    def broken(*_: object) -> None:
        raise ZeroDivisionError("float division by zero")

    monkeypatch.setattr(run, "process", broken)
    fed(live, files[onset(files) :])
    first = is_told_once_and_in_time(live, files)
    assert "ZeroDivisionError" in first.body and "please report it" in first.body


def test_dives_that_come_and_have_no_flag(copied, begun: Store) -> None:
    """Nothing is wrong with the files, but the glider sends nothing any more that tells its speed."""
    folder, files = copied
    live = gone_on(Live([folder / "cache"]), begun, files, onset(files))
    for path, at in files[onset(files) :]:
        segment = without(decode(path, [folder / "cache"]), *UNSEEN)
        found = judgement.judge(path, live.store, live.caches, lambda glider: True)
        assert isinstance(found, Job)
        live.alerts += transaction.process_file(
            live.store, found.file, segment, GliderParams(), live.speaking, at
        ).alerts
    first = is_told_once_and_in_time(live, files)
    assert "gliderwatch doctor" in first.body or "dd m_heading" in first.body


UNSEEN = (
    *("heading", "heading_commanded", "dr_lat", "dr_lon", "speed_onboard", "pitch", "depth_rate"),
    *(f"current{part}_{axis}" for part in ("", "_initial", "_final") for axis in "xy"),
)
"""What tells course, current and glide: depth alone shows that it dives, and not how fast it flies."""


def without(segment: Segment, *names: str) -> Segment:
    held = {name: series for name, series in segment.quantities.items() if name not in names}
    return replace(segment, quantities=held)


def test_it_clears_itself_when_the_cache_comes(copied, begun: Store) -> None:
    folder, files = copied
    lost = files[onset(files) : onset(files) + 20]
    whole = {path: path.read_bytes() for path, _ in lost}
    for path, _ in lost:
        other_sensors(path)
    live = gone_on(Live([folder / "cache"]), begun, files, onset(files) + 20)
    assert live.unknown[0].kind == Kind.UNKNOWN
    for path, _ in lost:
        path.write_bytes(whole[path])
        live.come(path, files[onset(files) + 20][1])
    assert live.unknown[-1].kind == Kind.ALL_CLEAR
    assert live.unknown[-1].audience == Severity.WARNING, "whoever was warned hears of the end"
    fed(live, files[onset(files) + 20 :])
    assert [a.kind for a in live.unknown].count(Kind.ALL_CLEAR) == 1
    assert live.unknown[-1].kind == Kind.ALL_CLEAR


@pytest.mark.parametrize("attention", [Attention(recovered=True), Attention(muted_until=1e12)])
def test_not_of_a_glider_that_is_muted_or_recovered(copied, attention: Attention) -> None:
    folder, files = copied
    for path, _ in files[onset(files) :]:
        other_sensors(path)
    assert fed(Live([folder / "cache"], attention), files).alerts == []


@pytest.mark.parametrize(
    ("hours", "dives", "expected"),
    [(48.0, None, 48.0), (None, 16, 48.0), (None, None, None), (6.0, None, 6.0)],
)
def test_its_limits_are_those_of_the_glider(
    copied, begun: Store, hours: float | None, dives: int | None, expected: float | None
) -> None:
    folder, files = copied
    for path, _ in files[onset(files) :]:
        other_sensors(path)
    live = Live([folder / "cache"], Attention(unknown_hours=hours, unknown_dives=dives))
    gone_on(live, begun, files)
    if expected is None:
        assert live.unknown == []
        return
    assert live.unknown[0].time - files[onset(files) - 1][1] == pytest.approx(expected * HOUR, abs=7 * HOUR)


def test_an_archive_that_is_taken_in_is_no_news(copied) -> None:
    folder, files = copied
    for path, _ in files[onset(files) :]:
        other_sensors(path)
    live = Live([folder / "cache"])
    for path, _ in files:
        live.come(path, files[-1][1] + 100 * DAY)
    assert live.unknown == []


@pytest.mark.parametrize(
    "spoil", [cut, *(pytest.param(each, marks=pytest.mark.slow) for each in (other_sensors, garbled))]
)
def test_a_replay_says_what_was_said_live(copied, begun: Store, spoil: Callable[[Path], None]) -> None:
    folder, files = copied
    for path, _ in files[onset(files) :]:
        spoil(path)
    told = replay(Request((folder / "gliders",), (folder / "cache",))).store.alerts()
    told = [a for a in told if "/unknown/" in a.incident]
    live = gone_on(Live([folder / "cache"]), begun, files)
    assert [a.kind for a in told] == [a.kind for a in live.unknown]
    assert [a.incident for a in told] == [a.incident for a in live.unknown]
    assert [a.time for a in told] == pytest.approx([a.time for a in live.unknown], abs=HOUR)


def test_a_missing_cache_says_where_it_was_looked_for() -> None:
    assert str(MissingCache("ab", ["/a", "/b"])) == "cache file ab.cac is missing: not in /a, /b"
    assert not isinstance(MissingCache("ab"), Quarantine)


def test_gps_that_is_gone_is_spoken_of_though_depth_rate_and_pitch_look_as_usual(mission):
    live, gone = Live(()), mission[1][HEALTHY][1].id.opened_at
    for path, segment in mission[1][: HEALTHY + 24]:
        if segment.id.opened_at >= gone:
            kept = {name: v for name, v in segment.quantities.items() if not name.startswith("fix_")}
            segment = replace(segment, quantities=kept)  # noqa: PLW2901
        file = File(str(path), 1, 1, Status.WAITING, "angus", segment.id.name)
        taken = transaction.process_file(
            live.store, file, segment, GliderParams(), live.speaking, segment.last_t
        )
        live.alerts += taken.alerts
    (first, *_) = live.unknown
    assert first.title == "angus CANNOT BE JUDGED for 26.9 h: no fix"
    assert "no fix; as fast as usual by depth rate and pitch alone" in first.body
    assert {a.kind for a in live.alerts} <= {Kind.UNKNOWN, Kind.REMINDER}
