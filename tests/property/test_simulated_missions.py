"""Any scenario makes files that the program reads: nothing dropped, every value as it was written."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from gliderwatch.model import Segment
from gliderwatch.simulate.delivery import FileForm, write_full_rate, write_mission
from gliderwatch.simulate.dinkum import Generation
from gliderwatch.simulate.flight import Point, Thruster
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.ocean import Bottom, Constituent, Ellipse, Front, Sea
from gliderwatch.simulate.scenario import SIZES, Fault, FaultKind, FixIn, Rates, Scenario
from gliderwatch.simulate.telemetry import SECONDS, SENSORS, TIME, SegmentData
from gliderwatch.slocum.decode import decode
from gliderwatch.slocum.sensors import QUANTITIES

SENT = sorted({sensor.name for sensor in SENSORS} - {TIME, SECONDS})
PAIRS = [
    (row.sensors[0], other.sensors[0])
    for row, other in combinations(QUANTITIES, 2)
    if row.pair and row.pair == other.pair
]
_SIZES = {1: np.int8, 4: np.float32, 8: np.float64}


def numbers(least: float, most: float) -> SearchStrategy[float]:
    return st.floats(least, most, allow_subnormal=False)


@st.composite
def faults(draw: st.DrawFn) -> Fault:
    kind = draw(st.sampled_from(list(FaultKind)))
    most = min(SIZES[kind].most, 2.5 if SIZES[kind].least == 1 else 0.8)
    size = draw(numbers(max(SIZES[kind].least, -0.8), most))
    return Fault(
        kind, Scenario().start + 86400 * draw(numbers(0, 0.4)), size, draw(st.sampled_from([0.0, 7e3]))
    )


@st.composite
def seas(draw: st.DrawFn) -> Sea:
    tides = draw(
        st.lists(st.builds(Ellipse, st.sampled_from(list(Constituent)), numbers(0, 0.5)), max_size=3)
    )
    front = st.builds(Front, numbers(0, 2), direction=numbers(-3, 3), distance=numbers(-2e4, 2e4))
    return Sea(
        residual=(draw(numbers(-0.3, 0.3)), draw(numbers(-0.3, 0.3))),
        sigma=draw(numbers(0, 0.2)),
        tides=tuple(tides),
        shear=draw(numbers(0, 1)),
        inertial=draw(numbers(0, 0.2)),
        front=draw(st.none() | front),
    )


@st.composite
def scenarios(draw: st.DrawFn) -> Scenario:
    place = Point(draw(numbers(-70, -1) | numbers(1, 70)), draw(numbers(-179, 179)))
    names = draw(st.lists(st.sampled_from(SENT), unique=True, max_size=len(SENT)))
    cadence = {name: draw(numbers(4, 2000)) for name in names}
    for one, other in PAIRS:  # a position whose parts come at times of their own is none
        if one in cadence or other in cadence:
            cadence[one] = cadence[other] = cadence.get(one, cadence.get(other, 4.0))
    alone = [name for name in cadence if not any(name in pair for pair in PAIRS)]
    return Scenario(
        seed=draw(st.integers(0, 2**32)),
        days=draw(numbers(0.05, 0.35)),
        place=place,
        waypoints=(Point(place.lat + 0.2, place.lon - 0.3),),
        variation=draw(numbers(-0.6, 0.6)),
        sea=draw(seas()),
        pitch=draw(numbers(0.4, 0.6)),
        drive=draw(numbers(8e-5, 4e-4)),
        depths=(draw(numbers(2, 15)), draw(numbers(30, 800))),
        interval=draw(numbers(3600, 5 * 3600)),
        fix_in=draw(st.sampled_from(list(FixIn))),
        surface_segments=draw(st.booleans()),
        faults=tuple(draw(st.lists(faults(), max_size=2))),
        cadence=cadence,
        nth_yo={name: draw(st.integers(1, 4)) for name in alone[:3]},
        thruster=draw(st.none() | st.builds(Thruster, numbers(0.5, 4), st.booleans())),
        bottom=draw(st.none() | st.builds(Bottom, numbers(20, 300))),
        full_rate=draw(st.booleans()),
        rates=Rates(
            stale_fix=draw(numbers(0, 1)),
            restart=draw(numbers(0, 1)),
            clock_skew=draw(st.sampled_from([0.0, 2880.0])),
        ),
    )


def written(segment: SegmentData, name: str) -> tuple[np.ndarray, np.ndarray] | None:
    """Times and values of a sensor that a reader must find; None where the file does not hold it."""
    columns = segment.sensors.columns
    names = [sensor.name for sensor in columns]
    if name not in names:
        return None
    updated = segment.updated[1:, names.index(name)]
    values = segment.values[1:, names.index(name)][updated].astype(_SIZES[columns[names.index(name)].size])
    return segment.values[1:, names.index(TIME)][updated], values.astype(np.float64)


def check(segment: SegmentData, read: Segment) -> None:
    """Every quantity of a decoded file has the values written, those that mean "none" left out."""
    assert read.id.name == segment.header.full_name
    assert read.kind == segment.header.extension
    assert not read.dropped
    for row in QUANTITIES:
        found = next(
            (w for name in row.sensors if (w := written(segment, name)) is not None and len(w[0])), None
        )
        partner = [other for other in QUANTITIES if row.pair and other.pair == row.pair and other is not row]
        if found is None or any(written(segment, other.sensors[0]) is None for other in partner):
            assert row.name not in read.quantities
            continue
        t, values = found
        for other in partner:
            both = written(segment, other.sensors[0])
            assert both is not None
            kept = np.isin(t, both[0])
            t, values = t[kept], values[kept]
        kept = values != row.absent
        np.testing.assert_array_equal(read.get(row.name).t, t[kept], err_msg=row.name)
        np.testing.assert_array_equal(read.get(row.name).v, row.to_si(values[kept]), err_msg=row.name)


def decoded(paths: Sequence[Path], cache: Path) -> dict[str, Segment]:
    return {path.name: decode(path, [cache]) for path in paths}


@settings(
    max_examples=15, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large]
)
@given(scenarios(), st.booleans(), st.sampled_from(list(Generation)))
def test_any_scenario_is_read_back(scenario: Scenario, compressed: bool, generation: Generation) -> None:
    form = FileForm(compressed=compressed, generation=generation)
    mission = simulate(scenario)
    with TemporaryDirectory() as name:
        folder = Path(name)
        paths = write_mission(folder / "gliders", folder / "cache", mission, form)
        paths += [path for path in write_full_rate(folder / "full", mission, form) if path.suffix[1] == "d"]
        read = decoded(paths, folder / "cache")
    files = [*mission.segments, *(f for f in mission.full_rate if f.header.extension == "dbd")]
    assert len(read) == len(files)
    for segment in files:
        extension = segment.header.extension
        suffix = f"{extension[0]}c{extension[2:]}" if compressed else extension
        check(segment, read[f"{segment.header.full_name}.{suffix}"])


@settings(max_examples=8, deadline=None)
@given(scenarios())
def test_the_same_scenario_is_the_same_mission(scenario: Scenario) -> None:
    one, two = simulate(replace(scenario, days=0.1)), simulate(replace(scenario, days=0.1))
    assert one.truth == two.truth
    for a, b in zip(one.segments, two.segments, strict=True):
        np.testing.assert_array_equal(a.values, b.values)
    assert len(one.truth) >= 1
