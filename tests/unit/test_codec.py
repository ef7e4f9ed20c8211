"""Checkpoints and segments survive being written down, to the last bit."""

import json
import zlib
from types import MappingProxyType

import msgspec
import numpy as np
import pytest

from gliderwatch.errors import DamagedError, LayoutError, StateError
from gliderwatch.model import Assessment, Incident, Segment
from gliderwatch.params import GliderParams
from gliderwatch.pipeline import GliderState, process
from gliderwatch.store import codec, conversion
from missions import Leg, mission

LEGS = [Leg(speed=0.3 if k < 3 else 0.02, heading=0.7 * k, hours=3) for k in range(7)]


def states() -> list[GliderState]:
    out = [GliderState()]
    for s in mission(LEGS):
        out.append(process(out[-1], s, GliderParams()).state)
    return out


def test_a_segment_comes_back():
    s = mission(LEGS)[1]
    back = codec.decode(codec.encode(s), Segment)
    assert back.id == s.id and back.completeness == s.completeness and back.declination == s.declination
    for name, series in s.quantities.items():
        assert back.get(name).t.tobytes() == series.t.tobytes()
        assert back.get(name).v.tobytes() == series.v.tobytes()


def test_arrays_come_back_read_only_and_in_shape():
    track = states()[3].last.track
    back = codec.decode(codec.encode(states()[3]), GliderState).last.track
    assert back.x.shape == track.x.shape and back.x.tobytes() == track.x.tobytes()
    assert not back.x.flags.writeable


@pytest.mark.parametrize("k", range(8))
def test_a_state_is_the_same_bytes_after_each_round(k):
    record = codec.encode(states()[k])
    assert codec.encode(codec.decode(record, GliderState)) == record


def test_between_any_two_steps_the_state_may_be_written_and_read():
    through, straight = GliderState(), GliderState()
    for s in mission(LEGS):
        a, b = process(straight, s, GliderParams()), process(through, s, GliderParams())
        assert [codec.plain_encode(x) for x in a.assessments] == [
            codec.plain_encode(x) for x in b.assessments
        ]
        assert [codec.plain_encode(x) for x in a.incidents] == [codec.plain_encode(x) for x in b.incidents]
        straight = a.state
        through = codec.decode(codec.encode(b.state), GliderState)
        assert codec.encode(through) == codec.encode(straight)


def record(version: int, data: object) -> bytes:
    return zlib.compress(msgspec.json.encode({"v": version, "data": data}))


@pytest.mark.parametrize("version", [0, conversion.version(GliderState) + 1])
def test_a_record_of_no_layout_that_is_known_is_refused_with_a_way_out(version):
    with pytest.raises(LayoutError, match=rf"layout {version}, this gliderwatch knows \d+: install"):
        codec.decode(record(version, {}), GliderState)


@pytest.mark.parametrize(
    "broken",
    [
        b"",
        b"\x00",
        zlib.compress(b"{"),
        zlib.compress(b'{"v": 1, "data": \xff}'),
        codec.encode(GliderState())[:-9],
    ],
)
def test_broken_bytes_are_damage(broken):
    with pytest.raises(DamagedError, match="damaged"):
        codec.decode(broken, GliderState)


@pytest.mark.parametrize("text", ["", "{", b'{"threads": [\xff]}'])
def test_a_row_whose_text_is_broken_is_damage(text):
    with pytest.raises(DamagedError):
        codec.plain_decode(text, Assessment)


@pytest.mark.parametrize(
    "data",
    [3, {"navigation": 3}, {"last": {"glider": "unit"}}, {"memory": {"estimate": {"speed": "none"}}}],
)
def test_whole_json_of_another_type_is_a_mistake_of_the_program_and_no_damage(data):
    """A field that was renamed without a converter must not set a good state file aside."""
    with pytest.raises(StateError, match=r"GliderState.*cannot read.*Nothing of it is lost") as raised:
        codec.decode(record(conversion.version(GliderState), data), GliderState)
    assert isinstance(raised.value, LayoutError) and not isinstance(raised.value, DamagedError)


def test_an_array_that_is_none_is_no_damage():
    segment = json.loads(zlib.decompress(codec.encode(mission(LEGS)[0])))["data"]
    for array in ({}, 3, {"shape": [2], "f64": "!"}, {"shape": [5], "f64": ""}):
        segment["quantities"] = {"depth": {"t": array, "v": array}}
        with pytest.raises(LayoutError):
            codec.decode(record(conversion.version(Segment), segment), Segment)


def test_a_record_is_readable_with_standard_tools():
    read = json.loads(zlib.decompress(codec.encode(mission(LEGS)[0])))
    assert read["v"] == conversion.version(Segment)
    depth = read["data"]["quantities"]["depth"]["v"]
    assert depth["shape"] == [len(mission(LEGS)[0].get("depth"))] and isinstance(depth["f64"], str)


def test_results_come_back():
    outcome = None
    state = GliderState()
    for s in mission(LEGS):
        outcome = process(state, s, GliderParams())
        state = outcome.state
    (incident, *_) = outcome.incidents
    assert codec.plain_decode(codec.plain_encode(incident), Incident) == incident
    a = outcome.assessments[-1]
    assert codec.plain_decode(codec.plain_encode(a), Assessment) == a


def test_mappings_of_any_kind_are_objects():
    assert codec.plain_encode(MappingProxyType({"a": 1.5})) == '{"a":1.5}'


def test_numbers_of_numpy_are_numbers():
    assert codec.plain_encode({"a": np.float64(0.1)}) == '{"a":0.1}'


def test_what_is_not_known_is_not_written():
    with pytest.raises(NotImplementedError, match="complex"):
        codec.plain_encode(1j)


def numbers(value: object):
    """All numbers in a value, however deep, also those in its arrays."""
    if isinstance(value, dict):
        if set(value) == {"shape", "f64"}:
            value = codec._to_array(np.ndarray, value).ravel().tolist()
        else:
            value = list(value.values())
    if isinstance(value, list):
        for x in value:
            yield from numbers(x)
    elif isinstance(value, float | int):
        yield value


def test_nothing_but_finite_numbers_in_a_state():
    for state in states():
        found = list(numbers(json.loads(zlib.decompress(codec.encode(state)))["data"]))
        assert np.isfinite(found).all()
