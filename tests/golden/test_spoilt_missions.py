"""Real missions as if their telemetry had failed: no false message, a true one where nothing is judged."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from gliderwatch.model import Alert, Segment, Series, readonly
from gliderwatch.navigation.dives import Dive
from gliderwatch.navigation.geodesy import velocity
from gliderwatch.params import GliderParams
from gliderwatch.score.graft import navigate, own_speeds
from gliderwatch.score.sensors import LEFT_OUT, left_out
from gliderwatch.score.tides import in_tide
from gliderwatch.service.routing import Routing
from gliderwatch.service.transaction import process_file
from gliderwatch.store.database import MEMORY
from gliderwatch.store.state_file import File, Status, Store
from missions import real

pytestmark = pytest.mark.real

HOUR, DAY = 3600.0, 86400.0
EAGER = Routing(channels=lambda alert: ["mail"], notices=lambda glider: False)
FIXES = ("fix_lat", "fix_lon")


@cache
def mission(data: Path, name: str) -> tuple[tuple[Segment, ...], tuple[Dive, ...]]:
    segments = real(data, name)
    return segments, tuple(navigate(segments))


def without(segments: Iterable[Segment], names: Iterable[str], start: float, end: float) -> list[Segment]:
    """The segments without some quantities between two times (s)."""
    return [_changed(s, {n: _outside(s.get(n), start, end) for n in names}) for s in segments]


def _outside(series: Series, start: float, end: float) -> Series:
    kept = (series.t < start) | (series.t > end)
    return Series(readonly(series.t[kept]), readonly(series.v[kept]))


def _changed(segment: Segment, quantities: dict[str, Series]) -> Segment:
    return replace(segment, quantities={**segment.quantities, **quantities})


def later(segment: Segment, by: float) -> Segment:
    """A segment as if it had been flown by so much later (s)."""
    moved = {name: Series(readonly(x.t + by), x.v) for name, x in segment.quantities.items()}
    identity = replace(segment.id, opened_at=segment.id.opened_at + by)
    return replace(segment, id=identity, last_t=segment.last_t + by, quantities=moved)


def judged(segments: Sequence[Segment]) -> tuple[list[int | None], list[Alert]]:
    """The flags of the dives, and the messages."""
    store = Store.open(MEMORY)
    for s in segments:
        file = File(s.id.name, 1, 1, Status.WAITING, s.id.glider, s.id.name)
        process_file(store, file, s, GliderParams(), EAGER, s.last_t)
    return [a.flag for a in store.assessments(segments[0].id.glider)], store.alerts()


def test_surfacings_of_which_no_file_holds_a_fix_make_no_message(shared_data):
    """The first of them while the glider still dives for minutes at a time, to be ballasted."""
    segments, dives = mission(shared_data, "maria-2022")
    for k in range(3, 10, 2):
        segments = without(segments, FIXES, dives[k].t_surface - 600.0, dives[k + 1].t_dive + 600.0)
    flags, alerts = judged(segments)
    assert flags == [0] * (len(dives) - 4) and alerts == []


def test_a_call_in_which_nothing_is_logged_hides_no_dive(shared_data):
    segments, dives = mission(shared_data, "usf-sam-2019")
    half = len(segments) // 2
    flags, alerts = judged([*segments[:half], *(later(s, 4 * HOUR) for s in segments[half:])])
    assert flags == [0] * len(dives) and alerts == []


@pytest.mark.parametrize("heading", ["all sensors", "heading"])
@pytest.mark.parametrize("sea", ["elliptic", "diurnal"])
def test_in_the_tide_of_a_shelf_sea_a_mission_is_as_it_was(shared_data, sea, heading):
    """Nothing is told of it, though its dives went over ground by up to 0.7 m/s otherwise."""
    segments, dives = mission(shared_data, "maria-2022")
    tidal = in_tide(segments, sea, seed=0)
    moved = [velocity(d.start, d.end) - velocity(b.start, b.end) for b, d in both(dives, navigate(tidal))]
    assert 0.2 < max(np.hypot(*each) for each in moved) < 1.0
    through = [own_speeds(each) for each in (dives, navigate(tidal))]
    assert through[1] == pytest.approx(through[0], abs=0.02)
    flags, alerts = judged(left_out(tidal, LEFT_OUT[heading]))
    assert flags == [0] * len(dives) and alerts == []


def both(before, after):
    """The dives that have two fixes, in pairs."""
    assert [dive.t_dive for dive in before] == [dive.t_dive for dive in after]
    return [(b, a) for b, a in zip(before, after, strict=True) if a.start and a.end]


def test_days_without_gps_are_reported(shared_data):
    segments, _ = mission(shared_data, "maria-2022")
    start = segments[len(segments) // 3].id.opened_at
    _, alerts = judged(without(segments, FIXES, start, start + 2.5 * DAY))
    assert [a.kind for a in alerts] == ["unknown"]


def test_level_flight_without_depth_and_pitch_is_judged(shared_data):
    segments, dives = mission(shared_data, "usf-sam-2019")
    flags, alerts = judged(left_out(segments, LEFT_OUT["depth, pitch"]))
    assert flags == [0] * len(dives) and alerts == []


def test_hours_without_heading_are_no_wrong_current(shared_data):
    segments, dives = mission(shared_data, "usf-sam-2019")
    for dive in dives[3:8:2]:
        middle, part = (dive.t_dive + dive.t_surface) / 2, 0.3 * (dive.t_surface - dive.t_dive)
        segments = without(segments, ("heading_e", "heading_n", "heading"), middle - part, middle + part)
    flags, alerts = judged(segments)
    assert flags == [0] * len(dives) and alerts == []
