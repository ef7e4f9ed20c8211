"""Writes `configuration.md` and `gliderwatch.schema.json` from the models of the settings.

    python docs/generate.py

Run it after a change of `gliderwatch.config`; a test fails while the files are out of date.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from gliderwatch.config import Config
from gliderwatch.model import Severity

HERE = Path(__file__).parent
Schema = dict[str, Any]

INTRO = """\
# Configuration

One YAML file; copy `config/gliderwatch.yml`, which has comments. Before you start,
`gliderwatch check -c FILE` names the line of each mistake, and checks the folders, caches
and channels too. An editor with JSON Schema completes and checks the file with
`gliderwatch.schema.json` of this folder.

*`docs/generate.py` makes this page.*

## Which value counts

For each glider and key, the last of these counts:

1. the built-in default (the tables below),
2. the preset that the glider names, else the one that `defaults` names,
3. `defaults`,
4. the glider's own section under `gliders`.

`null` counts as a value where it has a meaning.

## Names and paths

A glider's name is that in the headers of its files, in lower case. `check` and `status` list gliders that are
not under `gliders`; they are not watched. Relative paths start at the folder of
the configuration file. Patterns may have `*`, `?` and `[...]`; each rescan evaluates them again.

## Secrets

A channel's URL, or any part of it, can come from elsewhere:

| written | comes from |
| --- | --- |
| `${NAME}` | environment variable, for the service a line `NAME=...` in `/etc/default/gliderwatch` |
| `${file:PATH}` | a file with one line that the service may read |
| `${credential:NAME}` | systemd credential (`LoadCredential=NAME:PATH` of the service) |
| `url: {file: PATH}` | a file with the complete URL |

A value before the `@` of the address (`user:${PASSWORD}@host`) or after its `?` is percent-encoded
for you: store passwords as they are. Elsewhere it is not encoded, so that it may be a complete URL or
a path of tokens. Values are never printed.
"""


def schema() -> Schema:
    """The JSON Schema of the configuration file."""
    made = _tidy(Config.model_json_schema())
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "gliderwatch configuration",
        **made,
    }


def _tidy(node: Any, *, names: bool = False) -> Any:
    """Without the titles that pydantic derives from names; severities by name. ``names``: keys are names."""
    if isinstance(node, list):
        return [_tidy(item) for item in node]
    if not isinstance(node, dict):
        return node
    if not names:
        node = {key: value for key, value in node.items() if key != "title" and not _is_section(key, node)}
        if "enum" in node and isinstance(node.get("default"), int):
            node["default"] = Severity(node["default"]).name.lower()
        if "patternProperties" in node:
            node["additionalProperties"] = False
    return {
        key: _tidy(value, names=key in {"properties", "patternProperties", "$defs"})
        for key, value in node.items()
    }


def _is_section(key: str, node: Schema) -> bool:
    return key == "default" and "$ref" in node  # its keys have their own defaults


def _ref(value: Schema) -> str | None:
    """The section that a key holds, also where it may be left out as null."""
    choices = [value, *value.get("anyOf", ())]
    return next((choice["$ref"] for choice in choices if "$ref" in choice), None)


def configuration() -> str:
    """The page on the configuration, as Markdown."""
    made = schema()
    parts = [INTRO]
    for path, section in _sections(made, made, ""):
        parts.append(f"## `{path}`\n\n{_prose(section['description'])}\n")
        properties = section["properties"]
        if path == "gliders.NAME":
            shared = made["$defs"]["Settings"]["properties"]
            properties = {key: value for key, value in properties.items() if key not in shared}
            parts.append("All keys of [`defaults`](#defaults), and:\n")
        rows = [_row(path, key, value, section) for key, value in properties.items()]
        parts.append(
            "\n".join(["| key | value | default | meaning |", "| --- | --- | --- | --- |", *rows, ""])
        )
    return "\n".join(parts)


def _sections(root: Schema, node: Schema, path: str) -> Iterator[tuple[str, Schema]]:
    """Path and schema of each section below `node`, depth first; what a glider shares is the defaults'."""
    shared = root["$defs"]["Settings"]["properties"] if path == "gliders.NAME" else {}
    for key, value in node["properties"].items():
        if key in shared:
            continue
        named = next(iter(value.get("patternProperties", {}).values()), {})
        ref = _ref(value) or named.get("$ref")
        if ref:
            below = ".".join(filter(None, [path, key, "NAME" if named else ""]))
            section = root["$defs"][ref.removeprefix("#/$defs/")]
            yield below, section
            yield from _sections(root, section, below)


def _row(path: str, key: str, value: Schema, section: Schema) -> str:
    cells = [f"`{key}`", _kind(value), _default(key, value, section), _prose(value["description"])]
    if _ref(value):
        anchor = f"{path}.{key}".replace(".", "").lower()
        cells[1:3] = [f"[section](#{anchor})", ""]
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"


def _prose(text: str) -> str:
    return " ".join(text.split())


def _kind(value: Schema) -> str:
    """What may be written, in a few words."""
    if "enum" in value:
        return ", ".join(f"`{choice}`" for choice in value["enum"])
    for choices in ("anyOf", "oneOf"):
        if choices in value:
            return " or ".join(_kind(choice) for choice in value[choices])
    types = value.get("type", "object")
    kind = types if isinstance(types, str) else types[0]
    words = {
        "string": "text",
        "array": "list",
        "integer": "whole number",
        "object": "`{file: PATH}`",
        "null": "`null`",
    }
    return f"{words.get(kind, kind)}{_bounds(value)}"


def _bounds(value: Schema) -> str:
    low, above = value.get("minimum"), value.get("exclusiveMinimum")
    high = value.get("maximum")
    if above is not None:
        return f" > {above:g}, ≤ {high:g}"
    return f" {low:g} to {high:g}" if low is not None else ""


def _default(key: str, value: Schema, section: Schema) -> str:
    if key in section.get("required", []):
        return "required"
    default = value.get("default")
    if isinstance(default, str):
        return f"`{default}`"
    if default is None or default == [] or isinstance(default, bool):
        return f"`{json.dumps(default)}`"
    return f"`{default:g}`"


def documents() -> dict[Path, str]:
    """The text of each generated file."""
    return {
        HERE / "configuration.md": configuration(),
        HERE / "gliderwatch.schema.json": json.dumps(schema(), indent=2) + "\n",
    }


if __name__ == "__main__":
    for path, text in documents().items():
        path.write_text(text, encoding="utf-8")
