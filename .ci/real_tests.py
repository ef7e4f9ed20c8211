"""Were the tests that read real missions run? A pytest plugin that notes them, and a check of its notes.

As a plugin it writes each test's `real` marker into the JUnit report. As a script it reads such
reports and fails if one of those tests was skipped, or if none ran.
"""

from __future__ import annotations

import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pytest

PROPERTY = ("marker", "real")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Note the marker where the report keeps it."""
    for item in items:
        if item.get_closest_marker("real"):
            item.user_properties.append(PROPERTY)


def problems(reports: list[Path]) -> list[str]:
    """What speaks against the reports, in words; empty when real tests ran and none was skipped."""
    cases = [case for path in reports for case in ET.parse(path).getroot().iter("testcase")]
    found, ran = [], 0
    for case in cases:
        name = f"{case.get('classname')}::{case.get('name')}"
        real = any((p.get("name"), p.get("value")) == PROPERTY for p in case.iter("property"))
        skip = case.find("skipped")
        if skip is None:
            ran += real
        elif skip.get("message") == "collection skipped":
            found.append(f"skipped as a whole, with any real test in it: {name}")
        elif real and skip.get("type") != "pytest.xfail":
            found.append(f"real test skipped: {name}: {skip.get('message')}")
    return found if ran else [*found, "no real test ran"]


if __name__ == "__main__":
    complaints = problems([Path(name) for name in sys.argv[1:]])
    print("\n".join(complaints) or "real tests ran, none was skipped")
    sys.exit(bool(complaints))
