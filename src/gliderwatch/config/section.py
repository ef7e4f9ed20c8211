"""The base of all sections of the settings. Pure but for pydantic."""

from __future__ import annotations

from typing import Any, get_origin

from pydantic import BaseModel, ConfigDict, model_validator


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
