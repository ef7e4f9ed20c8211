"""`gliderwatch simulate`: the tree that it writes, the truth beside it, and playing as time passes."""

import json
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from gliderwatch.cli.main import main
from gliderwatch.simulate.job import write_truth
from gliderwatch.simulate.scenario import Mission

REMORA = ("--fault", "remora:2@0.5")


def run(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["simulate", *map(str, arguments)])


def tree(folder: Path) -> dict[str, tuple[bytes, int]]:
    """Content and time of every file, by its place; the time only of what the glider dates."""
    return {
        str(path.relative_to(folder)): (
            path.read_bytes(),
            path.stat().st_mtime_ns * ("from-glider" in path.parts),
        )
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("simulated") / "out"
    result = run(folder, "--days", 1, "--gliders", 2, *REMORA, "--full-rate")
    assert result.exit_code == 0, result.output
    assert "of 2 gliders" in result.output
    return folder


def test_it_writes_a_dockserver_its_caches_and_the_truth(out: Path) -> None:
    assert sorted(path.name for path in out.iterdir()) == [
        "cache",
        "gliders",
        "recovered",
        "truth.json",
        "truth.nc",
    ]
    for name in ("sim-01", "sim-02"):
        kinds = {path.suffix for path in (out / "gliders" / name / "from-glider").iterdir()}
        assert kinds == {".sbd", ".tbd"}
        assert {path.suffix for path in (out / "recovered" / name).iterdir()} == {".dbd", ".ebd"}
    assert {path.suffix for path in (out / "cache").iterdir()} == {".cac"}


def test_compressed_files_have_their_own_suffixes(tmp_path: Path) -> None:
    assert run(tmp_path / "out", "--days", 0.3, "--compressed", "--full-rate").exit_code == 0
    suffixes = {path.suffix for path in (tmp_path / "out").rglob("sim-*") if path.is_file()}
    assert suffixes == {".scd", ".tcd", ".dcd", ".ecd"}


def test_the_same_seed_gives_the_same_bytes(out: Path, tmp_path: Path) -> None:
    for seed, same in ((1, True), (2, False)):
        again = tmp_path / str(seed)
        run(again, "--days", 1, "--gliders", 2, *REMORA, "--full-rate", "--seed", seed)
        assert (tree(again) == tree(out)) is same
    rough = [tmp_path / name for name in ("a", "b")]
    for folder in rough:
        run(folder, "--scenario", "rough_data", "--days", 3)
    assert tree(rough[0]) == tree(rough[1])


def test_truth_tells_the_faults_with_their_onset(out: Path) -> None:
    first, second = json.loads((out / "truth.json").read_text())["gliders"]
    assert second["faults"] == []
    assert first["faults"] == [
        {
            "kind": "remora",
            "onset": "2024-05-01T12:00:00Z",
            "onset_seconds": 1714564800.0,
            "size": 2.0,
            "ramp_seconds": 0.0,
        }
    ]
    assert first["dives"] > 5


def test_truth_is_netcdf_by_the_conventions(out: Path) -> None:
    import netCDF4

    with netCDF4.Dataset(out / "truth.nc") as file:
        assert file.Conventions == "CF-1.11"
        assert file.featureType == "trajectory"
        names = netCDF4.chartostring(file["glider_name"][:]).tolist()
        assert names == ["sim-01", "sim-02"]
        rows = file["row_size"][:]
        assert rows.sum() == len(file.dimensions["dive"]) > 12
        assert file["row_size"].sample_dimension == "dive"
        assert file["glider_name"].cf_role == "trajectory_id"
        for variable in file.variables.values():
            assert hasattr(variable, "long_name") or variable.name == "time_bounds"
        assert file["time"].units == "seconds since 1970-01-01T00:00:00Z"
        assert np.all(np.diff(file["time_bounds"][:], axis=1) > 3600)
        np.testing.assert_array_equal(file["time_bounds"][:, 1], file["time"][:])
        hurt = (
            file["faults"][:]
            & file["faults"].flag_masks[file["faults"].flag_meanings.split().index("remora")]
        )
        expected = (np.arange(len(hurt)) < rows[0]) & (file["time"][:] > 1714564800.0)
        np.testing.assert_array_equal(hurt > 0, expected)
        assert file["speed"][:][hurt > 0][1:].max() < 0.18 < file["speed"][:][hurt == 0].min()


def test_truth_of_a_glider_that_reports_no_current(tmp_path: Path, out: Path) -> None:
    from dataclasses import replace

    from gliderwatch.simulate.glider import simulate
    from gliderwatch.simulate.scenario import Scenario

    mission = simulate(Scenario(days=0.3))
    bare = Mission(
        mission.scenario, mission.segments, tuple(replace(d, reported=None) for d in mission.truth)
    )
    table, _ = write_truth(tmp_path, [bare])
    import netCDF4

    with netCDF4.Dataset(table) as file:
        assert np.all(np.isnan(file["reported_u"][:].filled(np.nan)))


def test_files_carry_the_time_of_the_glider(tmp_path: Path) -> None:
    run(tmp_path / "out", "--days", 0.5)
    times = {path.stat().st_mtime for path in (tmp_path / "out" / "gliders").rglob("*.sbd")}
    assert all(1714521600 < t < 1714521600 + 86400 for t in times)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--speedup", 2), "--speedup goes with --live"),
        (("--scenario", "clam"), "did you mean `calm`?"),
        (("--fault", "shark_strik:1@2"), "did you mean `shark_strike`?"),
        (("--fault", "net:3@2"), "the part of all motion that is lost, 0 to 0.98"),
        (("--gliders", 0), "1<=x<=100"),
        (("--days", "nan"), "nan is not a number with an end"),
        (("--days", 0.3, "--live", "--speedup", "nan"), "nan is not a number with an end"),
        (("--days", 0.3, "--scenario", "steep.yml"), "cannot fly this scenario"),
    ],
)
def test_mistakes_are_told(
    arguments: tuple[object, ...], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    fault = "faults: [{kind: remora, day: 0, size: 12}]"
    Path("steep.yml").write_text(f"pitch: 0.2\npitch_sigma: 0\n{fault}\n")
    result = run("out", *arguments)
    assert result.exit_code == 2
    assert said in " ".join(result.output.split())
    assert not Path("out").exists()


def test_a_folder_with_something_in_it_is_left_alone(out: Path) -> None:
    before = tree(out)
    result = run(out)
    assert result.exit_code == 2
    assert "is not empty" in result.output
    assert tree(out) == before


# --------------------------------------------------------------------------- live


def test_live_files_come_as_time_passes(tmp_path: Path) -> None:
    """A quarter of a day at 86400 times the speed of time: files come within a fraction of a second."""
    folder, seen = tmp_path / "out", []
    (folder / "gliders").mkdir(parents=True)
    (folder / "gliders" / "in-use").touch()
    done = threading.Event()

    def watch() -> None:
        while not done.is_set():
            seen.append(len(list(folder.rglob("*.?bd"))))
            time.sleep(0.005)

    watcher = threading.Thread(target=watch)
    watcher.start()
    began = time.monotonic()
    result = run(folder, "--days", 1, "--live", "--speedup", 43200)
    took = time.monotonic() - began
    done.set()
    watcher.join()
    assert result.exit_code == 0, result.output
    assert 2.0 < took < 30.0
    assert len(set(seen)) > 6
    assert seen == sorted(seen)
    batch = tmp_path / "batch"
    run(batch, "--days", 1)
    live = tree(folder)
    del live["gliders/in-use"]
    assert live == tree(batch)
