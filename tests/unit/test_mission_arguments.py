"""The mission argument of an advice: what a Slocum reads, and an error that says what to do."""

from pathlib import Path

import pytest

from gliderwatch.errors import GliderwatchError
from gliderwatch.fleet.advice import Advice
from gliderwatch.slocum.mission_arguments import write_goto


def written(folder: Path) -> Path:
    advice = Advice(0.5, 41.999999, -70.504166, 0.034, None)
    return write_goto("electa", "upper layer", 1.7e9, advice, folder)


def test_a_goto_list_of_one_waypoint(tmp_path: Path) -> None:
    path = written(tmp_path / "out")
    assert path == tmp_path / "out" / "electa-upper_layer-goto.ma"
    lines = path.read_text().splitlines()
    assert lines[0] == "behavior_name=goto_list"
    assert "Check it before you send it" in lines[1]
    assert lines[lines.index("<start:waypoints>") + 1] == "-7030.2500 4159.9999"
    assert [line.split()[1:] for line in lines if "b_arg:" in line and "num_waypoints" in line] == [
        ["num_waypoints(nodim)", "1"]
    ]
    assert list(path.parent.iterdir()) == [path]


def test_where_it_cannot_be_written_the_setting_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(GliderwatchError, match=r"fields\.upper layer\.advice\.outputs"):
        written(tmp_path / "file")
