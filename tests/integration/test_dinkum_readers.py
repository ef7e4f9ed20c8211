"""Simulated files in the hands of two independent readers, and real files encoded again."""

import calendar
import re
import struct
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import lz4.block
import numpy as np
import pytest

from gliderwatch.simulate.delivery import (
    FileForm,
    Names,
    arrivals,
    cache,
    deliver,
    from_glider,
    write_cache,
    write_full_rate,
    write_mission,
)
from gliderwatch.simulate.dinkum import Generation, Header, Sensor, SensorList, encode
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import FixIn, Mission, Rates, Scenario
from gliderwatch.simulate.scenario_files import find, load_scenario
from gliderwatch.simulate.telemetry import CADENCE, SCIENCE_CADENCE, SegmentData

FORMS = [
    FileForm(names, compressed, factored, generation)
    for names, compressed, factored, generation in [
        (Names.LONG, False, True, Generation.G3),
        (Names.SHORT, False, False, Generation.G3),
        (Names.LONG, True, True, Generation.G2),
        (Names.SHORT, True, False, Generation.G2),
    ]
]
IDS = ["plain-factored-G3", "plain-inline-G3", "lz4-factored-G2", "lz4-inline-G2"]


@pytest.fixture(scope="module")
def mission() -> Mission:
    return simulate(Scenario(days=0.4, fix_in=FixIn.NEXT))


@pytest.fixture(scope="module")
def dense() -> Mission:
    """Everything every cycle: files of more than one compressed block."""
    return simulate(Scenario(days=0.2, cadence=dict.fromkeys(CADENCE, 4.0)))


@pytest.fixture(scope="module")
def whole() -> Mission:
    """All four kinds of files, each stay at the surface with its own."""
    return simulate(
        Scenario(
            days=0.3, science=SCIENCE_CADENCE, surface_segments=True, full_rate=True, rates=Rates(restart=0.5)
        )
    )


def stored(segment: SegmentData, column: int) -> np.ndarray:
    """A column as a reader must see it: without the first row, rounded to the size of the sensor."""
    kind = {1: np.int8, 4: np.float32, 8: np.float64}[segment.sensors.columns[column].size]
    updated = segment.updated[1:, column]
    return segment.values[1:, column][updated].astype(kind)


def pairs(mission: Mission, paths: list[Path]) -> Iterator[tuple[SegmentData, Path]]:
    order = sorted(mission.segments, key=lambda segment: segment.sent)
    return zip(order, paths, strict=True)


@pytest.mark.parametrize("form", FORMS, ids=IDS)
@pytest.mark.parametrize("which", ["mission", "dense", "whole"])
def test_dbdreader_reads_every_value_back(
    which: str, form: FileForm, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    import dbdreader

    mission = request.getfixturevalue(which)
    for segment, path in files(mission, tmp_path, form):
        names = [sensor.name for sensor in segment.sensors.columns]
        clock = next(name for name in names if name.endswith("m_present_time"))
        times = segment.values[1:, names.index(clock)]
        dbd = dbdreader.DBD(str(path), cacheDir=str(tmp_path / "cache"))
        read = dbd.get(*names, decimalLatLon=False, discardBadLatLon=False)
        assert dbd.get_fileopen_time() == int(segment.header.opened)
        assert dbd.get_mission_name() == segment.header.mission.lower()
        for column, (t, values) in enumerate(read):
            np.testing.assert_array_equal(t, times[segment.updated[1:, column]])
            np.testing.assert_array_equal(values, stored(segment, column), err_msg=names[column])


@pytest.mark.parametrize("form", FORMS, ids=IDS)
@pytest.mark.parametrize("which", ["mission", "dense", "whole"])
def test_xarray_dbd_reads_every_value_back(
    which: str, form: FileForm, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    import xarray_dbd

    mission = request.getfixturevalue(which)
    for segment, path in files(mission, tmp_path, form):
        read = xarray_dbd.read_dbd_file(str(path), str(tmp_path / "cache"))
        assert read["sensor_names"] == [sensor.name for sensor in segment.sensors.columns]
        assert read["sensor_units"] == [sensor.unit for sensor in segment.sensors.columns]
        assert read["n_records"] == len(segment.values) - 1
        for column, column_read in enumerate(read["columns"]):
            values = column_read[: read["n_records"]]  # of a file with the first line only it gives that line
            updated = segment.updated[1:, column]
            missing = np.isnan(values) if values.dtype.kind == "f" else values == -127
            np.testing.assert_array_equal(missing, ~updated)
            np.testing.assert_array_equal(values[updated], stored(segment, column))


def files(mission: Mission, folder: Path, form: FileForm) -> Iterator[tuple[SegmentData, Path]]:
    """Every file written of a mission, with what is in it."""
    paths = write_mission(folder, folder / "cache", mission, form)
    paths += write_full_rate(folder / "recovered", mission, form)
    (folder / "cache").mkdir(exist_ok=True)
    for name, text in cache(mission).items():
        assert not form.factored or (folder / "cache" / name).read_bytes() == text
    found = {path.name: path for path in paths}
    every = (*mission.segments, *mission.science, *mission.full_rate)
    assert len(found) == len(paths) == len(every)
    for segment in every:
        header, extension = segment.header, segment.header.extension
        stem = header.short_name if form.names is Names.SHORT and extension[0] in "st" else header.full_name
        suffix = f"{extension[0]}c{extension[2:]}" if form.compressed else extension
        yield segment, found[f"{stem}.{suffix}"]


def test_first_line_repeats_the_state_before_the_segment(mission: Mission, tmp_path: Path) -> None:
    import dbdreader

    paths = write_mission(tmp_path, tmp_path / "cache", mission)
    for (segment, path), before in zip(list(pairs(mission, paths))[1:], mission.segments, strict=False):
        dbd = dbdreader.DBD(str(path), cacheDir=str(tmp_path / "cache"), skip_initial_line=False)
        names = [sensor.name for sensor in segment.sensors.columns]
        t, lat = dbd.get("m_gps_lat", decimalLatLon=False)
        column = names.index("m_gps_lat")
        assert t[0] < segment.header.opened <= t[1]
        assert lat[0] == before.values[before.updated[:, column], column][-1]


def test_names_folders_and_cache(mission: Mission, tmp_path: Path) -> None:
    for form, pattern in ((FORMS[0], r"sim-2024-121-0-\d+\.sbd"), (FORMS[3], r"0001\d{4}\.scd")):
        root = tmp_path / form.names.value
        paths = write_mission(root, root / "cache", mission, form)
        assert all(re.fullmatch(pattern, path.name) for path in paths)
        assert (
            {path.parent for path in paths} == {root / "sim" / "from-glider"} == {from_glider(root, mission)}
        )
        assert sorted(path.name for path in paths[0].parent.iterdir()) == sorted(path.name for path in paths)
        assert (root / "cache").exists() is form.factored
    assert {path.name for path in (tmp_path / "long" / "cache").iterdir()} == set(cache(mission))


def test_arrivals_come_in_order_after_the_segment_is_closed(mission: Mission) -> None:
    files = list(arrivals(mission))
    assert [file.time for file in files] == sorted(file.time for file in files)
    assert all(file.time > segment.closed for file, segment in zip(files, mission.segments, strict=True))


@pytest.mark.timing
def test_a_month_is_made_quickly_and_the_same_to_the_byte() -> None:
    scenario = replace(load_scenario(find("tidal")), days=30.0)
    began = time.process_time()
    files = list(arrivals(simulate(scenario)))
    assert time.process_time() - began < 10
    assert files == list(arrivals(simulate(scenario)))
    assert len(files) > 700


def test_a_short_name_grows_and_a_long_one_is_there_at_once(tmp_path: Path) -> None:
    data, seen = bytes(range(256)) * 10, []
    short, long = tmp_path / "00010002.sbd", tmp_path / "sim-2024-121-0-2.sbd"
    deliver(short, data, pause=lambda: seen.append(short.stat().st_size))
    assert seen == [1024, 2048, 2560]
    deliver(long, data, pause=lambda: pytest.fail("a long name does not grow"))
    assert short.read_bytes() == long.read_bytes() == data
    assert sorted(path.name for path in tmp_path.iterdir()) == [short.name, long.name]


# --------------------------------------------------------------------------- real files encoded again

Cycle = tuple[list[int], list[bytes]]


def unpacked(path: Path) -> bytes:
    data = path.read_bytes()
    if path.suffix[2].lower() != "c":
        return data
    out, at = b"", 0
    while at < len(data):
        size = int.from_bytes(data[at : at + 2], "big")
        out += lz4.block.decompress(data[at + 2 : at + 2 + size], 32768)
        at += 2 + size
    return out


def tags(data: bytes) -> tuple[dict[str, str], int]:
    lines = data.split(b"\n", 14)[:14]
    split = (line.decode().split(":", 1) for line in lines)
    return {tag: value.strip() for tag, value in split}, sum(len(line) + 1 for line in lines)


def parsed_list(text: bytes) -> SensorList:
    rows = [line.split() for line in text.decode().splitlines()]
    sent = frozenset(row[5] for row in rows if row[1] == "T")
    return SensorList(tuple(Sensor(row[5], row[6], int(row[4])) for row in rows), sent)


def cycles(data: bytes, at: int, sizes: list[int]) -> tuple[list[Cycle], bytes]:
    """All cycles as state codes and raw values, one loop, nothing shared with the code under test."""
    found, width = [], -(-len(sizes) // 4)
    while data[at : at + 1] == b"d":
        states = [data[at + 1 + k // 4] >> (6 - 2 * (k % 4)) & 3 for k in range(len(sizes))]
        at += 1 + width
        raw = []
        for state, size in zip(states, sizes, strict=True):
            raw.append(data[at : at + size] if state == 2 else b"")
            at += size if state == 2 else 0
        found.append((states, raw))
    return found, data[at:]


def table(found: list[Cycle], sizes: list[int], order: str) -> tuple[np.ndarray, np.ndarray]:
    values = np.full((len(found), len(sizes)), np.nan)
    updated = np.array([states for states, _ in found]) > 0
    held = [0.0] * len(sizes)
    for i, (states, raw) in enumerate(found):
        for j, state in enumerate(states):
            if state == 2:
                held[j] = struct.unpack(order + {1: "b", 2: "h", 4: "f", 8: "d"}[sizes[j]], raw[j])[0]
            if state:
                values[i, j] = held[j]
    return values, updated


def real_files(mission: Path) -> Iterator[tuple[bytes, dict[str, str], bytes, int]]:
    """Content, tags, sensor list and place of the known cycle of the readable files of a mission."""
    for path in sorted((mission / "from-glider").iterdir())[::3]:
        try:
            data = unpacked(path)
            header, at = tags(data)
        except (ValueError, RuntimeError):
            continue
        listed = mission / "cache" / f"{header['sensor_list_crc'].lower()}.cac"
        if header["sensor_list_factored"] == "0":
            end = data.index(b"sa", data.rindex(b"\ns: "))
            yield data, header, data[at:end], end
        elif listed.exists():
            yield data, header, listed.read_bytes(), at


@pytest.mark.real
@pytest.mark.parametrize("name", ["electa-2022", "george-2024", "usf-sam-2019", "maria-2022", "osu-2025"])
def test_real_files_encoded_again_have_the_same_bytes(name: str, shared_data: Path) -> None:
    """Real gliders now and then write a value anew that did not change; nothing else may differ."""
    total = 0
    for data, header, listed, at in real_files(shared_data / name):
        sensors = parsed_list(listed)
        assert sensors.text() == listed
        assert sensors.crc == header["sensor_list_crc"].lower()
        order = "<" if data[at + 2] == 0x34 else ">"
        sizes = [sensor.size for sensor in sensors.columns]
        found, _ = cycles(data, at + 16, sizes)
        opened = time.strptime(header["fileopen_time"].replace("__", "_0"), "%a_%b_%d_%H:%M:%S_%Y")
        again = encode(
            Header(
                header["the8x3_filename"],
                header["full_filename"],
                header["filename_extension"],
                header["mission_name"],
                calendar.timegm(opened),
            ),
            sensors,
            *table(found, sizes, order),
            factored=header["sensor_list_factored"] == "1",
            generation=Generation.G2 if order == ">" else Generation.G3,
        )
        total += 1
        mine, _ = cycles(again, at + 16, sizes)
        if repeats(found, mine) == 0:
            assert again == data
        else:
            assert again[: at + 16] == data[: at + 16]
    assert total >= 8


def repeats(real: list[Cycle], mine: list[Cycle]) -> int:
    """How often the glider wrote an unchanged value where we say "same"; anything else must be equal."""
    assert len(real) == len(mine)
    held: dict[int, bytes] = {}
    count = 0
    for (real_states, real_raw), (states, raw) in zip(real, mine, strict=True):
        for j, state in enumerate(real_states):
            if state == 2 and states[j] == 1:
                assert real_raw[j] == held[j]
                count += 1
            else:
                assert (state, real_raw[j]) == (states[j], raw[j])
            if state == 2:
                held[j] = real_raw[j]
    return count


def test_cache_is_written_before_it_is_needed(mission: Mission, tmp_path: Path) -> None:
    write_cache(tmp_path, mission)
    for segment in mission.segments:
        assert (tmp_path / f"{segment.sensors.crc}.cac").read_bytes() == segment.sensors.text()
