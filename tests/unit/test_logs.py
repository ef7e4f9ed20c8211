"""What a glider says in the log of a call: every public line, garbled lines, logs that grow, large logs."""

from __future__ import annotations

import random
import resource
from calendar import timegm
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gliderwatch.errors import Quarantine, Retry
from gliderwatch.model import Aborts, Happened, Happening
from gliderwatch.slocum import calls, logs
from gliderwatch.slocum.calls import Dialog, begun, read_log, split, with_line
from gliderwatch.slocum.folders import is_log
from gliderwatch.slocum.logs import parse_line

NAME = "unit_1033_20250126T072155_network_net_0.log"
T0 = float(timegm((2025, 1, 26, 7, 21, 40)))
GLIDER = "unit_1033"
STATUS = f"""Connection Event: Carrier Detect found.263958    Iridium console active and ready...
Vehicle Name: {GLIDER}
Curr Time: Sun Jan 26 07:21:40 2025 MT:  263958
GPS Location:  6127.509 N   228.117 E measured     40.692 secs ago
Because:pitch not commanded [behavior surface_4 start_when = 2.0]
MissionName:ew33.mi MissionNum:unit_1033-2025-022-0-33 (0103.0033)
ABORT HISTORY: total since reset: 0
"""
ABORT = """ABORT HISTORY: total since reset: 1
ABORT HISTORY: last abort cause: MS_ABORT_LEAK
ABORT HISTORY: last abort time: 2025-01-26T05:27:05
ABORT HISTORY: last abort segment: unit_1033-2025-022-0-32 (0103.0032)
ABORT HISTORY: last abort mission: EW33.MI
"""


@pytest.mark.parametrize(
    ("line", "events"),
    [
        ("Connection Event: Carrier Detect found.263958    Iridium", [logs.Carrier(found=True)]),
        ("> Connection Event: Carrier Detect lost.", [logs.Carrier(found=False)]),
        ("280825    disabling Iridium console...", [logs.Carrier(found=False)]),
        ("Vehicle Name: Unit_1033", [logs.Vehicle("unit_1033")]),
        ("Vehicle Name: ../../etc", []),
        ("Curr Time: Sun Jan 26 07:21:40 2025 MT:  263958", [logs.Clock(T0, 263958.0)]),
        ("Curr Time: Fri Jul  1 00:00:00 2011", [logs.Clock(1309478400.0, None)]),
        ("Curr Time: Fri Jux  1 00:00:00 2011 MT: 1", []),
        ("Curr Time: Fri Jul  1 25:00:00 2011 MT: 1", []),
        (
            "GPS Location:  6127.509 N   228.117 E measured     40.692 secs ago",
            [logs.Position(61 + 27.509 / 60, 2 + 28.117 / 60, 40.692)],
        ),
        (
            "GPS Location:  -3312.5 N -15130.0 E measured 1 secs ago",
            [logs.Position(-(33 + 12.5 / 60), -151.5, 1.0)],
        ),
        ("GPS Location:  6167.509 N   228.117 E measured     40.692 secs ago", []),
        ("GPS Location:  9127.509 N   228.117 E measured     40.692 secs ago", []),
        ("GPS Location: 69696969.000 N 69696969.000 E measured     1e+308 secs ago", []),
        ("GPS TooFar:   69696969.000 N 69696969.000 E measured     1e+308 secs ago", []),
        ("GPS Invalid :  6129.260 N   224.059 E measured    115.648 secs ago", []),
        ("DR  Location:  6127.509 N   228.117 E measured     40.584 secs ago", []),
        (
            "   sensor:m_battery(volts)=15.0642643455672        59.765 secs ago",
            [logs.Reading("m_battery", 15.0642643455672, "volts", 59.765)],
        ),
        (
            "   sensor:c_dive_bpump(X)=-203.75                 172.955 secs ago",
            [logs.Reading("c_dive_bpump", -203.75, "X", 172.955)],
        ),
        (
            "   sensor:m_lithium_battery_relative_charge(%)=91.4165287356323        3.886 secs ago",
            [logs.Reading("m_lithium_battery_relative_charge", 91.4165287356323, "%", 3.886)],
        ),
        ("   sensor:m_why_started(enum)=6                    1e+308 secs ago", []),
        ("Glider unit_1033 at surface.", []),
        (
            "Because:timeout expired [behavior surface_4 start_when = 2.0]",
            [logs.Because("timeout expired")],
        ),
        ("Because:Hit a waypoint [behavior surface_2]", [logs.Because("Hit a waypoint")]),
        (
            "MissionName:EW33.MI MissionNum:unit_1033-2025-022-0-33 (0103.0033)",
            [logs.Mission("ew33.mi", "unit_1033-2025-022-0-33", "0103.0033")],
        ),
        (
            "devices:(t/m/s) errs: 0/ 0/ 0 warn: 34/ 6/ 1 odd: 277/ 72/ 4",
            [logs.Counts((0, 0, 0), (34, 6, 1), (277, 72, 4))],
        ),
        (
            "14 digifin I u 3 20 5 0 [ 0 0 0] [ 28 5 1] [ 227 62 4]",
            [logs.Device("digifin", logs.Counts((0, 0, 0), (28, 5, 1), (227, 62, 4)))],
        ),
        ("ABORT HISTORY: total since reset: 1", [logs.AbortCount(1)]),
        ("ABORT HISTORY: total since reset: 1#", []),
        (
            "ABORT HISTORY: last abort cause: MS_ABORT_NO_HEADING_MEASUREMENT",
            [logs.AbortCause("NO_HEADING_MEASUREMENT")],
        ),
        ("ABORT HISTORY: last abort time: 2011-07-02T11:27:05", [logs.AbortTime(1309606025.0)]),
        ("ABORT HISTORY: last abort time: 2011-17-02T11:27:05", []),
        (
            "ABORT HISTORY: last abort segment: unit_1-2011-182-0-3 (0001.0003)",
            [logs.AbortPlace("segment", "unit_1-2011-182-0-3")],
        ),
        ("ABORT HISTORY: last abort mission: EW33.MI", [logs.AbortPlace("mission", "EW33.MI")]),
        (
            "62.87 28 behavior ?_-1: abort_the_mission(1): (8)MS_ABORT_OVERTIME",
            [logs.AbortNow("OVERTIME")],
        ),
        ("drop_the_weight = 0", []),
        ("drop_the_weight = 1", [logs.WeightDropped()]),
        ("Mission completed ABNORMALLY", [logs.FellOut()]),
        ("SEQUENCE: Running lastgasp.mi on try 0", [logs.LastMission("lastgasp")]),
        ("Starting Mission: lastgasp.mi", [logs.LastMission("lastgasp")]),
        ("SEQUENCE: About to run initial.mi", [logs.LastMission("initial")]),
        ("Starting Mission: LASTGASP.MI", [logs.LastMission("lastgasp")]),
        ("Starting Mission: ew33.mi", []),
        ("GliderDos A 8 >", [logs.Prompt("A", 8)]),
        ("GliderDos I -3 >", [logs.Prompt("I", -3)]),
        ("GliderDos N -1 >run ew33.mi", [logs.Prompt("N", -1)]),
        (
            "Waypoint: (6115.0000,245.0000) Range: 27673m, Bearing: 149deg, Age: 14:49h:m",
            [logs.Waypoint(61.25, 2.75)],
        ),
        ("Time until diving is: 235 secs", [logs.Diving(235.0)]),
        (
            "Starting zModem transfer of 01030033.tcd to/from unit_1033 size is 8208",
            [logs.Transfer("01030033.tcd", 8208, done=False)],
        ),
        ("zModem transfer DONE for file 01030033.tcd", [logs.Transfer("01030033.tcd", None, done=True)]),
        ("GLD: SUCCESS", [logs.Sent("GLD")]),
        ("SCI: SUCCESS", [logs.Sent("SCI")]),
        ("280825    behavior surface_4: TIMED OUT WAITING FOR A CHARACTER", [logs.Unattended()]),
        ("User typed Control-R, resuming", [logs.PilotThere(ends=False)]),
        ("RESUMING MISSION", [logs.PilotThere(ends=False)]),
        ("I heard a Control-C", [logs.PilotThere(ends=True)]),
        ("I am going to hangup the Iridium!", [logs.HangUp(None)]),
        ("I will call you back in 2 minutes", [logs.HangUp(2.0)]),
        ("!!HARDWARE IN EMERGENCY MODE!!", [logs.Emergency()]),
        ("12 DRIVER_WARNING:gps:no fix", [logs.Trouble("warning", "12 DRIVER_WARNING:gps:no fix")]),
        ("12 DRIVER_ERROR:fin:stuck", [logs.Trouble("error", "12 DRIVER_ERROR:fin:stuck")]),
        ("12 DRIVER_ODDITY:gps:late", [logs.Trouble("oddity", "12 DRIVER_ODDITY:gps:late")]),
        ("Because:no comms for a while", [logs.Because("no comms for a while")]),
        ("Because:pitch not commanded [behavior]", [logs.Because("pitch not commanded")]),
        ("^R", []),
        ("^W", []),
        (
            ":OOD:digifin_mgr_ctrl:OUT OF DEADBAND: M_FIN:0.0579 C_FIN:0.0000",
            [logs.Trouble("deadband", ":OOD:digifin_mgr_ctrl:OUT OF DEADBAND: M_FIN:0.0579 C_FIN:0.0000")],
        ),
        ("Megabytes available on c: = 7763.84", [logs.Housekeeping("disk_megabytes", 7763.84)]),
        (
            "report_heap_size(): M_FREE_HEAP=277.0K(283620 bytes)",
            [logs.Housekeeping("heap_bytes", 283620.0)],
        ),
        ("   m_weight_drop(bool) 0.000000", [logs.Housekeeping("m_weight_drop", 0.0)]),
        ("   m_weight_drop(bool) 1.0", [logs.Housekeeping("m_weight_drop", 1.0), logs.WeightDropped()]),
        ("**B00000000000000", []),
        ("   Hit Control-C to END    the mission, i.e. GliderDos", []),
        (
            "GliderDos A 8 >Connection Event: Carrier Detect lost.",
            [logs.Prompt("A", 8), logs.Carrier(found=False)],
        ),
    ],
)
def test_line(line: str, events: list[object]) -> None:
    assert list(parse_line(line.encode("latin-1"))) == events


@given(st.binary(max_size=300))
def test_noise_is_read_without_an_error(line: bytes) -> None:
    parse_line(line)


@given(st.data())
def test_garbled_lines_are_read_without_an_error(data: st.DataObject) -> None:
    """Cut, glued, overwritten, in a wrong encoding."""
    lines = (STATUS + ABORT).splitlines()
    one, other = data.draw(st.sampled_from(lines)), data.draw(st.sampled_from(lines))
    cut = data.draw(st.integers(0, len(one)))
    encoding = data.draw(st.sampled_from(["utf-8", "utf-16", "cp500"]))
    noise = data.draw(st.text(max_size=5)).encode("utf-8", "surrogatepass")
    garbled = one[:cut].encode(encoding) + noise + other.encode(encoding)
    for event in parse_line(garbled):
        assert isinstance(event, logs.Event)
    with_line(begun(NAME), garbled)


@given(st.lists(st.integers(0, 900), max_size=6), st.sampled_from(["\n", "\r\n", "\r"]))
def test_log_that_grows_tells_the_same_as_the_whole(cuts: list[int], end: str) -> None:
    data = (STATUS + ABORT + "GliderDos A 8 >").replace("\n", end).encode()
    whole, _ = _with_event(data, [])
    assert _with_event(data, cuts)[0].call == whole.call
    assert whole.call.aborts[-1] == Aborts(1, T0, "LEAK", 1737869225.0)
    assert [h.what for h in whole.call.happened] == [Happening.GLIDER_DOS]


def _with_event(data: bytes, cuts: list[int]) -> tuple[Dialog, bytes]:
    """As `read_log` does with the file as it grows: from each whole line on."""
    dialog, rest = begun(NAME), b""
    edges = [0, *sorted(min(c, len(data)) for c in cuts), len(data)]
    for a, b in pairwise(edges):
        lines, rest = split(rest + data[a:b])
        for line in lines:
            dialog = with_line(dialog, line)
    return with_line(dialog, rest), rest


def test_file_is_read_on_from_where_it_ended(tmp_path: Path) -> None:
    path = tmp_path / NAME
    path.write_bytes(STATUS.replace("\n", "\r\n").encode() + b"ABORT HISTORY: total since res")
    first = read_log(path)
    assert (first.call.glider, first.call.began, first.call.over) == (GLIDER, T0, False)
    assert path.read_bytes()[first.offset :] == b"ABORT HISTORY: total since res"
    with path.open("ab") as file:
        file.write(b"et: 2\r\n")
    second = read_log(path, first)
    assert second.aborts == Aborts(2, T0)
    assert second.offset == path.stat().st_size
    assert read_log(path, second) == second
    path.unlink()
    path.write_bytes(b"Vehicle Name: other\n" + b"\n" * 2000)
    assert read_log(path, second).call.glider == "other"


def test_prompt_is_read_before_its_line_ends(tmp_path: Path) -> None:
    path = tmp_path / NAME
    path.write_bytes(STATUS.encode() + b"GliderDos A 24 >")
    assert read_log(path).call.happened == (Happened(Happening.GLIDER_DOS, T0, "A 24"),)


def test_name_of_the_glider_is_the_most_frequent(tmp_path: Path) -> None:
    path = tmp_path / NAME
    path.write_bytes(b"Vehicle Name: unit_x033\n" + 2 * STATUS.encode())
    assert read_log(path).call.glider == GLIDER


def test_files_whose_transfer_was_cut(tmp_path: Path) -> None:
    path = tmp_path / NAME
    path.write_bytes(
        b"Starting zModem transfer of 01030033.scd to/from unit_1033 size is 3212\n"
        b"zModem transfer DONE for file 01030033.scd\n"
        b"Starting zModem transfer of 01030032.scd to/from unit_1033 size is 598\n"
        b"I will call you back in 2 minutes\nConnection Event: Carrier Detect lost.\n"
    )
    call = read_log(path).call
    assert (call.announced, call.sent) == (("01030033.scd", "01030032.scd"), ("01030033.scd",))
    assert call.over and call.calls_back


@pytest.mark.parametrize(
    ("name", "is_one"),
    [
        (NAME, True),
        ("durin_20210119T233024_modem_tty_dgrp_pt_0.log", True),
        ("betty_freewave_20180530T192247.log", True),
        ("betty_20180530T992247.log", False),
        ("betty_20181330T192247.log", False),
        ("dockserver.log", False),
        ("betty_20180530T192247.sbd", False),
    ],
)
def test_names(name: str, is_one: bool) -> None:
    assert is_log(name) is is_one


def test_a_thousand_mutated_logs(tmp_path: Path) -> None:
    """Bytes overwritten, lines lost, doubled, moved, the end cut: read, or refused by name."""
    rng, path = random.Random(20250126), tmp_path / NAME
    data = (STATUS * 3 + ABORT + "GliderDos A 24 >").replace("\n", "\r\n").encode()
    for _ in range(1000):
        lines = data.splitlines(keepends=True)
        for _ in range(rng.randrange(1, 6)):
            rng.choice((_lose, _double, _move, _overwrite))(lines, rng)
        path.write_bytes(b"".join(lines)[: rng.randrange(len(data) * 2)])
        dialog = read_log(path)
        assert 0 <= dialog.offset <= path.stat().st_size
        assert abs(dialog.call.began - T0) < 3 * 86400.0


def _lose(lines: list[bytes], rng: random.Random) -> None:
    del lines[rng.randrange(len(lines))]


def _double(lines: list[bytes], rng: random.Random) -> None:
    lines.insert(rng.randrange(len(lines)), rng.choice(lines))


def _move(lines: list[bytes], rng: random.Random) -> None:
    lines.insert(rng.randrange(len(lines)), lines.pop(rng.randrange(len(lines))))


def _overwrite(lines: list[bytes], rng: random.Random) -> None:
    k = rng.randrange(len(lines))
    line = bytearray(lines[k])
    for _ in range(rng.randrange(1, 9)):
        line[rng.randrange(len(line))] = rng.randrange(256)
    lines[k] = bytes(line)


@pytest.mark.parametrize("content", [b"\xff" * 15_000_000, STATUS.encode() * 1000])
def test_large_log_needs_no_memory(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / NAME
    path.write_bytes(content)
    size = len(content)
    del content
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert read_log(path).offset <= size
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 10_000  # kB


def test_log_of_a_gigabyte_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / NAME
    with path.open("wb") as file:
        file.truncate(1_000_000_000)
    with pytest.raises(Quarantine, match="larger than 16 MB"):
        read_log(path)


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / NAME).symlink_to("/dev/zero")
    with pytest.raises(Quarantine, match="symbolic link"):
        read_log(tmp_path / NAME)
    with pytest.raises(Retry):
        read_log(tmp_path / f"gone_{NAME}")


def test_what_is_kept_of_a_log_is_bounded() -> None:
    dialog = begun(NAME)
    for k in range(500):
        dialog = with_line(dialog, f"zModem transfer DONE for file {k:08d}.scd".encode())
        dialog = with_line(dialog, f"Vehicle Name: g{k}".encode())
        dialog = with_line(dialog, f"1 behavior x: abort_the_mission(1): (8)MS_ABORT_A{k}".encode())
        dialog = with_line(dialog, f"ABORT HISTORY: total since reset: {k}".encode())
    call = dialog.call
    assert {len(call.sent), len(dialog.names), len(call.happened), len(call.aborts)} == {calls._MOST}
