"""The section `health` of the settings: made of the rules, each of which has its limits with it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from pydantic import ConfigDict, Field, create_model, model_validator

from gliderwatch.config.fields import Number, Section, Switch
from gliderwatch.health import rules
from gliderwatch.health.battery import END
from gliderwatch.health.constants import ENDS_AT
from gliderwatch.health.rule import Limit, Limits, Rule


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
