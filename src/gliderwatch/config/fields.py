"""Types of single settings: what may stand there, paths among them, the base of all sections, and the section
`health`, made of the rules, each of which has its limits with it."""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Iterable
from datetime import UTC, datetime, time
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_origin
from zoneinfo import ZoneInfo, available_timezones

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainSerializer,
    SecretStr,
    StringConstraints,
    ValidationInfo,
    WithJsonSchema,
    create_model,
    model_validator,
)

from gliderwatch.config import secrets
from gliderwatch.health import rules
from gliderwatch.health.battery import END
from gliderwatch.health.constants import ENDS_AT
from gliderwatch.health.rule import Limit, Limits, Rule
from gliderwatch.model import Severity

# ----------------------------------------
# Folders that the settings name by path or pattern.


def absolute(path: str, info: ValidationInfo) -> str:
    """A path from the settings, made absolute: relative ones start at the folder of the file."""
    base = (info.context or {}).get("base")
    expanded = os.path.expanduser(path)  # noqa: PTH111 (of Path it raises where there is no home)
    return os.path.normpath(base / expanded) if base else expanded


def expand(patterns: Iterable[str]) -> list[Path]:
    """The folders or files that exist now for paths and glob patterns, each once, in order."""
    found: dict[Path, None] = {}
    for pattern in patterns:
        matches = [pattern] if os.path.lexists(pattern) else sorted(glob.glob(pattern))  # noqa: PTH207
        found.update(dict.fromkeys(map(Path, matches)))
    return list(found)


# ----------------------------------------
# The base of all sections of the settings. Pure but for pydantic.


def _may_be_empty(schema: dict[str, Any]) -> None:
    """In the JSON Schema too, what has no required keys may be left empty (`electa:`)."""
    required = schema.get("required", [])
    if not required:
        schema["type"] = ["object", "null"]
    for name, property_ in schema["properties"].items():
        if property_.get("type") in {"array", "object"} and name not in required:
            property_["type"] = [property_["type"], "null"]


class Section(BaseModel):
    """Base of all sections: frozen, unknown keys refused, inputs kept out of errors."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", hide_input_in_errors=True, json_schema_extra=_may_be_empty
    )

    @model_validator(mode="before")
    @classmethod
    def _empty_is_left_out(cls, data: object) -> object:
        """A section or list whose lines are all commented out counts as left out."""
        if data is None:
            return {}
        if not isinstance(data, dict):
            return data
        return {key: value for key, value in data.items() if value is not None or not cls._holds_more(key)}

    @classmethod
    def _holds_more(cls, key: str) -> bool:
        field = cls.model_fields.get(key)
        kind = field.annotation if field else None
        return get_origin(kind) in {dict, tuple} or (isinstance(kind, type) and issubclass(kind, Section))


# ----------------------------------------
# Types of single settings: what may stand there and how it reads in the JSON Schema.


def _severity(value: object) -> object:
    if isinstance(value, str) and value in {severity.name.lower() for severity in Severity}:
        return Severity[value.upper()]
    raise ValueError("must be info, warning or critical")


def _quieter(severity: Severity) -> Severity:
    if severity is Severity.CRITICAL:
        raise ValueError("must be info or warning: critical is for anomalies")
    return severity


def _louder(severity: Severity) -> Severity:
    if severity is Severity.INFO:
        raise ValueError("must be warning or critical: nothing is below info")
    return severity


_CLOCK = r"^([01]\d|2[0-3]):[0-5]\d$"


def _clock(value: object) -> object:
    if not isinstance(value, str) or not re.fullmatch(_CLOCK, value, re.ASCII):
        raise ValueError('must be a time of day, "00:00" to "23:59"')
    return time.fromisoformat(value)


def _zone(value: object) -> object:
    try:
        ZoneInfo(str(value))
    except (LookupError, ValueError, OSError):
        near = get_close_matches(str(value), available_timezones(), n=1)
        cure = f"did you mean {near[0]}?" if near else "write UTC, or a name as Europe/Amsterdam"
        raise ValueError(f"there is no such time zone ({cure})") from None
    return value


_MOMENT = r"^\d{4}-\d\d-\d\d([T ]\d\d:\d\d(:\d\d)?(Z|[+-]\d\d:\d\d)?)?$"


def _moment(value: object) -> object:
    """A date or a date with time as seconds since 1970; without a zone it is UTC."""
    if not isinstance(value, str) or not re.fullmatch(_MOMENT, value, re.ASCII):
        raise ValueError("must be a date (2026-12-01) or a date and time in UTC (2026-12-01 14:30)")
    try:
        moment = datetime.fromisoformat(value)
    except ValueError:
        raise ValueError(
            "is no date that exists: write 2026-12-01, or 2026-12-01 14:30 for a time in UTC"
        ) from None
    return (moment if moment.tzinfo is not None else moment.replace(tzinfo=UTC)).timestamp()


def moment(text: str) -> float:
    """A moment as a command is given one (s), written as in the configuration. Raises ValueError."""
    return float(str(_moment(text)))


def _url(value: object) -> object:
    if isinstance(value, dict):
        if set(value) != {"file"} or not isinstance(value["file"], str):
            raise ValueError("must be a URL or {file: PATH}")
        return f"${{file:{value['file']}}}"
    return value


def _switch(value: object) -> object:
    if not isinstance(value, bool):
        raise ValueError("must be true or false")
    return value


def _references(value: SecretStr) -> SecretStr:
    secrets.verify(value.get_secret_value())
    return value


# Strict: quoted numbers and `true` for 1 are mistakes. Bounds only refuse what cannot be meant.
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Count = Annotated[int, Field(strict=True, ge=1, le=100)]
_MADE = ("Conventions", "featureType", "geospatial_", "time_coverage_", "date_")


def _free(name: str) -> str:
    """The name of an attribute that gliderwatch does not make from what is in the file. Raises ValueError."""
    if name.startswith(_MADE):
        raise ValueError(f"{name} is made from what is in the file: leave it out")
    return name


Switch = Annotated[bool, BeforeValidator(_switch)]
Speed = Annotated[Number, Field(ge=0, le=5)]
AbsolutePath = Annotated[str, StringConstraints(min_length=1), AfterValidator(absolute)]
GliderName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$", to_lower=True)]
Name = Annotated[str, StringConstraints(pattern=r"^\w[\w .-]*$", max_length=64)]
AttributeName = Annotated[
    str, StringConstraints(pattern=r"^[A-Za-z][A-Za-z0-9_]*$", max_length=64), AfterValidator(_free)
]
Loudness = Annotated[
    Severity,
    BeforeValidator(_severity),
    PlainSerializer(lambda severity: severity.name.lower(), return_type=str),
    WithJsonSchema({"enum": ["info", "warning", "critical"]}),
]
Quieter = Annotated[Loudness, AfterValidator(_quieter), WithJsonSchema({"enum": ["info", "warning"]})]
Louder = Annotated[Loudness, AfterValidator(_louder), WithJsonSchema({"enum": ["warning", "critical"]})]
ClockTime = Annotated[
    time,
    BeforeValidator(_clock),
    PlainSerializer(lambda clock: f"{clock:%H:%M}", return_type=str),
    WithJsonSchema({"type": "string", "pattern": _CLOCK}),
]
Zone = Annotated[str, Field(strict=True), AfterValidator(_zone)]
Moment = Annotated[
    float,
    BeforeValidator(_moment),
    WithJsonSchema({"type": "string", "pattern": _MOMENT}),
]
Url = Annotated[
    SecretStr,
    BeforeValidator(_url),
    Field(min_length=1),
    AfterValidator(_references),
    WithJsonSchema(
        {
            "oneOf": [
                {"type": "string", "minLength": 1},
                {
                    "type": "object",
                    "properties": {"file": {"type": "string"}},
                    "required": ["file"],
                    "additionalProperties": False,
                },
            ]
        }
    ),
]


def _may_be_off(schema: dict[str, Any]) -> None:
    """In the JSON Schema: a rule may be a section, `off`, or empty."""
    schema["type"] = ["object", "null", "string"]
    schema["pattern"] = "^off$"


class RuleSection(Section):
    """The limits of one rule; the word `off` in their place is `off: true`."""

    model_config = ConfigDict(json_schema_extra=_may_be_off)

    off: Switch = Field(default=False, description="Whether the rule is left out.")

    @model_validator(mode="before")
    @classmethod
    def _off(cls, data: object) -> object:
        return {"off": True} if data == "off" else data


def _field(limit: Limit) -> Any:
    unit = f" ({limit.unit})" if limit.unit else ""
    kind = Annotated[Number, Field(ge=limit.low, le=limit.high)] | None
    return kind, Field(default=limit.value, description=f"{limit.about}{unit}")


def _section(rule: Rule) -> Any:
    """The section of one rule."""
    fields = {limit.name: _field(limit) for limit in rule.limits}
    name = "".join(word.title() for word in rule.name.split("_"))
    made = create_model(
        f"{name}Rule", __base__=RuleSection, __doc__=f"{rule.about} `off` leaves it out.", **fields
    )
    return made, Field(default=made(), description=rule.about)


if TYPE_CHECKING:

    class Health(Section):
        """Made below."""

else:
    Health = create_model(
        "Health",
        __base__=Section,
        __doc__="Rules of health: leaks, battery, devices, attitude. Instead of its limits a rule may have "
        "the word `off`; a limit that is null is not looked at.",
        **{rule.name: _section(rule) for rule in rules.RULES},
    )


def limits_of(health: Health, recovery: float | None, battery: str | None = None) -> dict[str, Limits]:
    """The limits (SI) of the rules that are not off; ``recovery`` is planned then (s).

    The chemistry of the ``battery`` says whether volts tell its end, unless `battery_end.volts` does.
    """
    limits = rules.usual_limits(recovery)
    for rule in rules.RULES:
        section = getattr(health, rule.name)
        if section.off:
            del limits[rule.name]
            continue
        given = {x.name: (getattr(section, x.name), x.si) for x in rule.limits}
        limits[rule.name] = {
            **limits[rule.name],
            **{name: None if value is None else value * si for name, (value, si) in given.items()},
        }
    end = limits.get(END.name)
    if end is not None and end["volts"] is None and battery is not None:
        limits[END.name] = {**end, "volts": ENDS_AT.get(battery)}
    return limits
