"""What is true of simulated missions, beside the files that came of them: `truth.nc` and `truth.json`."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from gliderwatch.simulate.calls import CallLog
from gliderwatch.simulate.delivery import make_calls
from gliderwatch.simulate.faults import FaultKind
from gliderwatch.simulate.scenario import DiveTruth, Mission

_FAULTS = [kind for kind in FaultKind if kind is not FaultKind.NONE]


class _Variable(NamedTuple):
    """One number of each dive: name, unit, standard name (CF) or none, what it is, how to get it."""

    name: str
    units: str
    standard: str
    about: str
    get: Callable[[DiveTruth], float]


_TIME = "seconds since 1970-01-01T00:00:00Z"
_VARIABLES = (
    _Variable("time", _TIME, "time", "surfacing at the end of the dive", lambda d: d.t_surface),
    _Variable("lat", "degrees_north", "latitude", "place of surfacing", lambda d: d.end.lat),
    _Variable("lon", "degrees_east", "longitude", "place of surfacing", lambda d: d.end.lon),
    _Variable("speed", "m s-1", "", "horizontal speed through the water", lambda d: d.speed),
    _Variable(
        "believed_speed", "m s-1", "", "what the glider took for that speed", lambda d: d.believed_speed
    ),
    _Variable("depth_rate", "m s-1", "", "mean magnitude of the depth rate", lambda d: d.depth_rate),
    _Variable("deepest", "m", "", "greatest depth", lambda d: d.deepest),
    _Variable(
        "through_water_u", "m s-1", "", "eastward velocity through the water", lambda d: d.through_water[0]
    ),
    _Variable(
        "through_water_v", "m s-1", "", "northward velocity through the water", lambda d: d.through_water[1]
    ),
    _Variable(
        "u", "m s-1", "eastward_sea_water_velocity", "mean current along the dive", lambda d: d.current[0]
    ),
    _Variable(
        "v", "m s-1", "northward_sea_water_velocity", "mean current along the dive", lambda d: d.current[1]
    ),
    _Variable(
        "reported_u", "m s-1", "", "eastward current that the glider published", lambda d: _reported(d)[0]
    ),
    _Variable(
        "reported_v", "m s-1", "", "northward current that the glider published", lambda d: _reported(d)[1]
    ),
)


def _reported(dive: DiveTruth) -> tuple[float, float]:
    return dive.reported if dive.reported is not None else (np.nan, np.nan)


def write_truth(
    folder: Path, missions: Sequence[Mission], logs: Mapping[str, Sequence[CallLog]] = MappingProxyType({})
) -> tuple[Path, Path]:
    """Write `truth.nc`, one row a dive, and `truth.json`, the faults, artefacts and calls; their paths.

    ``logs`` are those of the calls of each glider, where they are written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    table, facts = folder / "truth.nc", folder / "truth.json"
    _write_table(table, missions)
    gliders = [_facts(mission) | _calls(logs.get(mission.scenario.glider, ())) for mission in missions]
    text = json.dumps({"gliders": gliders}, indent=1)
    facts.write_text(text + "\n", encoding="utf-8")
    return table, facts


def _calls(logs: Sequence[CallLog]) -> dict[str, Any]:
    """What became of each call."""
    calls = [{"log": log.name, "begun_seconds": log.begun, "fate": str(log.fate)} for log in logs]
    return {"calls": calls} if calls else {}


def _write_table(path: Path, missions: Sequence[Mission]) -> None:
    """A contiguous ragged array of trajectories (CF 1.11, 9.3.3): a glider is one, a dive one row of it."""
    import netCDF4  # noqa: PLC0415 (slow to load, and only simulations need it)

    dives = [dive for mission in missions for dive in mission.truth]
    with netCDF4.Dataset(path, "w", format="NETCDF3_64BIT_OFFSET") as file:
        file.setncatts(
            {
                "Conventions": "CF-1.11",
                "featureType": "trajectory",
                "title": "What is true of simulated glider missions, one row a dive",
                "source": "gliderwatch simulate",
            }
        )
        file.createDimension("glider", len(missions))
        file.createDimension("dive", len(dives))
        file.createDimension("bounds", 2)
        _write_text(file, "glider_name", "glider", [m.scenario.glider for m in missions]).setncatts(
            {"long_name": "name of the glider", "cf_role": "trajectory_id"}
        )
        rows = file.createVariable("row_size", "i4", ("glider",))
        rows.setncatts({"long_name": "number of dives", "sample_dimension": "dive", "units": "1"})
        rows[:] = [len(mission.truth) for mission in missions]
        _write_text(file, "segment", "dive", [d.segment for d in dives]).setncatts(
            {"long_name": "full name of the segment of the dive", "coordinates": "time lat lon"}
        )
        for variable in _VARIABLES:
            _write_variable(file, variable, dives)
        _write_flags(file, dives)


def _write_text(file: Any, name: str, dimension: str, words: list[str]) -> Any:
    from netCDF4 import stringtochar  # noqa: PLC0415

    length = max(map(len, words), default=1)
    file.createDimension(f"{name}_length", length)
    variable = file.createVariable(name, "S1", (dimension, f"{name}_length"))
    variable[:] = stringtochar(np.array(words, dtype=f"S{length}"))
    return variable


def _write_variable(file: Any, variable: _Variable, dives: Sequence[DiveTruth]) -> None:
    made = file.createVariable(variable.name, "f8", ("dive",))
    made.setncatts({"units": variable.units, "long_name": variable.about})
    if variable.standard:
        made.standard_name = variable.standard
    made[:] = [variable.get(dive) for dive in dives]
    if variable.name == "time":
        made.setncatts({"calendar": "standard", "axis": "T", "bounds": "time_bounds"})
        bounds = file.createVariable("time_bounds", "f8", ("dive", "bounds"))
        bounds[:] = [(dive.t_dive, dive.t_surface) for dive in dives]
    elif variable.name not in {"lat", "lon"}:
        made.coordinates = "time lat lon"
        made.cell_methods = "time: maximum" if variable.name == "deepest" else "time: mean"


def _write_flags(file: Any, dives: Sequence[DiveTruth]) -> None:
    """Which faults had begun when a dive ended, as CF 3.5 has it: one bit each."""
    made = file.createVariable("faults", "i4", ("dive",))
    bits = {str(kind): 1 << i for i, kind in enumerate(_FAULTS)}
    made.setncatts(
        {
            "long_name": "faults that had begun",
            "flag_masks": np.array(list(bits.values()), dtype="i4"),
            "flag_meanings": " ".join(bits),
            "coordinates": "time lat lon",
        }
    )
    made[:] = [sum(bits.get(name, 0) for name in set(dive.faults)) for dive in dives]


def _facts(mission: Mission) -> dict[str, Any]:
    scenario, fates = mission.scenario, make_calls(mission).fates
    files: dict[str, list[str]] = {}
    for segment, fate in fates:
        files.setdefault(f"{segment.header.full_name}.{segment.header.extension}", []).append(fate)
    return {
        "glider": scenario.glider,
        "seed": scenario.seed,
        "start": _iso(scenario.start),
        "days": scenario.days,
        "variation": scenario.variation,
        "clock_skew": scenario.rates.clock_skew,
        "faults": [
            {
                "kind": fault.kind,
                "onset": _iso(fault.onset),
                "onset_seconds": fault.onset,
                "size": fault.size,
                "ramp_seconds": fault.ramp,
            }
            for fault in scenario.faults
        ],
        "dives": len(mission.truth),
        "artefacts": {d.segment: list(d.artefacts) for d in mission.truth if d.artefacts},
        "files": files,
    }


def _iso(t: float) -> str:
    return datetime.fromtimestamp(t, UTC).isoformat().replace("+00:00", "Z")
