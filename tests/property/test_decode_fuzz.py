"""Damaged files never hang, never crash a worker, and never give a value that cannot be."""

import random
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dinkum
from gliderwatch.errors import Quarantine, Retry
from gliderwatch.model import Segment
from gliderwatch.params import GliderParams
from gliderwatch.pipeline import GliderState, process
from gliderwatch.slocum.cycles import intact, parse_sensor_list
from gliderwatch.slocum.decode import Decoder
from gliderwatch.slocum.header import parse_header, plain
from gliderwatch.slocum.sensors import QUANTITIES

CORPUS = Path(__file__).parents[1] / "corpus"
CRC = "0abc12ef"
DATA = dinkum.cycles(dinkum.rows(80))
SENSORS, _ = parse_sensor_list(dinkum.sensor_list(), 0, len(dinkum.SENSORS) + 1)
LIMITS = {row.name: row for row in QUANTITIES}
BASES = {
    "factored": dinkum.header() + DATA,
    "unfactored": dinkum.header(factored=False) + dinkum.sensor_list() + DATA,
    "compressed": dinkum.compress(dinkum.header() + DATA),
}


def flip(data: bytearray, rng: random.Random) -> None:
    for _ in range(rng.choice([1, 1, 1, 3, 20])):
        data[rng.randrange(len(data))] = rng.randrange(256)


def flip_in_header(data: bytearray, rng: random.Random) -> None:
    for _ in range(rng.choice([1, 2, 5])):
        data[rng.randrange(500)] = rng.choice(b"0123456789abc-_: \n\x00\xff")


def cut(data: bytearray, rng: random.Random) -> None:
    del data[rng.randrange(len(data)) :]


def delete(data: bytearray, rng: random.Random) -> None:
    start = rng.randrange(len(data))
    del data[start : start + rng.choice([1, 4, 100])]


def insert(data: bytearray, rng: random.Random) -> None:
    start = rng.randrange(len(data))
    data[start:start] = rng.randbytes(rng.choice([1, 8, 300]))


def repeat(data: bytearray, rng: random.Random) -> None:
    start, end = sorted(rng.randrange(len(data)) for _ in range(2))
    data[start:start] = data[start:end]


def check(segment: Segment) -> None:
    for name, series in segment.quantities.items():
        low, high = LIMITS[name].low, LIMITS[name].high
        assert len(series.t) == len(series.v) > 0
        assert np.all((series.v >= low) & (series.v <= high)), name
        assert np.all(np.diff(series.t) > 0), name
        assert segment.id.opened_at - 7200 <= series.t[0], name
        assert series.t[-1] <= min(segment.id.opened_at + 60 * 86400, segment.last_t), name
    assert segment.declination is None or abs(segment.declination) <= np.pi
    assert all(n > 0 for n in segment.dropped.values())


@pytest.mark.parametrize("base", BASES)
def test_damaged_files(tmp_path, base):
    rng = random.Random(f"damage {base}")
    (tmp_path / f"{CRC}.cac").write_bytes(dinkum.sensor_list())
    paths = []
    for i in range(200):
        data = bytearray(BASES[base])
        rng.choice([flip, flip, flip_in_header, cut, delete, insert, repeat])(data, rng)
        paths.append(tmp_path / f"{i:08d}.sbd")
        paths[-1].write_bytes(data)
    decoded = 0
    with Decoder([tmp_path], max_workers=2, timeout=20.0) as decoder:
        for path, outcome in decoder.map(paths):
            if isinstance(outcome, Segment):
                check(outcome)
                decoded += 1
            else:
                assert isinstance(outcome, Quarantine | Retry), path
                for sign in ("longer than", "crashed", "outside", "interrupted", "memory", "cannot be"):
                    assert sign not in str(outcome), (path, outcome)
                assert str(outcome).isprintable(), (path, outcome)
    assert 20 < decoded < 200


def test_damaged_cache_files(tmp_path):
    rng = random.Random("cache")
    path = tmp_path / "00010003.sbd"
    path.write_bytes(BASES["factored"])
    with Decoder([], timeout=20.0) as decoder:
        for i in range(60):
            folder = tmp_path / str(i)
            folder.mkdir()
            data = bytearray(dinkum.sensor_list())
            rng.choice([flip, flip, cut, delete, insert, repeat])(data, rng)
            (folder / f"{CRC}.cac").write_bytes(data)
            decoder.cache_folders = (folder,)
            [(_, outcome)] = decoder.map([path])
            if isinstance(outcome, Segment):
                check(outcome)
            else:
                assert isinstance(outcome, Quarantine | Retry)
                assert "crashed" not in str(outcome)
                assert "longer than" not in str(outcome)


@given(st.binary(max_size=2000), st.integers(0, 700))
def test_any_bytes_are_no_header_or_a_header(tail, n):
    for data in (tail, BASES["factored"][:n] + tail, BASES["compressed"][:n] + tail):
        try:
            header = parse_header(plain(data, 10_000))
        except Quarantine as error:
            assert str(error).isprintable()
        else:
            assert header.id.name.isprintable()


@given(st.data())
def test_intact_cycles_are_a_part_of_the_data(data):
    damaged = bytearray(DATA)
    for _ in range(data.draw(st.integers(0, 5))):
        damaged[data.draw(st.integers(4, len(DATA) - 1))] = data.draw(st.integers(0, 255))
    n, end, lost = intact(bytes(damaged), 0, SENSORS)
    assert 0 <= n <= 80
    assert 0 <= end <= len(damaged)
    assert lost in (0, len(damaged) - end)
    assert intact(bytes(damaged[:end]), 0, SENSORS) == (n, end, 0)


def test_the_corpus_of_the_fuzzer(tmp_path):
    """Inputs by which atheris reached further into header, decoder, segment and pipeline.

    What is called `values-` is a whole file of unlikely values; the rest is bytes changed at will.
    """
    (tmp_path / f"{CRC}.cac").write_bytes(dinkum.sensor_list())
    paths = sorted(CORPUS.glob("*.sbd"))
    assert len(paths) > 300
    before = tmp_path / "before.sbd"
    start = dinkum.OPENED_AT - 7200
    before.write_bytes(dinkum.header("unit_7-2024-250-1-2", start) + dinkum.cycles(dinkum.rows(60, start)))
    decoded = 0
    with Decoder([tmp_path], max_workers=2, timeout=20.0) as decoder:
        [(_, first)] = decoder.map([before])
        assert isinstance(first, Segment)
        begun = process(GliderState(), first, GliderParams()).state
        for path, outcome in decoder.map(paths):
            if isinstance(outcome, Segment):
                check(outcome)
                decoded += 1
                for state in [GliderState(), begun] if first.id < outcome.id else [GliderState()]:
                    for a in process(state, outcome, GliderParams()).assessments:
                        numbers = (a.speed, a.flow_u, a.flow_v, a.p_e, a.clle_max)
                        assert all(x is None or np.isfinite(x) for x in numbers), (path, a)
            else:
                assert isinstance(outcome, Quarantine | Retry), path
                assert str(outcome).isprintable(), (path, outcome)
                for sign in ("longer than", "crashed", "outside", "interrupted", "memory"):
                    assert sign not in str(outcome), (path, outcome)
    assert decoded > 50
