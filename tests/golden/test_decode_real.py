"""The five real missions, file by file."""

import math
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from gliderwatch.errors import MissingCache, Quarantine
from gliderwatch.model import Segment
from gliderwatch.slocum import folders
from gliderwatch.slocum.decode import Decoder, decode
from gliderwatch.slocum.header import read_header
from gliderwatch.slocum.sensors import QUANTITIES, SCIENCE, model_declination

pytestmark = pytest.mark.real

# Mission: glider, files of flight data, those that wait for a cache file by its name.
MISSIONS = {
    "electa-2022": ("electa", 94, {"18531aa2": 1}),
    "usf-sam-2019": ("usf-sam", 39, {}),
    "george-2024": ("george", 48, {}),
    "osu-2025": ("osu684", 17, {}),
    "maria-2022": ("maria-997", 69, {}),
}


def flight_files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.glob("from-glider/*") if folders.kind(path.name))


@pytest.fixture(scope="module")
def decoded(shared_data):
    """Outcomes by mission and path."""
    with Decoder([]) as decoder:
        outcomes = {}
        for mission in MISSIONS:
            decoder.cache_folders = (shared_data / mission / "cache",)
            outcomes[mission] = dict(decoder.map(flight_files(shared_data / mission)))
    return outcomes


@pytest.fixture(params=MISSIONS)
def mission(request):
    return request.param


def segments(outcomes) -> list[Segment]:
    return sorted((s for s in outcomes.values() if isinstance(s, Segment)), key=lambda s: s.id)


def test_every_file_is_decoded_or_waits_for_its_cache(decoded, mission):
    glider, n, waiting = MISSIONS[mission]
    errors = [outcome for outcome in decoded[mission].values() if not isinstance(outcome, Segment)]
    assert len(decoded[mission]) == n
    assert all(isinstance(error, MissingCache) for error in errors), errors
    assert Counter(error.crc for error in errors) == waiting
    assert {segment.id.glider for segment in segments(decoded[mission])} == {glider}
    assert len({segment.id for segment in segments(decoded[mission])}) == n - len(errors)


def test_nothing_real_is_out_of_range(decoded, mission):
    limits = {row.name: row for row in QUANTITIES}
    for segment in segments(decoded[mission]):
        assert segment.dropped == {}
        for name, series in segment.quantities.items():
            assert np.all((series.v >= limits[name].low) & (series.v <= limits[name].high))
            assert np.all(np.diff(series.t) > 0)
            assert segment.id.opened_at - 600 < series.t[0] <= series.t[-1] <= segment.last_t


def test_headers_agree_with_dbdreader(shared_data, mission):
    dbdreader = pytest.importorskip("dbdreader")
    folder = shared_data / mission
    for path in flight_files(folder):
        header = read_header(path)
        try:
            dbd = dbdreader.DBD(str(path), cacheDir=str(folder / "cache"))
        except dbdreader.DbdError:
            assert header.crc in MISSIONS[mission][2]
            continue
        info = dbd.headerInfo
        assert header.id.name == info["full_filename"]
        assert header.id.opened_at == dbd.get_fileopen_time()
        assert header.mission == dbd.get_mission_name()
        assert header.crc == info["sensor_list_crc"].lower()
        assert header.factored == bool(info["sensor_list_factored"])
        assert (header.n_sensors, header.n_held) == (info["total_num_sensors"], info["sensors_per_cycle"])


def test_values_agree_with_dbdreader(shared_data, decoded, mission):
    dbdreader = pytest.importorskip("dbdreader")
    compared = 0
    for path, segment in decoded[mission].items():
        if not isinstance(segment, Segment):
            continue
        dbd = dbdreader.DBD(str(path), cacheDir=str(shared_data / mission / "cache"))
        for row in QUANTITIES:
            if row.pair in ("fix", "dr", "waypoint") or row.name in SCIENCE:
                continue
            if not dbd.has_parameter(row.sensors[0]):
                continue
            t, v = dbd.get(row.sensors[0])
            if row.name in ("altitude", "water_depth"):
                t, v = t[v > 0], v[v > 0]
            _, first = np.unique(t, return_index=True)
            assert np.array_equal(segment.get(row.name).t, t[first]), (path, row.name)
            assert segment.get(row.name).v == pytest.approx(row.to_si(v[first]))
            compared += len(first)
        if dbd.has_parameter("m_gps_lat"):
            (t, lat), (_, lon) = dbd.get("m_gps_lat", "m_gps_lon")
            fixes = segment.get("fix_lat"), segment.get("fix_lon")
            assert np.array_equal(fixes[0].t, t)
            assert fixes[0].v == pytest.approx(lat)
            assert fixes[1].v == pytest.approx(lon)
    assert compared > 1000


def test_science_data_are_not_flight_data(shared_data):
    for path in (shared_data / "usf-sam-2019" / "from-glider").glob("*.tbd"):
        with pytest.raises(Quarantine, match="holds tbd data"):
            read_header(path)


@pytest.mark.parametrize(
    ("mission_name", "source", "degrees"),
    [
        ("electa-2022", "glider", -16.3),
        ("george-2024", "glider", 12.7),
        ("usf-sam-2019", "WMM2015v2", -7.1),
        ("maria-2022", "WMM2020", 15.8),
        ("osu-2025", "WMM2025", -4.2),
    ],
)
def test_declinations(decoded, mission_name, source, degrees):
    found = [s.declination for s in segments(decoded[mission_name]) if s.declination_source == source]
    assert len(found) > 5
    assert math.degrees(np.median(found)) == pytest.approx(degrees, abs=0.1)


def test_the_gliders_own_variation_is_within_a_degree_of_the_model(decoded):
    for mission_name in ("electa-2022", "george-2024"):
        for segment in segments(decoded[mission_name]):
            fix = segment.get("fix_lat")
            if segment.declination_source == "glider" and len(fix):
                lon = segment.get("fix_lon").v[0]
                model, _ = model_declination(float(fix.v[0]), float(lon), float(fix.t[0]))
                assert abs(math.degrees(model - segment.declination)) < 1.0


def test_a_cut_copy_of_a_real_file_agrees_with_the_whole(shared_data, decoded, tmp_path):
    path = shared_data / "george-2024" / "from-glider" / "george-2024-250-10-10.sbd"
    whole = decoded["george-2024"][path]
    copy, content = tmp_path / path.name, path.read_bytes()
    for end in range(2000, len(content), 997):
        copy.write_bytes(content[:end])
        part = decode(copy, [shared_data / "george-2024" / "cache"])
        assert part.completeness < whole.completeness
        assert part.dropped == {}
        for name, series in part.quantities.items():
            assert np.array_equal(series.v, whole.get(name).v[: len(series)])
