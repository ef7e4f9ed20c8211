"""Layers in the state file and in the notice: the way of a segment to the advice."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest

from acceptance.support import command
from gliderwatch.layers.advice import Layered, LayerParams
from gliderwatch.layers.band import Method, Mode
from gliderwatch.model import Segment, SegmentId, Series, readonly
from gliderwatch.params import GliderParams
from gliderwatch.service.layers import GliderLayers
from gliderwatch.service.transaction import process_file
from gliderwatch.store.state_file import File, Status, Store

LAYERS = GliderLayers(LayerParams("temperature", 150.0, 5.0, 10.0, Method.COMPOSITE, 2))
HOUR = 3600.0


def segment(n: int, top: float = 40.0) -> Segment:
    """Six casts to 100 m in three hours, through a layer of 20 m below `top` m; a sample each 10 s."""
    t = 1.7e9 + 3 * HOUR * n + np.arange(0.0, 3000.0, 10.0)
    z = 50.0 - 50.0 * np.cos(np.arange(len(t)) * 2 * np.pi / 100.0)
    warm = np.interp(z, [top, top + 20.0], [18.0, 10.0])
    quantities = {"science_pressure": 1.008e4 * z, "temperature": warm}
    series = {name: Series(readonly(t), readonly(v)) for name, v in quantities.items()}
    identity = SegmentId(float(t[0]), "unit_1", f"unit_1-2023-318-0-{n}")
    return Segment(identity, "", "sbd", float(t[-1]), (0, len(t), "a"), series, 0.0, "glider")


def take(segments: list[Segment], layers: GliderLayers | None = LAYERS) -> Store:
    store = Store.open(":memory:")
    for i, one in enumerate(segments):
        file = File(f"/{i}/{one.id.name}", 1, 1, Status.WAITING, one.id.glider, one.id.name)
        process_file(store, file, one, GliderParams(), None, 0.0, layers=layers)
    return store


def rows(store: Store) -> list[Layered]:
    """The newest first."""
    return [layered for _, layered in reversed(store.layers.segments("unit_1", 100))]


def test_layers_are_kept_with_each_segment() -> None:
    found = rows(take([segment(0), segment(1, 42.0)]))
    assert [x.advice.mode for x in found] == [Mode.TRACK] * 2
    newest = found[0].advice
    assert newest.band is not None
    assert newest.band.top < 42.0
    assert newest.band.bottom > 62.0
    assert newest.t == pytest.approx(1.7e9 + 3 * HOUR + 2990.0, abs=300.0)


def test_without_the_setting_nothing_is_kept() -> None:
    assert rows(take([segment(0)], None)) == []


def test_no_order_of_arrival_matters() -> None:
    segments = [segment(n, 40.0 + 3 * n) for n in range(4)]
    usual = rows(take(segments))
    assert len(usual) == 4
    for order in list(permutations(segments))[1::5]:
        assert rows(take(list(order))) == usual


def test_a_science_file_that_comes_late_is_learnt_from() -> None:
    first = segment(0)
    bare = replace(first, quantities={}, completeness=(0, 1, "b"))
    assert rows(take([bare, segment(1)])) == rows(take([segment(1)]))
    assert rows(take([bare, segment(1), first])) == rows(take([first, segment(1)]))


def test_another_sensor_begins_anew() -> None:
    store = take([segment(0)])
    other = GliderLayers(replace(LAYERS.params, sensor="oxygen"))
    file = File("/1/x", 1, 1, Status.WAITING, "unit_1", "unit_1-2023-318-0-1")
    late = segment(1)
    oxygen = replace(late, quantities={**late.quantities, "oxygen": late.get("temperature")})
    process_file(store, file, oxygen, GliderParams(), None, 0.0, layers=other)
    assert [x.advice.sensor for x in rows(store)] == ["oxygen", "temperature"]
    assert rows(store)[0].tracking.complete_t == rows(store)[0].advice.t


@pytest.mark.real
def test_a_replay_says_in_each_notice_how_deep_to_fly(shared_data: Path, tmp_path: Path) -> None:
    mission = shared_data / "usf-sam-2019"
    (tmp_path / "from-glider").mkdir()
    for path in (mission / "from-glider").glob("usf-sam-2019-251-4-[123][02468].?bd"):
        shutil.copy(path, tmp_path / "from-glider")
    (tmp_path / "gliderwatch.yml").write_text(f"""
dockserver: {{roots: [{mission}], cache: [{mission / "cache"}]}}
state: {{path: state.sqlite}}
gliders: {{usf-sam: {{layers: {{sensor: sci_flbbcd_chlor_units, max_depth: 60, outputs: out}}}}}}
channels: {{mail: {{url: "mailto://127.0.0.1:1?from=a@b.c&to=d@e.f"}}}}
recipients: {{pilots: {{channels: [mail], min_severity: info, surfacing: [usf-sam]}}}}
""")
    done = command("run", "--replay", "from-glider", "-c", "gliderwatch.yml", "--out", "results",
                   cwd=tmp_path)  # fmt: skip
    assert done.returncode == 0, done.stderr
    alerts = [json.loads(line) for line in (tmp_path / "results" / "alerts.jsonl").read_text().splitlines()]
    told = [alert["body"] for alert in alerts if "Fly next" in alert["body"]]
    assert len(told) >= 5
    assert "sci_flbbcd_chlor_units layer:" in told[-1]
