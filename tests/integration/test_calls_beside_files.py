"""What a glider told in a call serves where its files lack it: the fix that ends a dive, the way ahead."""

from __future__ import annotations

import itertools
import random
from collections.abc import Sequence
from dataclasses import replace

import pytest

from gliderwatch.model import Call, Fix, Happened, Happening, Segment
from gliderwatch.navigation.call_fixes import FromCall, missing_in_file, with_call
from gliderwatch.params import GliderParams
from gliderwatch.service import transaction
from gliderwatch.service.routing import Routing
from gliderwatch.slocum.calls import Dialog
from gliderwatch.store.state_file import File, Status, Store
from missions import FIRST_FIX, SURFACE, Leg, ending, mission

SPEAKING = Routing(lambda alert: ["mail"], lambda glider: False)
HOUR = 3600.0
LEGS = [Leg(heading=1.0 + 0.05 * k) for k in range(5)]
INF = float("inf")


def without_last_fixes(whole: Segment) -> Segment:
    """A file that was closed before the first fix at the surface."""
    end = whole.last_t - SURFACE
    kept = {n: s.between(-INF, end) if n.startswith("fix") else s for n, s in whole.quantities.items()}
    return replace(whole, quantities=kept)


def calls(segments: Sequence[Segment]) -> list[Call]:
    """The call at the end of each segment, with the first of its fixes."""
    found = []
    for k, s in enumerate(segments):
        lat, lon = (s.get(name).between(s.last_t - SURFACE, INF) for name in ("fix_lat", "fix_lon"))
        fix = Fix(float(lat.t[0]), float(lat.v[0]), float(lon.v[0]))
        began = s.last_t + 60.0
        found.append(
            Call("unit", f"{k}.log", began, began + 200.0, True, mission="a.mi", fix=fix, surfaced=fix)
        )
    return found


class Dock:
    """Files and logs come to a store."""

    def __init__(self) -> None:
        self.store = Store.open(":memory:")

    def file(self, segment: Segment, *, last: bool = True) -> None:
        file = File(f"/{segment.id.name}", 1, 1, Status.WAITING, "unit", segment.id.name)
        routing = SPEAKING if last else None
        transaction.process_file(self.store, file, segment, GliderParams(), routing, segment.last_t)

    def log(self, call: Call, *, catch_up: bool = True) -> int:
        """How many dives are assessed anew."""
        file, dialog = File(f"/{call.log}", 1, 1, Status.TAKEN, "unit"), Dialog(call)
        taken = transaction.process_log(
            self.store, file, dialog, GliderParams(), SPEAKING, call.last_t, catch_up=catch_up
        )
        return len(taken.assessments)

    @property
    def dives(self) -> list[tuple[float, str | None]]:
        return [(d.t_dive, d.unusable) for d in self.store.facts("unit").latest_dives(99)]


@pytest.fixture(scope="module")
def whole() -> list[Segment]:
    return mission(LEGS)


@pytest.fixture(scope="module")
def bare(whole: list[Segment]) -> list[Segment]:
    return [without_last_fixes(s) for s in whole]


def test_dive_is_judged_at_its_call_and_not_only_at_the_next_file(
    whole: list[Segment], bare: list[Segment]
) -> None:
    dock = Dock()
    for segment, call in zip(bare, calls(whole), strict=True):
        dock.file(segment)
        before = len(dock.dives)
        assert dock.log(call) >= 1
        assert len(dock.dives) == before + 1
        assert dock.log(replace(call, last_t=call.last_t + 60.0)) == 0, "nothing new to assess"
    assert [reason for _, reason in dock.dives] == [None] * len(LEGS)


def test_fix_that_is_in_the_file_too_is_not_taken_twice(whole: list[Segment]) -> None:
    dock, plain = Dock(), Dock()
    for segment, call in zip(whole, calls(whole), strict=True):
        dock.file(segment)
        assert dock.log(call) == 0
        plain.file(segment)
    assert ending(dock.store, "unit") == ending(plain.store, "unit")


def test_any_order_of_files_and_logs_ends_alike(whole: list[Segment], bare: list[Segment]) -> None:
    """Also where logs come in a heap, and are assessed only after the last."""
    ends = []
    inputs: list[Segment | Call] = [*itertools.chain(*zip(bare, calls(whole), strict=True))]
    for seed in range(4):
        dock, rng = Dock(), random.Random(seed)
        for one in inputs if seed == 0 else rng.sample(inputs, len(inputs)):
            if isinstance(one, Segment):
                dock.file(one, last=rng.random() < 0.7)
            else:
                dock.log(one, catch_up=rng.random() < 0.7)
        transaction.notify_pilots(dock.store, "unit", GliderParams(), SPEAKING, whole[-1].last_t + HOUR)
        ends.append((ending(dock.store, "unit"), dock.store.facts("unit").expected(INF)))
    assert all(end == ends[0] for end in ends)
    assert sum(a.unusable is None for a in ends[0][0].assessments) == len(LEGS)


def test_next_surfacing_rests_on_a_call_until_its_file_comes(whole: list[Segment]) -> None:
    dock, (*_, last) = Dock(), calls(whole)
    for segment in whole[:-1]:
        dock.file(segment)
    before = dock.store.facts("unit").expected(INF)
    dock.log(last)
    by_call = dock.store.facts("unit").expected(INF)
    assert before is not None and by_call is not None and last.surfaced is not None
    assert by_call.after == last.surfaced.t > before.after
    assert by_call.t - by_call.after == pytest.approx(before.t - before.after, rel=0.05)
    assert len(dock.dives) == len(LEGS) - 1, "of a dive whose file is still to come nothing is told"
    dock.file(whole[-1])
    by_file = dock.store.facts("unit").expected(INF)
    assert by_file is not None and (by_file.lat, by_file.lon) == (
        pytest.approx(by_call.lat, abs=0.005),
        pytest.approx(by_call.lon, abs=0.005),
    )
    assert dock.store._db.execute("SELECT count(*) FROM expected WHERE segment = ''").fetchone()[0] == 0


def test_glider_at_its_prompt_is_expected_nowhere_else(whole: list[Segment]) -> None:
    dock, (*_, last) = Dock(), calls(whole)
    for segment in whole[:-1]:
        dock.file(segment)
    before = dock.store.facts("unit").expected(INF)
    dock.log(replace(last, happened=(Happened(Happening.GLIDER_DOS, last.last_t, "A 8"),)))
    assert dock.store.facts("unit").expected(INF) == before


def test_reason_of_the_surfacing_is_evidence_of_its_dive(whole: list[Segment]) -> None:
    dock, (first, *_) = Dock(), calls(whole)
    dock.file(whole[0])
    dock.log(replace(first, reason="no comms for a while"))
    known = dock.store.facts("unit")
    (dive,) = known.latest_dives(1)
    assert known.came_up(dive.t_surface) == "no comms for a while"
    assert known.came_up(dive.t_surface + 2 * HOUR) == known.came_up(dive.t_surface - 2 * HOUR) == ""


class TestMissing:
    """What a call adds to a segment."""

    def added(self, segment: Segment, until: float = INF, **changed: object) -> FromCall:
        (call,) = calls([mission(LEGS[:1])[0]])
        return missing_in_file(segment, [replace(call, **changed)], until)

    def test_only_the_surfacing_at_its_end_counts(self, bare: list[Segment]) -> None:
        (fix,) = (call.surfaced for call in calls([mission(LEGS[:1])[0]]))
        assert fix is not None
        end = bare[0].last_t
        assert self.added(bare[0]).fix == fix
        for late, is_of_it in ((-60.0, True), (1500.0, True), (2100.0, False)):
            later = replace(fix, t=end + late)
            assert (self.added(bare[0], surfaced=later).fix == later) is is_of_it
        assert self.added(bare[0], until=fix.t - 1.0) == FromCall()
        assert self.added(bare[0], surfaced=None) == FromCall()

    def test_fix_where_it_cannot_be_is_garbled(self, bare: list[Segment]) -> None:
        last = bare[0].last_t
        assert self.added(bare[0], surfaced=Fix(last, 63.0, -70.0)).fix is None

    def test_waypoint_where_the_file_has_none(self, bare: list[Segment]) -> None:
        added = self.added(bare[0], waypoint=(36.5, -70.5))
        assert added.waypoint == (36.5, -70.5)
        filled = with_call(bare[0], added)
        assert filled.get("waypoint_lat").v.tolist() == [36.5]
        assert self.added(filled, waypoint=(37.0, -70.5)).waypoint is None
        assert len(filled.get("fix_lat")) == len(bare[0].get("fix_lat")) + 1
        assert filled.get("fix_lat").t[0] == bare[0].id.opened_at + FIRST_FIX
        assert with_call(bare[0], FromCall()) is bare[0]
