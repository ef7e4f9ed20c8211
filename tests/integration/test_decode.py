"""Decoding of whole files, in this process and in workers. Real dbdreader, real files, no network."""

import locale
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import dinkum
from bad_decode import misbehave
from gliderwatch.errors import MissingCache, Quarantine, Retry
from gliderwatch.model import Segment
from gliderwatch.slocum.decode import Decoder, decode

CRC = "0abc12ef"


@pytest.fixture
def station(tmp_path):
    """A from-glider folder with one good file, and a cache folder with its cache file."""
    cache = tmp_path / "cache"
    cache.mkdir()
    (cache / f"{CRC}.cac").write_bytes(dinkum.sensor_list())
    folder = tmp_path / "from-glider"
    folder.mkdir()
    (folder / "00010003.sbd").write_bytes(dinkum.header() + dinkum.cycles(dinkum.rows()))
    return folder / "00010003.sbd", cache


def same(a: Segment, b: Segment) -> bool:
    return a.completeness == b.completeness and all(
        np.array_equal(a.get(name).t, b.get(name).t) and np.array_equal(a.get(name).v, b.get(name).v)
        for name in a.quantities.keys() | b.quantities.keys()
    )


def state(*folders: Path) -> dict[str, tuple[int, int, int]]:
    paths = [path for folder in folders for path in [folder, *folder.rglob("*")]]
    return {str(p): (p.stat().st_mtime_ns, p.stat().st_ctime_ns, p.stat().st_size) for p in paths}


def until(condition, seconds=5.0):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


# --------------------------------------------------------------------------- one file


def test_the_values_of_a_file(station):
    path, cache = station
    segment = decode(path, [cache])
    rows = dinkum.rows()[1:]  # the first cycle repeats the segment before
    assert segment.completeness[:2] == (0, 60)
    assert segment.last_t == rows[-1]["m_present_time"]
    assert segment.get("heading").t.tolist() == [row["m_present_time"] for row in rows]
    assert segment.get("heading").v == pytest.approx([row["m_heading"] for row in rows])
    fixes = [row for row in rows if "m_gps_lat" in row]
    assert len(segment.get("fix_lat")) == len(fixes) == 6
    assert segment.get("fix_lat").v[0] == pytest.approx(28 + 24.42 / 60)
    assert segment.get("current_x").v == pytest.approx([0.12])
    assert segment.get("vacuum").v == pytest.approx([8.5 * 3386.389])
    assert segment.dropped == {}
    assert not segment.get("pitch").v.flags.writeable


def test_big_endian_files_are_the_same(station):
    path, cache = station
    little = decode(path, [cache])
    path.write_bytes(dinkum.header() + dinkum.cycles(dinkum.rows(), order=">"))
    big = decode(path, [cache])
    assert all(np.array_equal(little.get(name).v, big.get(name).v) for name in little.quantities)


@pytest.mark.parametrize("name", ["00010003.scd", "00010003.SCD", "00010003.sbd", "unit_7-2024-250-1-3.scd"])
def test_compressed_files_are_the_same_whatever_their_name(station, name):
    path, cache = station
    plain = decode(path, [cache])
    compressed = path.with_name(name)
    compressed.write_bytes(dinkum.compress(path.read_bytes()))
    assert same(decode(compressed, [cache]), plain)


@pytest.mark.parametrize(
    ("name", "packed"),
    [
        (f"{CRC}.cac", False),
        (f"{CRC.upper()}.CAC", False),
        (f"{CRC.upper()}.cac", False),
        (f"{CRC}.ccc", True),
        (f"{CRC.upper()}.CCC", True),
    ],
)
def test_cache_files_in_either_case_plain_or_compressed_in_any_of_the_folders(
    station, tmp_path, name, packed
):
    path, cache = station
    expected = decode(path, [cache])
    other = tmp_path / "other"
    other.mkdir()
    content = dinkum.sensor_list()
    (other / name).write_bytes(dinkum.compress(content) if packed else content)
    (cache / f"{CRC}.cac").unlink()
    assert same(decode(path, [cache, tmp_path / "not there", other]), expected)


def test_a_missing_cache_file_is_waited_for_by_name(station):
    path, cache = station
    (cache / f"{CRC}.cac").unlink()
    with pytest.raises(MissingCache) as caught:
        decode(path, [cache])
    assert caught.value.crc == CRC
    (cache / f"{CRC}.cac").write_bytes(dinkum.sensor_list())
    assert decode(path, [cache]).completeness[1] == 60


@pytest.mark.parametrize(
    "content",
    [b"", b"garbage", dinkum.sensor_list()[:100], dinkum.sensor_list(dinkum.SENSORS[:8])],
    ids=["empty", "garbage", "cut", "of another file"],
)
def test_a_bad_cache_file_is_named_and_replaced_when_it_changes(station, content):
    path, cache = station
    (cache / f"{CRC}.cac").write_bytes(content)
    with pytest.raises(Retry, match=f"cache file .*{CRC}.cac"):
        decode(path, [cache])
    (cache / f"{CRC}.cac").write_bytes(dinkum.sensor_list())
    assert decode(path, [cache]).completeness[1] == 60


def test_a_cache_file_that_does_not_fit_is_named(station):
    path, cache = station
    (cache / f"{CRC}.cac").write_bytes(dinkum.sensor_list(dinkum.SENSORS[:11]))
    with pytest.raises(Retry, match=f"{CRC}.cac does not fit: it lists 12 sensors and 11"):
        decode(path, [cache])


def test_a_cache_file_cut_between_lines_is_named(station):
    path, cache = station
    (cache / f"{CRC}.cac").write_bytes(b"".join(dinkum.sensor_list().splitlines(keepends=True)[:6]))
    with pytest.raises(Retry, match=f"{CRC}.cac cannot be used: it is cut or changed"):
        decode(path, [cache])


def test_a_cache_file_with_two_sensors_exchanged_is_named_and_not_used(station):
    path, cache = station
    exchanged = dinkum.sensor_list().replace(b"m_heading", b"m_x").replace(b"m_pitch", b"m_heading")
    (cache / f"{CRC}.cac").write_bytes(exchanged.replace(b"m_x", b"m_pitch"))
    with pytest.raises(Retry, match=f"{CRC}.cac .*the checksum of its content is [0-9a-f]{{8}}, not {CRC}"):
        decode(path, [cache])


BAD = {
    "empty": b"",
    "cut in a line": dinkum.sensor_list()[:100],
    "cut between lines": dinkum.sensor_list()[: dinkum.sensor_list().index(b"s: T    6")],
    "another list": dinkum.sensor_list(crc="11111111"),
    "garbage": b"garbage",
}


@pytest.mark.parametrize("bad", BAD.values(), ids=BAD)
@pytest.mark.parametrize("good", [f"{CRC}.ccc", f"{CRC.upper()}.CAC", "0aBc12eF.Cac", "0ABC12ef.cCC"])
def test_a_good_cache_file_is_used_whatever_lies_in_its_way(station, tmp_path, good, bad):
    path, cache = station
    expected = decode(path, [cache])
    content = dinkum.sensor_list()
    packed = dinkum.compress(content) if good.lower().endswith("ccc") else content
    (cache / f"{CRC}.cac").write_bytes(bad)
    (cache / good).write_bytes(packed)
    assert same(decode(path, [cache]), expected)  # beside the bad one
    other = tmp_path / "other"
    other.mkdir()
    (cache / good).rename(other / good)
    assert same(decode(path, [cache, other]), expected)  # in the next folder


def test_each_cache_file_that_cannot_be_used_is_named_with_what_is_wrong(station, tmp_path):
    path, cache = station
    other = tmp_path / "other"
    other.mkdir()
    (cache / f"{CRC}.cac").write_bytes(b"")
    (other / f"{CRC.upper()}.CAC").write_bytes(dinkum.sensor_list(crc="11111111"))
    (other / f"{CRC}.ccc").mkdir()
    with pytest.raises(Retry) as caught:
        decode(path, [cache, other])
    assert str(caught.value) == (
        f"cache file {cache}/{CRC}.cac cannot be used: it is empty, or cut at its start; "
        f"cache file {other}/{CRC.upper()}.CAC cannot be used: it is cut or changed, or is another list: "
        f"the checksum of its content is 11111111, not {CRC}; "
        f"cache file {other}/{CRC}.ccc cannot be used: not a regular file but a folder; "
        "copy it from the glider or the dockserver again"
    )


@pytest.mark.parametrize("change", [b"\r\n", b"\n"], ids=["CRLF", "LF"])
@pytest.mark.parametrize("padding", [b"", b"\r\n", b"\x1a" * 100, b"\0" * 20], ids=["", "line", "^Z", "0"])
def test_line_ends_and_padding_of_a_transfer_are_no_other_list(station, change, padding):
    path, cache = station
    expected = decode(path, [cache])
    (cache / f"{CRC}.cac").write_bytes(dinkum.sensor_list().replace(b"\n", change) + padding)
    assert same(decode(path, [cache]), expected)
    (cache / f"{CRC}.cac").unlink()
    packed = dinkum.compress(dinkum.sensor_list().replace(b"\n", change) + padding)
    (cache / f"{CRC}.ccc").write_bytes(packed)
    assert same(decode(path, [cache]), expected)


def test_a_sensor_list_that_was_damaged_on_its_way_is_not_believed(station):
    path, _ = station
    listed = dinkum.sensor_list().replace(b"m_pitch", b"m_pitsh")
    path.write_bytes(dinkum.header(factored=False) + listed + dinkum.cycles(dinkum.rows()))
    with pytest.raises(Quarantine, match="damaged in its sensor list"):
        decode(path, [])


def test_a_header_that_lies_about_its_sensor_list_does_not_fit(station):
    path, cache = station
    whole = decode(path, [cache])
    content = path.read_bytes()
    path.write_bytes(content.replace(b"total_num_sensors:    13", b"total_num_sensors:    23"))
    with pytest.raises(Retry, match="does not fit"):
        decode(path, [cache])
    path.write_bytes(content)
    assert same(decode(path, [cache]), whole)


def test_an_unfactored_file_needs_no_cache_and_leaves_none(station, tmp_path):
    path, cache = station
    expected = decode(path, [cache])
    content = dinkum.header(factored=False) + dinkum.sensor_list() + dinkum.cycles(dinkum.rows())
    path.write_bytes(content)
    before = state(tmp_path)
    assert same(decode(path, []), expected) is False  # the header is part of the content
    assert np.array_equal(decode(path, []).get("heading").v, expected.get("heading").v)
    other = dinkum.sensor_list(tuple((n.replace("m_pitch", "m_other"), s, u) for n, s, u in dinkum.SENSORS))
    path.write_bytes(content.replace(dinkum.sensor_list(), other))
    assert "pitch" not in decode(path, []).quantities
    path.write_bytes(dinkum.header() + dinkum.cycles(dinkum.rows()))
    assert same(decode(path, [cache]), expected)  # not spoilt by the sensor list of the other
    assert state(tmp_path).keys() == before.keys()


def test_a_cut_copy_is_less_complete_and_its_values_begin_the_same(station):
    path, cache = station
    whole, content = decode(path, [cache]), path.read_bytes()
    counts = []
    for end in range(len(content), len(dinkum.header()), -97):
        path.write_bytes(content[:end])
        part = decode(path, [cache])
        counts.append(part.completeness)
        for name, series in part.quantities.items():
            n = len(series)
            assert np.array_equal(series.t, whole.get(name).t[:n])
            assert np.array_equal(series.v, whole.get(name).v[:n])
    assert counts == sorted(counts, reverse=True)
    assert counts[0] == whole.completeness
    assert counts[-1][1] < 5


def test_the_end_mark_and_padding_do_not_make_another_copy(station):
    path, cache = station
    whole, content = decode(path, [cache]), path.read_bytes()
    for other in (content[:-1], content + b"\x1a" * 300):
        path.write_bytes(other)
        assert decode(path, [cache]).completeness == whole.completeness


def test_damage_in_the_middle_keeps_what_is_before_it(station):
    path, cache = station
    whole, content = decode(path, [cache]), bytearray(path.read_bytes())
    middle = len(content) // 2
    content[middle : middle + 200] = bytes(200)
    path.write_bytes(content)
    part = decode(path, [cache])
    assert 20 < part.completeness[1] < 40
    assert part.dropped["bytes"] > 200
    n = len(part.get("heading"))
    assert np.array_equal(part.get("heading").v, whole.get("heading").v[:n])


def test_a_header_without_values_is_an_empty_segment(station):
    path, cache = station
    path.write_bytes(dinkum.header())
    segment = decode(path, [cache])
    assert segment.quantities == {}
    assert segment.completeness[1] == 0
    assert segment.last_t == dinkum.OPENED_AT


def test_a_file_without_times_is_no_use(station):
    path, cache = station
    sensors = (("m_absent_timeX", 8, "s"), *dinkum.SENSORS[1:])
    (cache / f"{CRC}.cac").write_bytes(dinkum.sensor_list(sensors))
    with pytest.raises(Quarantine, match="m_present_time"):
        decode(path, [cache])


def test_a_huge_file_is_not_read(station):
    path, cache = station
    os.truncate(path, 600 * 1024**2)
    with pytest.raises(Quarantine, match="larger than"):
        decode(path, [cache])


def test_nothing_is_written_beside_the_data_nor_into_the_cache_folder(station, tmp_path):
    path, cache = station
    for folder in (path.parent, cache):
        folder.chmod(0o555)
    before = state(tmp_path)
    decode(path, [cache])
    with Decoder([cache]) as decoder:
        decoder.submit(path).result(10)
    assert state(tmp_path) == before


def test_home_and_locale_are_left_alone(station, tmp_path):
    script = (
        "import locale, os, sys; from pathlib import Path\n"
        "from gliderwatch.slocum.decode import decode\n"
        "locale.setlocale(locale.LC_ALL, 'C')\n"
        "decode(Path(sys.argv[1]), [Path(sys.argv[2])])\n"
        "assert 'dbdreader' in sys.modules\n"
        "print(os.environ['HOME'], locale.setlocale(locale.LC_ALL))\n"
    )
    for home in (tmp_path / "home", Path("/proc")):  # the second cannot be written even by root
        run = subprocess.run(
            [sys.executable, "-c", script, *map(str, station)],
            env=os.environ | {"HOME": str(home)},
            capture_output=True,
            text=True,
            check=False,
            timeout=60,
        )
        assert (run.stdout.strip(), run.stderr) == (f"{home} C", "")
    assert not (tmp_path / "home").exists()


def test_the_locale_here_is_left_alone(station):
    before = locale.setlocale(locale.LC_ALL)
    decode(station[0], [station[1]])
    assert locale.setlocale(locale.LC_ALL) == before


# --------------------------------------------------------------------------- in workers


def test_a_worker_gives_what_decode_gives(station):
    path, cache = station
    with Decoder([cache]) as decoder:
        segment = decoder.submit(path).result(20)
    assert same(segment, decode(path, [cache]))
    assert not segment.get("pitch").v.flags.writeable


def test_errors_come_whole_out_of_a_worker(station):
    path, cache = station
    bad = path.with_name("00010004.sbd")
    bad.write_bytes(b"no data")
    with Decoder([]) as decoder:
        with pytest.raises(MissingCache) as caught:
            decoder.submit(path).result(20)
        assert caught.value.crc == CRC
        assert str(caught.value) == str(MissingCache(CRC))
        with pytest.raises(Quarantine, match="not a Slocum data file"):
            decoder.submit(bad).result(20)
        with pytest.raises(Retry, match="No such file"):
            decoder.submit(path.with_name("gone.sbd")).result(20)
        decoder.cache_folders = (cache,)
        assert decoder.submit(path).result(20).completeness[1] == 60


@pytest.mark.parametrize(
    ("name", "error", "says"),
    [
        ("hang", Quarantine, "longer than 1 s"),
        ("hang-in-c", Quarantine, "longer than 1 s"),
        ("crash", Quarantine, "crashed .*SIGSEGV"),
        ("exit", Quarantine, "crashed .*exit code 3"),
        ("killed", Retry, "ended from outside"),
        ("memory", Quarantine, "memory"),
        ("error", Quarantine, "IndexError: index 9 is out of bounds"),
        ("exits", Quarantine, "SystemExit"),
        ("program", Quarantine, "no segment but _Program"),
    ],
)
def test_whatever_a_file_does_to_a_worker_the_next_one_is_decoded(station, name, error, says):
    path, cache = station
    with Decoder([cache], timeout=1.0, decode=misbehave) as decoder:
        for _ in range(5):
            bad = decoder.submit(path.with_name(f"{name}.sbd"))
            good = decoder.submit(path)
            # a worker that is gone before pebble has heard what it took up: the service tries again, too
            if not any("was interrupted" in str(each.exception(20)) for each in (bad, good)):
                break
        with pytest.raises(error, match=says):
            bad.result(20)
        assert good.result(20).completeness[1] == 60
    assert not path.with_name("program.written").exists(), "the daemon ran what a worker made"


def test_a_worker_that_dies_idle_is_replaced(station):
    path, cache = station
    with Decoder([cache], decode=misbehave) as decoder:
        pid = int(str(decoder.submit(path.with_name("pid.sbd")).exception(20)))
        os.kill(pid, signal.SIGKILL)
        until(lambda: not Path(f"/proc/{pid}/stat").exists())
        outcome = [decoder.submit(path).exception(20) for _ in range(3)]
        assert outcome[-1] is None
        assert all(error is None or isinstance(error, Retry) for error in outcome)


@pytest.mark.timing
@pytest.mark.parametrize("name", ["hang", "hang-in-c"])
def test_closing_does_not_wait_for_a_hanging_task(station, name):
    path, cache = station
    decoder = Decoder([cache], decode=misbehave)
    pid = int(str(decoder.submit(path.with_name("pid.sbd")).exception(20)))
    hanging, waiting = decoder.submit(path.with_name(f"{name}.sbd")), decoder.submit(path)
    time.sleep(0.2)
    start = time.monotonic()
    decoder.close()
    assert time.monotonic() - start < 2.0
    assert hanging.cancelled()
    assert waiting.cancelled()
    assert not Path(f"/proc/{pid}").exists()
    with pytest.raises(RuntimeError, match="closed"):
        decoder.submit(path)


def test_workers_end_with_a_daemon_that_is_killed(tmp_path):
    script = (
        "import sys, time; from pathlib import Path\n"
        "from bad_decode import misbehave\n"
        "from gliderwatch.slocum.decode import Decoder\n"
        "if __name__ == '__main__':\n"
        "    decoder = Decoder([], decode=misbehave, timeout=1)\n"
        "    print(decoder.submit(Path('pid.sbd')).exception(20), flush=True)\n"
        "    decoder.submit(Path(sys.argv[1] + '.sbd'))\n"
        "    time.sleep(0.3)\n"
        "    print('ready', flush=True)\n"
        "    time.sleep(60)\n"
    )
    for name in ("hang-in-c", "idle"):
        daemon = subprocess.Popen(
            [sys.executable, "-c", script, name],
            env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), "TMPDIR": str(tmp_path)},
            stdout=subprocess.PIPE,
            text=True,
        )
        assert daemon.stdout is not None
        worker = int(daemon.stdout.readline())
        assert daemon.stdout.readline() == "ready\n"
        daemon.kill()
        daemon.wait()
        daemon.stdout.close()
        until(lambda pid=worker: not _runs(pid))


def _runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_map_keeps_the_order_and_looks_ahead_only_so_far(station):
    path, cache = station
    taken = []

    def paths():
        for i in range(30):
            taken.append(i)
            yield path if i % 3 else path.with_name("slow.sbd") if i == 6 else path.with_name("gone.sbd")

    with Decoder([cache], max_workers=2, decode=misbehave) as decoder:
        results = decoder.map(paths(), ahead=5)
        first = next(results)
        assert len(taken) == 5
        outcomes = [first, *results]
    assert [type(outcome).__name__ for _, outcome in outcomes] == [
        "Segment" if i % 3 else "Quarantine" if i == 6 else "Retry" for i in range(30)
    ]
