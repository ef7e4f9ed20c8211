"""Every outcome of many missions, to the bit: a gate for changes that are to change none.

    python tests/golden/outcomes.py OUT [--only NAME ...]
    python tests/golden/outcomes.py --compare A B [--map tests/golden/renamed.yml] [--without alerts.body ...]
                                      [--within 1e-9]

The first writes the assessments, incidents, expected surfacings and alerts of each mission as lines of JSON
(keys sorted, floats by `repr`, so that equal lines are equal to the bit), and OUT/sha256.txt; it takes a
minute. The missions are the real ones of `../shared/data`, the cells of the score's small grid, and simulated
ones with rough data: those called `sim-...-sorted` are replayed, those called `sim-...-arriving` are taken as
their files come.

The second compares two such folders and ends with 1 where they differ. The map says what was renamed:

    keys: {evidence.old: new, old: null}    # the key where its path ends so; null: it is gone from A
    values: {old: new}                      # whole strings: kinds, reasons
    added: [evidence.new]                   # not compared: B alone has it
    factors: {evidence.old_h: 3600}         # A's value times this, compared to 12 digits (before `keys`)

`--within` lets numbers differ by this part of them: for a change of the order in which floats are added.
A path is the kind of line (assessments, incidents, expected, alerts) and the keys below it, without indices.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import zip_longest
from math import isclose
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import msgspec
from ruamel.yaml import YAML

from gliderwatch.config import Config, load
from gliderwatch.errors import GliderwatchError
from gliderwatch.score.grid import ALGORITHMS, Cell, cells, configuration, load_grid
from gliderwatch.service.replay import Request, replay
from gliderwatch.service.routing import routing_of
from gliderwatch.service.transaction import process_file
from gliderwatch.simulate.delivery import FileForm, Names, arrivals, deliver, from_glider, write_cache
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import SIZES, Fault, FaultKind, Mission, Rates, Scenario
from gliderwatch.simulate.scenario_files import find, load_scenario
from gliderwatch.slocum.decode import decode
from gliderwatch.store.state_file import File, Status, Store

SHARED_DATA = Path(__file__).resolve().parents[2].parent / "shared" / "data"
REAL = ("electa-2022", "usf-sam-2019", "george-2024", "osu-2025", "maria-2022")
KINDS = ("assessments", "incidents", "expected", "alerts")
DAY = 86400.0
DAYS, ONSET = 4.0, 2.0
"""Of a simulated mission: its length, and when its fault begins."""
ROUGH = Rates(
    lost=0.05,
    late=0.15,
    truncated=0.1,
    mended=0.6,
    resent=0.1,
    newest_first=0.5,
    growing=0.5,
    renamed=0.7,
    stale_fix=0.06,
    restart=0.05,
    dac_garbage=0.7,
    clock_skew=120.0,
)
FAULTS = {
    FaultKind.NONE: (0.0, 0.0),
    FaultKind.REMORA: (5.0, 2.5),
    FaultKind.FOULING: (6.0, 3.0),
    FaultKind.WING_LOSS: (0.6, 0.3),
    FaultKind.SHARK_STRIKE: (0.5, 0.3),
    FaultKind.NET: (0.9, 0.6),
    FaultKind.LEAK_OF_OIL: (0.7,),
    FaultKind.BALLAST: (0.7, 0.4),
    FaultKind.COMPASS: (1.0,),
    FaultKind.DAC_WRONG: (0.4, -0.3),
    FaultKind.STRONG_CURRENT: (0.5, 0.8),
}
"""The sizes of each fault that are flown, one mission each: 20."""
SEAS = ("calm", "rough_data", "tidal", "gulf_stream", "thruster")
"""The shipped scenarios that they are flown in, in turn."""
Line = dict[str, Any]


def outcomes(store: Store) -> Iterator[Line]:
    """All that a store holds of what missions came to, in the order of the store."""
    for glider in sorted(store.gliders()):
        for kind, found in (
            ("assessments", store.assessments(glider)),
            ("incidents", store.incidents(glider)),
            ("expected", store.forecasts(glider)),
        ):
            for each in found:
                yield {"kind": kind, "glider": glider, "value": msgspec.to_builtins(each)}
    for alert in store.alerts():
        yield {"kind": "alerts", "glider": alert.glider, "value": msgspec.to_builtins(alert)}


# --------------------------------------------------------------------------- missions


def missions() -> dict[str, Callable[[], Store]]:
    """All missions by name, each a function that runs it."""
    found: dict[str, Callable[[], Store]] = {}
    for name in REAL:
        if not (SHARED_DATA / name).is_dir():
            raise SystemExit(f"there is no {SHARED_DATA / name}: the gate needs the real missions")
        found[f"real-{name}"] = lambda name=name: _real(SHARED_DATA / name)
    for cell in cells(load_grid("small")):
        found[f"score-{cell.sea}-{cell.name}"] = lambda cell=cell: _score(cell)
    flown = [(kind, size) for kind, sizes in FAULTS.items() for size in sizes]
    for i, (kind, size) in enumerate(flown):
        way = "arriving" if i % 2 else "sorted"
        name = f"sim-{i:02d}-{kind}-{SEAS[i % len(SEAS)]}-{way}"
        found[name] = lambda i=i, kind=kind, size=size: _rough(i, kind, size)
    return found


def _real(folder: Path) -> Store:
    """As `gliderwatch run --replay FOLDER`."""
    return replay(Request((folder,))).store


def _score(cell: Cell) -> Store:
    assert cell.scenario is not None
    config = configuration(ALGORITHMS[0], cell.scenario.glider, 0.1, 1.0)
    return _replayed(simulate(cell.scenario), config)


def _rough(i: int, kind: FaultKind, size: float) -> Store:
    """The `i`-th simulated mission: every other one in the order of its files, the others as they come."""
    base = load_scenario(find(SEAS[i % len(SEAS)]))
    faults = (Fault(kind, base.start + ONSET * DAY, size, SIZES[kind].ramp / 4),)
    mission = simulate(_scenario(base, i, faults))
    config = _configuration(mission.scenario)
    return _arriving(mission, config) if i % 2 else _replayed(mission, config)


def _scenario(base: Scenario, i: int, faults: tuple[Fault, ...]) -> Scenario:
    rates = replace(ROUGH, clock_skew=ROUGH.clock_skew * (i % 3))
    return replace(base, seed=100 + i, days=DAYS, faults=faults, rates=rates, full_rate=False, science={})


def _configuration(scenario: Scenario) -> Config:
    """With surfacing notices and what a pilot says of silences, so that every kind of message is made."""
    document = {
        "dockserver": {"roots": ["."]},
        "gliders": {scenario.glider: {}},
        "defaults": {"overdue_hours": 6},
        "channels": {"nowhere": {"url": "json://localhost:9"}},
        "recipients": {"all": {"channels": ["nowhere"], "surfacing": [scenario.glider]}},
    }
    with TemporaryDirectory(prefix="gliderwatch-gate-") as folder:
        path = Path(folder) / "gliderwatch.yml"
        path.write_text(json.dumps(document), encoding="utf-8")  # JSON is YAML
        return load(path)


def _replayed(mission: Mission, config: Config) -> Store:
    """The files of a mission, as they are in the end, through a replay."""
    with TemporaryDirectory(prefix="gliderwatch-gate-") as name:
        folder = Path(name)
        write_cache(folder / "cache", mission)
        at = from_glider(folder / "gliders", mission)
        for arrival in arrivals(mission, FileForm(Names.AS_SENT, generation=mission.scenario.generation)):
            deliver(at / arrival.final_name, arrival.data)
        return replay(Request((folder / "gliders",), (folder / "cache",), config)).store


def _arriving(mission: Mission, config: Config) -> Store:
    """The files of a mission one by one as they come: late, cut and whole again, newest first."""
    store, said = Store.open(":memory:"), routing_of(config)
    with TemporaryDirectory(prefix="gliderwatch-gate-") as name:
        folder = Path(name)
        write_cache(folder / "cache", mission)
        for i, arrival in enumerate(arrivals(mission, FileForm(generation=mission.scenario.generation))):
            path = folder / str(i) / arrival.final_name
            deliver(path, arrival.data)
            try:
                segment = decode(path, [folder / "cache"])
            except GliderwatchError:
                continue  # cut before anything that can be read
            file = File(f"/{i}/{path.name}", 1, 1, Status.WAITING, segment.id.glider, segment.id.name)
            process_file(store, file, segment, config.glider(segment.id.glider), said, arrival.time)
    return store


# --------------------------------------------------------------------------- writing


def write(out: Path, only: list[str]) -> None:
    """Run all missions, or those whose names hold one of `only`, and write what they came to."""
    out.mkdir(parents=True, exist_ok=True)
    begun, hashes, counts = time.monotonic(), [], Counter[str]()
    for name, run in missions().items():
        if only and not any(part in name for part in only):
            continue
        store = run()
        lines = list(outcomes(store))
        store.close()
        data = b"".join(canonical(line) + b"\n" for line in lines)
        (out / f"{name}.jsonl").write_bytes(data)
        hashes.append(f"{hashlib.sha256(data).hexdigest()}  {name}.jsonl")
        counts.update(line["kind"] for line in lines)
        print(hashes[-1], flush=True)
    (out / "sha256.txt").write_text("\n".join(hashes) + "\n", encoding="utf-8")
    totals = ", ".join(f"{counts[kind]} {kind}" for kind in KINDS)
    print(f"{len(hashes)} missions, {totals}; {time.monotonic() - begun:.0f} s")


def canonical(line: Line) -> bytes:
    """One line, the same bytes for the same values."""
    return json.dumps(line, sort_keys=True, separators=(",", ":"), ensure_ascii=False).encode()


# --------------------------------------------------------------------------- comparing


@dataclass(frozen=True)
class Renamed:
    """What a map says (see above)."""

    keys: Mapping[str, str | None] = field(default_factory=dict)
    values: Mapping[str, str] = field(default_factory=dict)
    added: tuple[str, ...] = ()
    factors: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def read(cls, path: Path | None) -> Renamed:
        """The map of a file; none where there is no file."""
        if path is None:
            return cls()
        return msgspec.convert(YAML(typ="safe").load(path.read_text(encoding="utf-8")) or {}, cls)


def compare(a: Path, b: Path, renamed: Renamed, without: tuple[str, ...], within: float = 0.0) -> int:
    """Print what differs between two folders by more than `within` (part of a number); how many do."""
    names = sorted({path.name for folder in (a, b) for path in folder.glob("*.jsonl")})
    if not names:
        raise SystemExit(f"nothing to compare in {a} and {b}")
    different = 0
    for name in names:
        if not ((a / name).exists() and (b / name).exists()):
            print(f"{name}: only in {a if (a / name).exists() else b}")
            different += 1
            continue
        old = [_left(line, renamed, without) for line in _lines(a / name)]
        new = [_right(line, renamed, without) for line in _lines(b / name)]
        found = list(_differences(old, new, within))
        if found:
            different += 1
            print(f"{name}: {len(found)} differences in {len(old)} and {len(new)} lines")
            for each in found[:5]:
                print(f"  {each}")
            for path, n in Counter(each.partition(": ")[0].partition(" ")[2] for each in found).most_common(
                12
            ):
                print(f"  {n} x {path}")
    print(f"{len(names) - different} of {len(names)} missions are equal")
    return different


def _lines(path: Path) -> Iterator[Line]:
    return (json.loads(line) for line in path.read_text(encoding="utf-8").splitlines())


def _left(line: Line, renamed: Renamed, without: tuple[str, ...]) -> Line:
    """A line of A as it would be in B."""
    return {**line, "value": _mapped(line["value"], (line["kind"],), renamed, without)}


def _right(line: Line, renamed: Renamed, without: tuple[str, ...]) -> Line:
    """A line of B without what A cannot have, rounded where A's value was reckoned."""
    rounded = {
        ".".join([*path.split(".")[:-1], renamed.keys.get(path) or path.split(".")[-1]]): 1.0
        for path in renamed.factors
    }
    value = _mapped(line["value"], (line["kind"],), Renamed(factors=rounded), (*without, *renamed.added))
    return {**line, "value": value}


def _mapped(value: Any, path: tuple[str, ...], renamed: Renamed, without: Iterable[str]) -> Any:
    if isinstance(value, dict):
        out = {}
        for key, each in value.items():
            below = (*path, key)
            new = _of(renamed.keys, below, key)
            if new is not None and not any(_ends(below, part) for part in without):
                out[new] = _mapped(each, below, renamed, without)
        return out
    if isinstance(value, list):
        return [_mapped(each, path, renamed, without) for each in value]
    if isinstance(value, str):
        return renamed.values.get(value, value)
    factor = _of(renamed.factors, path, None)
    return value if factor is None or value is None else float(f"{value * factor:.12g}")


def _of(found: Mapping[str, Any], path: tuple[str, ...], usual: Any) -> Any:
    """The entry with the longest path that ends like this one."""
    fitting = [key for key in found if _ends(path, key)]
    return found[max(fitting, key=len)] if fitting else usual


def _ends(path: tuple[str, ...], ending: str) -> bool:
    parts = tuple(ending.split("."))
    return path[-len(parts) :] == parts


def _differences(old: Iterable[Line], new: Iterable[Line], within: float) -> Iterator[str]:
    """`LINE PATH: this, that`, one for each value that differs."""
    for i, (one, other) in enumerate(zip_longest(old, new), start=1):
        if one is None or other is None:
            yield f"{i} {(one or other)['kind']}: a line only in {'A' if other is None else 'B'}"
            continue
        if one["kind"] != other["kind"]:
            yield f"{i} kind: {one['kind']}, {other['kind']}"
            continue
        yield from (f"{i} {each}" for each in _unlike(one["value"], other["value"], one["kind"], within))


def _unlike(one: Any, other: Any, path: str, within: float) -> Iterator[str]:
    if isinstance(one, dict) and isinstance(other, dict):
        for key in sorted({*one, *other}):
            if key not in one or key not in other:
                yield f"{path}.{key}: only in {'A' if key in one else 'B'}"
            else:
                yield from _unlike(one[key], other[key], f"{path}.{key}", within)
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for a, b in zip(one, other, strict=True):
            yield from _unlike(a, b, path, within)
    elif isinstance(one, float) and isinstance(other, float) and isclose(one, other, rel_tol=within):
        return
    elif json.dumps(one) != json.dumps(other):  # NaN is like itself, 1 is not like 1.0
        yield f"{path}: {json.dumps(one)[:120]}, {json.dumps(other)[:120]}"


def main() -> None:
    """See above."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("out", nargs="?", type=Path)
    parser.add_argument(
        "--only", nargs="+", default=[], metavar="NAME", help="missions whose names hold this"
    )
    parser.add_argument("--compare", nargs=2, type=Path, metavar=("A", "B"))
    parser.add_argument("--map", type=Path, metavar="YAML")
    parser.add_argument("--without", nargs="+", default=[], metavar="PATH", help="as alerts.body")
    parser.add_argument("--within", type=float, default=0.0, metavar="PART", help="of a number, as 1e-9")
    asked = parser.parse_args()
    if asked.compare is not None:
        renamed, without = Renamed.read(asked.map), tuple(asked.without)
        sys.exit(1 if compare(*asked.compare, renamed, without, asked.within) else 0)
    if asked.out is None:
        parser.error("OUT or --compare A B")
    write(asked.out, asked.only)


if __name__ == "__main__":
    main()
