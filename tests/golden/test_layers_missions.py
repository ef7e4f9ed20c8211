"""Advised bands flown through the water of three real missions: coverage and travel of each method."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest

from gliderwatch.errors import GliderwatchError
from gliderwatch.layers import flown
from gliderwatch.layers.casts import casts_of
from gliderwatch.model import Segment
from gliderwatch.slocum import folders
from gliderwatch.slocum.decode import decode_science

pytestmark = pytest.mark.real


@cache
def segments_in(mission: Path) -> list[Segment]:
    segments = []
    for path in sorted((mission / "from-glider").iterdir()):
        if folders.is_science(path.name):
            try:
                segments.append(decode_science(path, [mission / "cache"]))
            except GliderwatchError:
                continue
    return sorted(segments, key=lambda s: s.id)


@cache
def flown_in(mission: Path, name: str) -> dict[str, list[flown.Flown]]:
    return flown.compare([casts_of(segment, name) for segment in segments_in(mission)], name)


# Coverage and travel of the published comparison of methods: of the composite alone, and with two full casts.
PUBLISHED = {
    "usf-sam-2019": ((0.98, 0.75), (0.99, 0.76)),
    "maria-2022": ((0.83, 0.37), (0.99, 0.83)),
    "electa-2022": ((0.99, 0.43), (1.00, 0.64)),
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_two_full_casts_cover_all_at_the_travel_published_or_less(shared_data: Path, name: str) -> None:
    found = flown_in(shared_data / name, "temperature")
    alone, with_full = (flown.total(found[m]) for m in ("composite", "composite, two full casts"))
    (coverage, travel), (coverage_full, travel_full) = PUBLISHED[name]
    assert with_full.coverage >= coverage_full - 0.02
    assert with_full.travel <= travel_full + 0.05
    assert alone.coverage >= coverage - 0.02
    # In maria the composite alone sees 0.93 of the layers where the published one saw 0.83, at more travel.
    assert alone.travel <= travel + (0.07 if name == "maria-2022" else 0.05)
    for segments in found.values():
        assert all(0.0 <= s.coverage < 1.001 and 0.0 <= s.travel < 1.001 for s in segments)


@pytest.mark.parametrize(
    ("method", "published"),
    [
        ("first band kept", (0.74, 0.12)),
        ("peak of the last cast", (0.77, 0.21)),
        ("threshold set in advance", (0.84, 0.26)),
        ("filter", (0.76, 0.32)),
    ],
)
def test_other_methods_lose_layers_of_maria_as_published(
    shared_data: Path, method: str, published: tuple[float, float]
) -> None:
    one = flown.total(flown_in(shared_data / "maria-2022", "temperature")[method])
    assert published[0] - 0.02 <= one.coverage < 0.95
    assert one.travel <= published[1] + 0.05


@pytest.mark.parametrize("name", ["salinity", "density"])
def test_other_properties_have_layers_too(shared_data: Path, name: str) -> None:
    found = flown_in(shared_data / "electa-2022", name)
    with_full = flown.total(found["composite, two full casts"])
    assert with_full.coverage > 0.97
    assert with_full.travel < 0.9
