"""The generated pages are those of the models, and the schema takes what the loader takes."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from types import ModuleType
from typing import Any

import jsonschema
import pytest
from ruamel.yaml import YAML

ROOT = Path(__file__).resolve().parents[2]
MINIMAL = {"dockserver": {"roots": ["/data"]}}


@pytest.fixture(scope="module")
def generate() -> ModuleType:
    spec = importlib.util.spec_from_file_location("generate", ROOT / "docs" / "generate.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def validator() -> jsonschema.Draft202012Validator:
    schema = json.loads((ROOT / "docs" / "gliderwatch.schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


def test_generated_files_are_up_to_date(generate: ModuleType) -> None:
    stale = [
        path.name for path, text in generate.documents().items() if path.read_text(encoding="utf-8") != text
    ]
    assert not stale, "run: python docs/generate.py"


def test_page_has_every_key(generate: ModuleType) -> None:
    page = generate.configuration()
    for section in generate.schema()["$defs"].values():
        for key in section["properties"]:
            assert f"| `{key}` |" in page


def test_schema_takes_the_shipped_example(validator: jsonschema.Draft202012Validator) -> None:
    example = YAML(typ="safe", pure=True).load(ROOT / "config" / "gliderwatch.yml")
    assert list(validator.iter_errors(example)) == []


@pytest.mark.parametrize(
    ("data", "is_valid"),
    [
        (MINIMAL, True),
        ({**MINIMAL, "gliders": {"electa": None}, "channels": None}, True),
        ({**MINIMAL, "defaults": {"adaptive": {"speed_gain": None, "centres": [[27, -83.5]]}}}, True),
        ({**MINIMAL, "channels": {"a": {"url": {"file": "x"}}}}, True),
        ({**MINIMAL, "gliders": {"a": {"muted_until": "2026-12-01 14:30", "recovered": True}}}, True),
        ({**MINIMAL, "gliders": {"a": {"muted_until": "2026-12-01T14:30:00+02:00"}}}, True),
        ({**MINIMAL, "gliders": {"a": {"muted_until": None, "overdue_hours": None}}}, True),
        ({**MINIMAL, "gliders": {"a": {"muted_until": "soon"}}}, False),
        ({**MINIMAL, "gliders": {"a": {"recovered": "yes"}}}, False),
        ({**MINIMAL, "gliders": {"a": {"overdue_hours": 0}}}, False),
        ({}, False),
        ({"dockserver": {"root": ["/data"]}}, False),
        ({**MINIMAL, "zzz": {}}, False),
        ({**MINIMAL, "gliders": {"no name": None}}, False),
        ({**MINIMAL, "gliders": {"a": {"adaptive": {"sigma": 0}}}}, False),
        ({**MINIMAL, "gliders": {"a": {"adaptive": {"centres": [[27]]}}}}, False),
        ({**MINIMAL, "channels": {"a": {"url": 3}}}, False),
        ({**MINIMAL, "channels": {"a": None}}, False),
        ({**MINIMAL, "defaults": {"rules": {"false_alarm": {"severity": "critical"}}}}, False),
    ],
)
def test_schema_says_the_same_as_the_loader(
    validator: jsonschema.Draft202012Validator, data: dict[str, Any], is_valid: bool
) -> None:
    from pydantic import ValidationError

    from gliderwatch.config import Config

    assert validator.is_valid(data) is is_valid
    if is_valid:
        Config.model_validate(data)
    else:
        with pytest.raises(ValidationError):
            Config.model_validate(data)
