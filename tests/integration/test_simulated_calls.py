"""Logs of simulated calls through the whole path: an abort is told once, and nothing on healthy gliders."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from gliderwatch.model import Alert, Kind
from gliderwatch.service.replay import Request, replay
from gliderwatch.simulate.calls import CallRates, Fate
from gliderwatch.simulate.job import Job, run
from gliderwatch.simulate.scenario import Scenario

TROUBLE = (Kind.ABORT, Kind.CALL, Kind.OVERDUE)


def alerts_of(folder: Path, seed: int, rates: CallRates, days: float = 4.0) -> tuple[list[Alert], list[str]]:
    """The messages of a replay about aborts, calls and silence, and the fates of the calls."""
    out = folder / str(seed)
    run(Job(out, [Scenario(seed=seed, glider="cora", days=days)], calls=rates))
    facts = json.loads((out / "truth.json").read_text(encoding="utf-8"))["gliders"][0]
    store = replay(Request((out / "gliders",), (out / "cache",))).store
    return [a for a in store.alerts() if a.kind in TROUBLE], [call["fate"] for call in facts["calls"]]


@pytest.mark.parametrize("cause", ["LEAK", pytest.param("OVERDEPTH", marks=pytest.mark.slow)])
def test_abort_is_told_once_within_one_surfacing(tmp_path: Path, cause: str) -> None:
    words = {"LEAK": "leak", "OVERDEPTH": "too deep"}[cause]
    for seed in range(4):
        rates = CallRates(garbled=0.01, abort=2.0, cause=cause)
        alerts, fates = alerts_of(tmp_path, seed, rates, days=3.0)
        told = [a for a in alerts if a.title == f"cora ABORTED: {words}"]
        assert len(told) == 1, [a.title for a in alerts]
        assert fates.count(Fate.ABORT) == 1 and fates.count(Fate.GLIDER_DOS) > 2
        assert {a.kind for a in alerts} == {Kind.ABORT}, "at its prompt it calls: it is not overdue"
        start = Scenario().start + 2 * 86400
        assert start <= told[0].time < start + 6 * 3600


@pytest.mark.slow
def test_nothing_is_told_of_healthy_gliders(tmp_path: Path) -> None:
    for seed in range(10):
        rates = CallRates(dropped=0.05, garbled=0.01)
        alerts, fates = alerts_of(tmp_path, seed, rates)
        assert [a.title for a in alerts] == []
        assert set(fates) <= {Fate.USUAL, Fate.DROPPED}


def test_glider_that_calls_without_files_is_told_and_not_overdue(tmp_path: Path) -> None:
    alerts, fates = alerts_of(tmp_path, 3, CallRates(no_file=1.0))
    assert set(fates) == {Fate.NO_FILE}
    assert {a.kind for a in alerts} == {Kind.CALL}
    some, fates = alerts_of(tmp_path, 4, replace(CallRates(), no_file=0.3))
    assert Fate.NO_FILE in fates and {a.kind for a in some} <= {Kind.CALL, Kind.ALL_CLEAR}
