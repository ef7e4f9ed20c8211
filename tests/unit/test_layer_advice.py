"""Advice of how deep to fly: within what the glider may do; its words, and its mission arguments."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from alert_support import SLOW
from gliderwatch.errors import GliderwatchError
from gliderwatch.incidents.notices import Surfaced
from gliderwatch.layers.advice import LayerAdvice, LayerParams, advise, after
from gliderwatch.layers.band import Band, Method, Mode, Tracking
from gliderwatch.layers.composite import Layer
from gliderwatch.messages.incident_text import surfaced
from gliderwatch.model import Segment, SegmentId, Series, readonly
from gliderwatch.slocum.mission_arguments import write_yo, yo_arguments

PARAMS = LayerParams("temperature", 200.0, 10.0, 10.0, Method.COMPOSITE, 2)
TRACK = Tracking(Mode.TRACK, Band(28.0, 62.0), 30.0, 60.0, 0.4, 0.0, 2.0, (Layer(30.0, 60.0, -0.4, 1.0),))


def segment(**quantities: tuple[list[float], list[float]]) -> Segment:
    series = {name: Series(readonly(t), readonly(v)) for name, (t, v) in quantities.items()}
    return Segment(SegmentId(0.0, "electa", "electa-2022-1-1-1"), "", "sbd", 400.0, (0, 1, ""), series)


def advice(tracking: Tracking = TRACK, params: LayerParams = PARAMS, **quantities: object) -> LayerAdvice:
    return advise(tracking, segment(**quantities), 1e9, params)  # type: ignore[arg-type]


def test_the_band_within_all_depths() -> None:
    found = advice()
    assert (found.band, found.full, found.full_casts) == (Band(28.0, 62.0), Band(10.0, 200.0), 2)
    assert found.notes == ()


def test_not_nearer_to_the_bottom_than_the_altitude() -> None:
    found = advice(water_depth=([0.0, 9.0], [65.0, 60.0]))
    assert found.full.bottom == 50.0
    assert found.band == Band(28.0, 50.0)
    assert found.notes == ("the bottom was at 60 m", "it would go to 62 m")


def test_a_wrong_echo_in_ten_does_not_count() -> None:
    times = [float(i) for i in range(20)]
    assert advice(water_depth=(times, [20.0, *[60.0] * 19])).full.bottom == 50.0
    assert advice(water_depth=(times, [*[20.0] * 5, *[60.0] * 15])).full.bottom == 10.0


def test_the_altimeter_tells_the_bottom_too() -> None:
    found = advice(altitude=([5.0], [15.0]), depth=([0.0, 10.0], [40.0, 50.0]))
    assert found.full.bottom == 50.0


def test_not_into_the_draught_of_ships() -> None:
    shallow = Tracking(Mode.TRACK, Band(0.0, 30.0), 2.0, 28.0, 0.4, 0.0, 2.0)
    assert advice(shallow).band == Band(10.0, 30.0)


def test_a_layer_out_of_reach_is_no_band() -> None:
    found = advice(water_depth=([0.0], [35.0]))
    assert (found.band, found.mode, found.full_casts) == (None, Mode.COMPLETE, 0)
    assert found.why == "the layer lies outside of the depths that may be flown"


def test_water_shallower_than_the_ships_has_a_depth_still() -> None:
    found = advice(water_depth=([0.0], [12.0]))
    assert found.full == Band(2.0, 2.0)


def test_a_segment_without_science_tells_nothing() -> None:
    assert after(TRACK, segment(), PARAMS) is None


def test_the_notice_of_a_surfacing_has_one_line() -> None:
    _, page = surfaced("electa", Surfaced(replace(SLOW, t_dive=1e9 - 100.0), None, None, (), advice()))
    (line,) = [row for row in page.text().splitlines() if "Fly next" in row]
    assert "28 to 62 m, after 2 casts from 10 to 200 m; temperature layer: 30 to 60 m (100%)" in line


def test_the_notice_says_where_there_is_no_layer_and_of_when_the_advice_is() -> None:
    found = advice(Tracking(Mode.RESET, why="its gradient fell to 38%"))
    _, page = surfaced("electa", Surfaced(replace(SLOW, t_dive=1e9 + 100.0), None, None, (), found))
    (line,) = [row for row in page.text().splitlines() if "Fly next" in row]
    assert "all depths, 10 to 200 m (reset: its gradient fell to 38%); no temperature layer" in line
    assert "[after the segment until 2001-09-09 01:46" in line


def test_mission_arguments_of_the_band_and_of_all_depths(tmp_path: Path) -> None:
    assert [p.name for p in write_yo("electa", advice(), tmp_path)] == [
        "electa-yo-full.ma",
        "electa-yo-band.ma",
    ]
    band = (tmp_path / "electa-yo-band.ma").read_text()
    assert band.startswith("behavior_name=yo\n")
    for line in ("d_target_depth(m)             62", "c_target_depth(m)             28",
                 "d_target_altitude(m)          10", "num_half_cycles_to_do(nodim)  -1"):  # fmt: skip
        assert f"b_arg: {line}\n" in band
    assert "num_half_cycles_to_do(nodim)  2\n" in (tmp_path / "electa-yo-full.ma").read_text()


def test_what_is_not_advised_any_more_is_removed(tmp_path: Path) -> None:
    write_yo("electa", advice(), tmp_path)
    write_yo("electa", advice(Tracking(Mode.RESET, why="no layer")), tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["electa-yo-full.ma"]


def test_without_full_casts_there_is_the_band_alone() -> None:
    alone = LayerParams("temperature", 200.0, 10.0, 10.0, Method.COMPOSITE, 0)
    assert yo_arguments("electa", advice(params=alone)).keys() == {"band"}


def test_a_folder_that_cannot_be_written_says_what_to_do(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(GliderwatchError, match=r"gliders\.electa\.layers\.outputs"):
        write_yo("electa", advice(), tmp_path / "file")


def test_depths_are_rounded_away_from_the_layer() -> None:
    found = yo_arguments("electa", advice(Tracking(Mode.TRACK, Band(28.7, 62.1), 30.0, 60.0)))["band"]
    assert "d_target_depth(m)             63\n" in found
    assert "c_target_depth(m)             28\n" in found


def test_half_a_metre_of_bottom_is_kept() -> None:
    """Rounding must not lead below what the altitude above the bottom leaves."""
    found = advice(water_depth=([0.0], [60.4]))
    assert found.full.bottom == pytest.approx(50.4)
    depth = [line for line in yo_arguments("electa", found)["full"].splitlines() if "d_target_depth" in line]
    assert int(depth[0].split()[-1]) <= 50.4
    assert np.isfinite(found.full.bottom)
