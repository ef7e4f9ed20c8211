"""What a worker hands over comes back to the last bit, and bytes that it did not make are refused."""

import pickle
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gliderwatch.errors import GliderwatchError, MissingCache, Quarantine, Retry
from gliderwatch.model import Series, readonly
from gliderwatch.slocum.decode import decoded, encoded
from missions import Leg, mission

SEGMENT = mission([Leg()])[0]


def test_a_segment_comes_back_with_every_bit_and_read_only():
    odd = readonly([0.1, -0.0, np.inf, np.nan, 5e-324])
    segment = replace(
        SEGMENT,
        declination=None,
        dropped={"depth": 3},
        quantities={**SEGMENT.quantities, "odd": Series(odd, odd[::-1]), "none": Series(odd[:0], odd[:0])},
    )
    back = decoded(encoded(segment))
    assert list(back.quantities) == list(segment.quantities)
    for name, series in segment.quantities.items():
        assert back.get(name).t.tobytes() == series.t.tobytes()
        assert back.get(name).v.tobytes() == series.v.tobytes()
        assert back.get(name).v.shape == series.v.shape and back.get(name).v.dtype == np.float64
        assert not back.get(name).v.flags.writeable
    bare = {"quantities": {}}
    assert replace(back, **bare) == replace(segment, **bare)


@pytest.mark.parametrize(
    "error", [Retry("later"), Quarantine("never"), MissingCache("0a1b2c3d"), Retry("name \udce9")], ids=repr
)
def test_an_error_comes_back_as_what_it_was(error):
    back = decoded(encoded(error))
    assert type(back) is type(error) and str(back) == str(error).replace("\udce9", "\\udce9")
    assert getattr(back, "crc", None) == getattr(error, "crc", None)


def test_an_error_that_no_decoding_raises_is_for_good():
    assert type(decoded(encoded(GliderwatchError("odd")))) is Quarantine


@pytest.mark.parametrize("value", [None, b"", "text", {"quantities": {}}])
def test_what_is_no_segment_is_not_handed_over(value):
    with pytest.raises(TypeError, match="no segment"):
        encoded(value)


def forged(t: object) -> bytes:
    data = msgspec.msgpack.decode(encoded(SEGMENT))
    data["segment"]["quantities"]["depth"]["t"] = t
    return msgspec.msgpack.encode(data)


@pytest.mark.parametrize(
    "data",
    [
        pickle.dumps(SEGMENT),
        encoded(SEGMENT)[:-1],
        encoded(SEGMENT).replace(b"opened_at", b"opened_or"),
        encoded(MissingCache("0a1b2c3d")).replace(b"arguments", b"argumento"),
        msgspec.msgpack.encode({"type": "_Failed", "kind": "MissingCache", "arguments": []}),
        forged({"shape": [10**9], "f64": b"12345678"}),
        forged({"shape": [-1], "f64": b"12345678"}),
        forged({"shape": "no", "f64": b"12345678"}),
        forged({"shape": [1]}),
        forged([1.0]),
    ],
)
def test_bytes_that_were_written_over_are_refused(data):
    with pytest.raises(ValueError):
        decoded(data)


@given(st.binary(max_size=60))
def test_no_bytes_do_anything_but_be_refused(data):
    with pytest.raises(ValueError):
        decoded(data)
