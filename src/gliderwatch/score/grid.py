"""What to run: every fault in every size and sea, healthy gliders in every sea; estimators by name."""

from __future__ import annotations

import re
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import msgspec

import gliderwatch.config
from gliderwatch.config import Config, load
from gliderwatch.config.document import nearest, read
from gliderwatch.config.loading import presets_path
from gliderwatch.errors import ConfigError, GliderwatchError
from gliderwatch.score.graft import Graft, GraftKind
from gliderwatch.score.measures import HEALTHY
from gliderwatch.score.sensors import LEFT_OUT, cadence_without
from gliderwatch.simulate.scenario import SIZES, Fault, FaultKind, Scenario
from gliderwatch.simulate.scenario_files import find, load_scenario, shipped
from gliderwatch.simulate.seas import SEAS, sea_mission

# ----------------------------------------
# The estimators that can be scored, by name, and the settings that choose them.

ALGORITHMS = ("joint", "adaptive")
"""The values of `estimator:`, the default first."""


def estimators() -> list[str]:
    """All names: those of the algorithms with default settings, and `adaptive:PRESET`."""
    return [*ALGORITHMS, *(f"adaptive:{name}" for name in read(presets_path()).data)]


def check(name: str) -> str:
    """The name itself. Raises GliderwatchError where there is no such estimator."""
    names = estimators()
    if name not in names:
        raise GliderwatchError(f"there is no estimator {name}; known are: {', '.join(names)}")
    return name


@cache
def configuration(name: str, glider: str, low: float, high: float) -> Config:
    """The configuration of one glider with an estimator.

    `joint` learns the normal range of speed as it does where the configuration says nothing; the others are
    given it (m/s), as good as a pilot could know it. It is read from a file as the pilot's own, so that the
    score knows no setting that a pilot cannot make. Raises GliderwatchError where there is no such estimator.
    """
    settings = settings_of(name)
    if settings["estimator"] != "joint":
        settings["normal_speed"] = {"min": round(low, 4), "max": round(high, 4)}
    return configured(glider, settings)


def settings_of(name: str) -> dict[str, Any]:
    """What a configuration says of a glider with an estimator, `joint` or `adaptive:PRESET`, say. Raises
    GliderwatchError where there is no such estimator."""
    algorithm, _, preset = check(name).partition(":")
    return {"estimator": algorithm} | ({"preset": preset} if preset else {})


def configured(glider: str, settings: Mapping[str, Any]) -> Config:
    """The configuration of one glider with some settings, read from a file as a pilot's own."""
    document = {"dockserver": {"roots": ["."]}, "gliders": {glider: settings}}
    with TemporaryDirectory(prefix="gliderwatch-") as folder:
        path = Path(folder) / "gliderwatch.yml"
        path.write_bytes(msgspec.json.encode(document))  # JSON is YAML
        return load(path)


# ----------------------------------------
# What to run: every fault in every size and sea, and healthy gliders in every sea.

DAY = 86400.0
Sizes = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Healthy:
    """Gliders without a fault: the scenarios, how many gliders in each, how many days each flies."""

    seas: tuple[str, ...] = ("calm",)
    gliders: int = 2
    days: float = 28.0


@dataclass(frozen=True, slots=True)
class Sensors:
    """Lists of sensors: gliders in ``seas``, and real missions, are run once more without each of
    ``left_out`` (names of `score.sensors.LEFT_OUT`)."""

    seas: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Grid:
    """A file of `config/score`.

    ``faults`` are the sizes of each fault (`simulate.faults.SIZES`), put into each of ``seas`` (scenarios
    whose own faults are left out, or kinds of `simulate.seas.SEAS`) with ``gliders`` gliders each; they fly
    ``days``, the fault begins on day ``onset``. ``normal`` bounds the normal range of speed as parts of the
    median speed that the glider itself believed while healthy: what a pilot sets from its first days.
    ``grafts`` are the faults put onto real missions; ``sensors`` says without which all is run once more.
    """

    seas: tuple[str, ...] = ()
    faults: Mapping[FaultKind, Sizes] = field(default_factory=dict)
    gliders: int = 2
    days: float = 10.0
    onset: float = 5.0
    normal: tuple[float, float] = (0.7, 1.3)
    healthy: Healthy = Healthy()
    grafts: Mapping[GraftKind, Sizes] = field(default_factory=dict)
    sensors: Sensors = Sensors()

    def __post_init__(self) -> None:
        if not 0 < self.normal[0] < self.normal[1]:
            raise ValueError("normal: the lower part is above 0 and below the upper one")
        if not 1 <= self.onset < self.days:
            raise ValueError("onset: a day of the mission, not before day 1")
        if self.gliders < 1 or self.healthy.gliders < 0 or self.healthy.days <= 0:
            raise ValueError("gliders: at least 1; healthy: 0 or more gliders for more than 0 days")
        for name in self.sensors.left_out:
            if name not in LEFT_OUT:
                raise ValueError(f"sensors: nothing is called {name} ({nearest(name, LEFT_OUT)})")
        for kind, sizes in self.faults.items():
            for size in sizes:
                Fault(kind, 0.0, size)
        for graft, sizes in self.grafts.items():
            for size in sizes:
                Graft(graft, size)


@dataclass(frozen=True, slots=True)
class Cell:
    """One glider to run: a simulated one by its ``scenario``, or a real one by its ``mission`` folder, with a
    fault grafted onto it or none, ``without`` some of its sensors (a name of `score.sensors.LEFT_OUT`)."""

    sea: str
    fault: str
    size: float
    seed: int
    normal: tuple[float, float]
    scenario: Scenario | None = None
    mission: Path | None = None
    graft: Graft | None = None
    without: str = ""

    @property
    def name(self) -> str:
        """Short, for people and names of files."""
        what = HEALTHY if self.fault == HEALTHY else f"{self.fault}-{self.size:g}"
        return f"{re.sub(r'[, ]+', '-', self.sea)}-{what}-{self.seed}"


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


class _StrictSensors(msgspec.Struct, forbid_unknown_fields=True):
    seas: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()


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
    sensors: _StrictSensors = msgspec.field(default_factory=_StrictSensors)

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
            Sensors(self.sensors.seas, self.sensors.left_out),
        )


def cells(grid: Grid, missions: tuple[Path, ...] = ()) -> list[Cell]:
    """All that is to run, in the order of the grid; the long ones first, so that no core waits at the end."""
    names = dict.fromkeys((*grid.healthy.seas, *grid.seas, *grid.sensors.seas))
    seas = {name: _sea(name) for name in names}
    blind = [(sea, without) for sea in grid.sensors.seas for without in grid.sensors.left_out]
    found = [
        _cell(seas[sea], sea, without, HEALTHY, 0.0, seed, grid)
        for sea, without in (*((sea, "") for sea in grid.healthy.seas), *blind)
        for seed in range(grid.healthy.gliders)
    ]
    for mission in missions:
        for without in ("", *grid.sensors.left_out):
            found += _real(mission.resolve(), without, grid)
    found += [
        _cell(seas[sea], sea, without, str(kind), size, seed, grid)
        for kind, sizes in grid.faults.items()
        for size in sizes
        for sea, without in (*((sea, "") for sea in grid.seas), *blind)
        for seed in range(grid.gliders)
    ]
    return found


def _real(mission: Path, without: str, grid: Grid) -> list[Cell]:
    """A real mission without some sensors, as it is and with each graft."""
    label = _label(mission.name if mission.name != "from-glider" else mission.parent.name, without)
    return [
        Cell(label, HEALTHY, 0.0, 0, grid.normal, mission=mission, without=without),
        *(
            Cell(label, str(kind), size, 0, grid.normal, None, mission, Graft(kind, size), without)
            for kind, sizes in grid.grafts.items()
            for size in sizes
        ),
    ]


def _label(name: str, without: str) -> str:
    return f"{name}, no {without}" if without else name


def _sea(name: str) -> Callable[[int], Scenario]:
    """The mission in a sea by its chance: always one scenario, or a new one of a kind of sea. Raises
    ConfigError where there is neither."""
    if name in SEAS:
        return partial(sea_mission, name)
    if name not in shipped() and not Path(name).is_file():
        near = nearest(name, (*shipped(), *SEAS))
        raise ConfigError(
            f"there is no scenario {name}, no such kind of sea, nor a file of that name ({near})"
        )
    scenario = load_scenario(find(name))
    return lambda chance: scenario


def _cell(
    mission: Callable[[int], Scenario], sea: str, without: str, fault: str, size: float, seed: int, grid: Grid
) -> Cell:
    """A glider that shares its chance with those of other sizes of the fault and of fewer sensors, and with
    no other."""
    chance = zlib.crc32(f"{sea}/{fault}/{seed}".encode())
    base = mission(chance)
    faults: tuple[Fault, ...] = ()
    if fault != HEALTHY:
        kind = FaultKind(fault)
        faults = (Fault(kind, base.start + grid.onset * DAY, size, SIZES[kind].ramp),)
    scenario = replace(
        base,
        seed=chance,
        glider="score",
        days=grid.healthy.days if fault == HEALTHY else grid.days,
        faults=faults,
        full_rate=False,
        science={},
        cadence=cadence_without(base.cadence, LEFT_OUT[without] if without else ()),
    )
    return Cell(_label(sea, without), fault, size, seed, grid.normal, scenario, without=without)
