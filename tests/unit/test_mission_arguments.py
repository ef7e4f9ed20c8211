"""The mission argument of an advice: what a Slocum reads, and an error that says what to do."""

from pathlib import Path

import pytest

from gliderwatch.errors import GliderwatchError
from gliderwatch.fleet.advice import Advice, Box
from gliderwatch.fleet.scalar_field import FieldParams
from gliderwatch.service.fields import FieldAdvice, FleetField, write_goto


def advised(folder: Path | None) -> FieldAdvice:
    box = Box(41.0, -71.0, 42.0, -70.0, 0.0, 100.0)
    field = FleetField("upper layer", box, "sci_water_temp", FieldParams(), outputs=folder)
    return FieldAdvice(field, "electa", 1.7e9, Advice(0.5, 41.999999, -70.504166, 0.034, None))


def test_a_goto_list_of_one_waypoint(tmp_path: Path) -> None:
    path = write_goto(advised(tmp_path / "out"))
    assert path == tmp_path / "out" / "electa-upper_layer-goto.ma"
    lines = path.read_text().splitlines()
    assert lines[0] == "behavior_name=goto_list"
    assert "Check it before you send it" in lines[1]
    assert lines[lines.index("<start:waypoints>") + 1] == "-7030.2500 4159.9999"
    assert [line.split()[1:] for line in lines if "b_arg:" in line and "num_waypoints" in line] == [
        ["num_waypoints(nodim)", "1"]
    ]
    assert list(path.parent.iterdir()) == [path]


def test_nothing_is_written_where_nothing_is_wanted_or_can_be(tmp_path: Path) -> None:
    assert write_goto(advised(None)) is None
    (tmp_path / "file").write_text("")
    with pytest.raises(GliderwatchError, match=r"fields\.upper layer\.advice\.outputs"):
        write_goto(advised(tmp_path / "file"))
