"""Scenarios as YAML: where they are, and how one becomes a `Scenario`.

The keys are the fields of `Scenario` and of the values in it, in the same units. What differs is
what a person writes otherwise: `start` is a date, a fault begins on a `day` and grows over
`ramp_days`, `variation` may be left out (it is then that of the World Magnetic Model), and
`cadence` and `science` change the usual lists of sensors; null takes a sensor out.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from datetime import UTC, datetime
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, create_model

import gliderwatch.config
from gliderwatch.config.document import Document, Problem, nearest, read
from gliderwatch.errors import ConfigError
from gliderwatch.simulate.dinkum import Generation
from gliderwatch.simulate.scenario import SIZES, Fault, FaultKind, Scenario
from gliderwatch.simulate.telemetry import CADENCE, SCIENCE_CADENCE
from gliderwatch.slocum.sensors import model_declination

DAY = 86400.0
USUAL = "calm"
"""The scenario that is taken where none is named."""

_WORDS = {
    "extra_forbidden": "unknown key",
    "unexpected_keyword_argument": "unknown key",
    "missing": "is missing",
    "float_type": "must be a number",
    "float_parsing": "must be a number",
    "int_type": "must be a whole number",
    "int_parsing": "must be a whole number",
    "bool_parsing": "must be true or false",
    "string_type": "must be text",
    "tuple_type": "must be a list",
    "dataclass_type": "must be a section (`key: value` lines below it)",
    "model_type": "must be a section (`key: value` lines below it)",
    "datetime_from_date_parsing": "must be a date and time, as 2024-05-01T00:00:00Z",
    "datetime_parsing": "must be a date and time, as 2024-05-01T00:00:00Z",
}


class FaultLine(BaseModel):
    """A fault as it is written: what it is, on which day of the mission it begins, its size."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    kind: FaultKind
    day: float = Field(ge=0)
    size: float
    ramp_days: float | None = Field(default=None, ge=0)

    def fault(self, start: float) -> Fault:
        """The fault on a mission that begins at ``start`` (s). Raises ValueError for an impossible size."""
        ramp = SIZES[self.kind].ramp if self.ramp_days is None else self.ramp_days * DAY
        return Fault(self.kind, start + self.day * DAY, self.size, ramp)


def fault_line(text: str) -> FaultLine:
    """A fault given in short, `NAME:SIZE@DAY`. Raises `ConfigError` where it is none.

    >>> fault_line("remora:2.5@3")
    FaultLine(kind=<FaultKind.REMORA: 'remora'>, day=3.0, size=2.5, ramp_days=None)
    """
    name, _, rest = text.partition(":")
    size, _, day = rest.partition("@")
    if name not in list(FaultKind):
        raise ConfigError(f"fault {text}: there is no fault {name} ({nearest(name, list(FaultKind))})")
    try:
        line = FaultLine.model_validate({"kind": name, "size": size, "day": day})
        line.fault(0.0)
    except ValidationError:
        raise ConfigError(f"fault {text}: not NAME:SIZE@DAY, as in remora:2.5@3") from None
    except ValueError as error:
        raise ConfigError(f"fault {text}: {error}") from None
    return line


def _generation(value: object) -> object:
    if isinstance(value, str) and value in Generation.__members__:
        return Generation[value]
    raise ValueError(f"must be {' or '.join(Generation.__members__)}")


_Sensors = dict[str, float | None]
_OTHERWISE: dict[str, Any] = {
    "about": (str, ""),
    "start": (datetime | None, None),
    "variation": (float | None, None),
    "faults": (tuple[FaultLine, ...], ()),
    "cadence": (_Sensors, {}),
    "science": (_Sensors | None, {}),
    "generation": (Annotated[Generation, BeforeValidator(_generation)], Generation.G3),
}
_NOT_WRITTEN = {"member", "origin"}
_PLAIN = Scenario()


def _file_model() -> type[BaseModel]:
    """What a file may hold: the fields of `Scenario`, but for those that are written otherwise."""
    hints = get_type_hints(Scenario)
    keys = {
        each.name: (hints[each.name], getattr(_PLAIN, each.name))
        for each in fields(Scenario)
        if each.name not in _NOT_WRITTEN
    }
    config = ConfigDict(extra="forbid", allow_inf_nan=False, arbitrary_types_allowed=True)
    model: type[BaseModel] = create_model("ScenarioFile", __config__=config, **(keys | _OTHERWISE))
    return model


_FILE = _file_model()


def folder() -> Path:
    """Where the shipped scenarios are: beside `gliderwatch.config` in a wheel, in `config/` of a checkout."""
    installed = Path(gliderwatch.config.__file__).with_name("scenarios")
    return installed if installed.is_dir() else Path(__file__).parents[3] / "config" / "scenarios"


def shipped() -> dict[str, Path]:
    """The scenarios that come with the program, by name."""
    return {path.stem: path for path in sorted(folder().glob("*.yml"))}


def find(name: str) -> Path:
    """The file of a scenario, given by the name of a shipped one or by path.

    Raises `ConfigError` where there is none.
    """
    scenarios = shipped()
    if name in scenarios:
        return scenarios[name]
    if Path(name).is_file():
        return Path(name)
    raise ConfigError(f"there is no scenario {name}, nor a file of that name ({nearest(name, scenarios)})")


def load_scenario(path: Path) -> Scenario:
    """Read a scenario.

    Raises `ConfigError` with one line for each problem, `FILE:LINE: key: what is wrong (cure)`.
    """
    document = read(path)
    problems, scenario = list(document.problems), None
    try:
        scenario = _scenario(_FILE.model_validate(document.data or {}))
    except ValidationError as error:
        problems += _explain(error, document)
    except ValueError as error:
        problems.append(_at_first_known_word(str(error), document))
    if scenario is None or problems:
        raise ConfigError("\n".join(map(str, problems)))
    return scenario


def _scenario(file: Any) -> Scenario:
    values = {
        each.name: getattr(file, each.name) for each in fields(Scenario) if each.name not in _NOT_WRITTEN
    }
    start = _PLAIN.start if file.start is None else _utc(file.start)
    values["start"] = start
    values["faults"] = tuple(line.fault(start) for line in file.faults)
    values["cadence"] = _changed(CADENCE, file.cadence)
    values["science"] = {} if file.science is None else _changed(SCIENCE_CADENCE, file.science)
    if file.variation is None:
        values["variation"] = -model_declination(file.place.lat, file.place.lon, start)[0]
    return Scenario(**values)


def _utc(time: datetime) -> float:
    return (time if time.tzinfo else time.replace(tzinfo=UTC)).timestamp()


def _changed(usual: Mapping[str, float], given: Mapping[str, float | None]) -> dict[str, float]:
    return {name: period for name, period in {**usual, **given}.items() if period is not None}


def _explain(error: ValidationError, document: Document) -> Iterator[Problem]:
    """The findings of pydantic in the user's words."""
    for found in error.errors(include_url=False):
        kind, parts = found["type"], [str(part) for part in found["loc"]]
        text = _WORDS.get(kind) or found["msg"].removeprefix("Value error, ").replace("Input should", "must")
        cure = ""
        if _WORDS.get(kind) == "unknown key":
            cure = nearest(parts[-1], _known_keys(parts[:-1]))
        yield document.error(parts, text, cure)


def _at_first_known_word(text: str, document: Document) -> Problem:
    """A problem that a value found in itself, at the first key that its words name."""
    for word in re.findall(r"\w+", text):
        for key in document.lines:
            if key.rpartition(".")[2] == word:
                return document.error(key.split("."), text)
    return document.error((), text)


def _known_keys(parts: Sequence[str]) -> list[str]:
    """The keys that may stand at a place."""
    kind: Any = _FILE
    for part in parts:
        kind = _within(kind, part)
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return list(kind.model_fields)
    return [each.name for each in fields(kind)] if is_dataclass(kind) else []


def _within(kind: Any, part: str) -> Any:
    """The type of what stands at a key or an index of a type."""
    if part.isdigit():
        return _plain(get_args(kind)[0])
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return _plain(kind.model_fields[part].annotation)
    return _plain(get_type_hints(kind)[part]) if is_dataclass(kind) else NoneType


def _plain(kind: Any) -> Any:
    """A type without `| None`."""
    if get_origin(kind) in (Union, UnionType):
        return next(each for each in get_args(kind) if each is not NoneType)
    return kind
