"""What to run: every fault in every size and sea, and healthy gliders in every sea."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import msgspec

import gliderwatch.config
from gliderwatch.config.document import read
from gliderwatch.config.problem import nearest
from gliderwatch.errors import ConfigError
from gliderwatch.score.graft import Graft, GraftKind
from gliderwatch.score.record import HEALTHY
from gliderwatch.simulate.faults import SIZES, Fault, FaultKind
from gliderwatch.simulate.scenario import Scenario
from gliderwatch.simulate.scenarios import find, load

DAY = 86400.0
Sizes = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Healthy:
    """Gliders without a fault: the scenarios, how many gliders in each, how many days each flies."""

    seas: tuple[str, ...] = ("calm",)
    gliders: int = 2
    days: float = 28.0


@dataclass(frozen=True, slots=True)
class Grid:
    """A file of `config/score`.

    ``faults`` are the sizes of each fault (`simulate.faults.SIZES`), put into each of ``seas`` (scenarios
    whose own faults are left out) with ``gliders`` gliders each; they fly ``days``, the fault begins on
    day ``onset``. ``normal`` bounds the normal range of speed as parts of the median speed that the
    glider itself believed while healthy: what a pilot sets from its first days. ``grafts`` are the
    faults put onto real missions.
    """

    seas: tuple[str, ...] = ()
    faults: Mapping[FaultKind, Sizes] = field(default_factory=dict)
    gliders: int = 2
    days: float = 10.0
    onset: float = 5.0
    normal: tuple[float, float] = (0.7, 1.3)
    healthy: Healthy = Healthy()
    grafts: Mapping[GraftKind, Sizes] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not 0 < self.normal[0] < self.normal[1]:
            raise ValueError("normal: the lower part is above 0 and below the upper one")
        if not 1 <= self.onset < self.days:
            raise ValueError("onset: a day of the mission, not before day 1")
        if self.gliders < 1 or self.healthy.gliders < 0 or self.healthy.days <= 0:
            raise ValueError("gliders: at least 1; healthy: 0 or more gliders for more than 0 days")
        for kind, sizes in self.faults.items():
            for size in sizes:
                Fault(kind, 0.0, size)
        for graft, sizes in self.grafts.items():
            for size in sizes:
                Graft(graft, size)


@dataclass(frozen=True, slots=True)
class Cell:
    """One glider to run: a simulated one by its ``scenario``, or a real one by its ``mission`` folder, with a
    fault grafted onto it or none."""

    sea: str
    fault: str
    size: float
    seed: int
    normal: tuple[float, float]
    scenario: Scenario | None = None
    mission: Path | None = None
    graft: Graft | None = None

    @property
    def name(self) -> str:
        """Short, for people and names of files."""
        what = HEALTHY if self.fault == HEALTHY else f"{self.fault}-{self.size:g}"
        return f"{self.sea}-{what}-{self.seed}"


def folder() -> Path:
    """Where the shipped grids are: beside `gliderwatch.config` in a wheel, in `config/` of a checkout."""
    installed = Path(gliderwatch.config.__file__).with_name("score")
    return installed if installed.is_dir() else Path(__file__).parents[3] / "config" / "score"


def load_grid(name: str) -> Grid:
    """A grid by the name of a shipped one or by path. Raises ConfigError with what is wrong with it."""
    shipped = {path.stem: path for path in sorted(folder().glob("*.yml"))}
    path = shipped.get(name, Path(name))
    if not path.is_file():
        raise ConfigError(f"there is no grid {name}, nor a file of that name ({nearest(name, shipped)})")
    document = read(path)
    if document.problems:
        raise ConfigError("\n".join(map(str, document.problems)))
    try:
        return msgspec.convert(document.data or {}, _Strict).grid()
    except (msgspec.ValidationError, ValueError) as error:
        raise ConfigError(f"{path}: {error}") from None


class _StrictHealthy(msgspec.Struct, forbid_unknown_fields=True):
    seas: tuple[str, ...] = Healthy().seas
    gliders: int = Healthy().gliders
    days: float = Healthy().days


class _Strict(msgspec.Struct, forbid_unknown_fields=True):
    """A file of a grid: what it holds, and nothing unknown."""

    about: str = ""
    seas: tuple[str, ...] = ()
    faults: dict[FaultKind, Sizes] = {}
    gliders: int = 2
    days: float = 10.0
    onset: float = 5.0
    normal: tuple[float, float] = (0.7, 1.3)
    healthy: _StrictHealthy = msgspec.field(default_factory=_StrictHealthy)
    grafts: dict[GraftKind, Sizes] = {}

    def grid(self) -> Grid:
        healthy = Healthy(self.healthy.seas, self.healthy.gliders, self.healthy.days)
        return Grid(
            self.seas,
            self.faults,
            self.gliders,
            self.days,
            self.onset,
            self.normal,
            healthy,
            self.grafts,
        )


def cells(grid: Grid, missions: tuple[Path, ...] = ()) -> list[Cell]:
    """All that is to run, in the order of the grid; the long ones first, so that no core waits at the end."""
    seas = {name: load(find(name)) for name in dict.fromkeys((*grid.healthy.seas, *grid.seas))}
    found = [
        _cell(seas[sea], sea, HEALTHY, 0.0, seed, grid.healthy.days, grid)
        for sea in grid.healthy.seas
        for seed in range(grid.healthy.gliders)
    ]
    real = [mission.resolve() for mission in missions]
    found += [Cell(_label(m), HEALTHY, 0.0, 0, grid.normal, mission=m) for m in real]
    found += [
        Cell(_label(m), str(kind), size, 0, grid.normal, mission=m, graft=Graft(kind, size))
        for m in real
        for kind, sizes in grid.grafts.items()
        for size in sizes
    ]
    found += [
        _cell(seas[sea], sea, str(kind), size, seed, grid.days, grid)
        for kind, sizes in grid.faults.items()
        for size in sizes
        for sea in grid.seas
        for seed in range(grid.gliders)
    ]
    return found


def _label(mission: Path) -> str:
    return mission.name if mission.name != "from-glider" else mission.parent.name


def _cell(base: Scenario, sea: str, fault: str, size: float, seed: int, days: float, grid: Grid) -> Cell:
    """A glider that shares its chance with those of other sizes of the fault, and with no other."""
    chance = zlib.crc32(f"{sea}/{fault}/{seed}".encode())
    faults: tuple[Fault, ...] = ()
    if fault != HEALTHY:
        kind = FaultKind(fault)
        faults = (Fault(kind, base.start + grid.onset * DAY, size, SIZES[kind].ramp),)
    scenario = replace(
        base, seed=chance, glider="score", days=days, faults=faults, full_rate=False, science={}
    )
    return Cell(sea, fault, size, seed, grid.normal, scenario)
