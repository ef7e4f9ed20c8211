"""Fixtures shared by all tests."""

from pathlib import Path

import pytest
from hypothesis import settings

# The same examples in every run: a red test must be red again tomorrow.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")

ROOMS = ("acceptance", "property", "golden", "integration", "unit")
"""In what order `make test` begins them: files with long tests first, so that none is left to one process."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files in the order of their rooms, the tests of a file together; those of src last."""
    places = {name: place for place, name in enumerate(ROOMS)}
    folder = Path(__file__).parent

    def place(item: pytest.Item) -> int:
        is_ours = item.path.is_relative_to(folder)
        return places.get(item.path.relative_to(folder).parts[0], len(ROOMS)) if is_ours else len(ROOMS)

    items.sort(key=place)


SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real missions beside the checkout; the test is skipped where it is absent."""
    if not SHARED_DATA.is_dir():
        pytest.skip(f"real missions are not there: {SHARED_DATA}")
    return SHARED_DATA
