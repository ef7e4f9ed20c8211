"""When something began, by what a glider measured within its dives."""

from __future__ import annotations

import numpy as np
import pytest

from gliderwatch.archive.onset import onset
from gliderwatch.model import Series

DAY = 86400.0


def flown(began: float, *, slower: float = 1.0, roll: float = 0.0) -> dict[str, Series]:
    """Two days of yos to 30 m, measured each 4 s; from a time on (s) slower, or with a roll (rad)."""
    rng, t = np.random.default_rng(5), np.arange(0.0, 2 * DAY, 4.0)
    rate = 0.15 * np.where(t < began, 1.0, slower) + 0.004 * np.sin(t / 7000.0)
    way = np.cumsum(rate * 4.0) % 60.0
    down = way < 30.0
    depth = np.where(down, way, 60.0 - way) + 0.04 * rng.standard_normal(len(t))
    pitch = np.where(down, -0.45, 0.45) + 0.01 * rng.standard_normal(len(t))
    rolled = np.where(t < began, 0.0, roll) + 0.02 * rng.standard_normal(len(t))
    return {"depth": Series(t, depth), "pitch": Series(t, pitch), "roll": Series(t, rolled)}


@pytest.mark.parametrize(
    ("slower", "roll", "names"),
    [
        (0.8, 0.0, {"sinking", "climbing"}),
        (1.0, 0.05, {"roll"}),
        (0.8, 0.05, {"sinking", "climbing", "roll"}),
    ],
)
def test_a_step_is_found_within_minutes(slower: float, roll: float, names: set[str]) -> None:
    began = 1.1 * DAY + 1234.0
    found = onset(flown(began, slower=slower, roll=roll), until=1.4 * DAY)
    assert found is not None
    assert abs(found.t - began) < 300.0
    assert found.earliest <= found.t <= found.latest
    assert found.earliest - 300.0 < began < found.latest + 300.0
    assert {step.name for step in found.steps} == names
    by_name = {step.name: step for step in found.steps}
    if "roll" in names:
        assert by_name["roll"].after - by_name["roll"].before == pytest.approx(roll, abs=0.005)
    if "sinking" in names:
        assert by_name["sinking"].after / by_name["sinking"].before == pytest.approx(slower, abs=0.05)


def test_a_flight_without_a_step_has_no_onset() -> None:
    assert onset(flown(np.inf), until=1.4 * DAY) is None


def test_what_comes_after_it_was_seen_is_no_onset_of_it() -> None:
    found = onset(flown(1.6 * DAY, roll=0.05), until=1.4 * DAY)
    assert found is None or found.t <= 1.4 * DAY


def test_files_without_depth_or_pitch_tell_nothing() -> None:
    assert onset({}, until=DAY) is None
    assert onset({"roll": flown(DAY)["roll"]}, until=1.4 * DAY) is None
