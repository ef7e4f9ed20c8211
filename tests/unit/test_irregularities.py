"""Two gliders under one name, and who hears of it."""

import random
from dataclasses import replace

import pytest

from clocks import shifted
from gliderwatch.incidents.irregularities import due, irregularities
from gliderwatch.messages import irregularity_text
from gliderwatch.model import Fix, Kind
from missions import START, Leg, feed, mission

HOUR = 3600.0
HERE, THERE = (36.0, -70.0), (27.5, -84.0)


def places(*spots, step=3 * HOUR):
    return [Fix(START + k * step, lat + 0.01 * k, lon) for k, (lat, lon) in enumerate(spots)]


def test_places_that_alternate_are_of_two_gliders():
    (told,) = irregularities("unit", [], places(HERE, THERE, HERE, THERE, HERE, THERE))
    title, page = irregularity_text.irregular("", told)
    assert title == "unit TWO GLIDERS under this name"
    text = page.text()
    assert "files of two gliders come under the name unit" in text
    assert "36" in text and "27" in text and "km apart within 3.0 h" in text


@pytest.mark.parametrize(
    "spots",
    [
        [HERE] * 8,
        [HERE, HERE, THERE, HERE, HERE, HERE],
        [HERE, THERE, HERE, HERE, THERE, HERE],
        [HERE, HERE, HERE, THERE, THERE, THERE],
        [HERE, (36.02, -70.0), HERE, (36.02, -70.0), HERE],
    ],
    ids=["one place", "one wild fix", "two wild fixes", "redeployed", "near enough to fly"],
)
def test_what_one_glider_does_is_not(spots):
    assert not irregularities("unit", [], places(*spots))


def test_it_is_said_once_and_not_of_the_past():
    wrong = irregularities("unit", [], places(*[HERE, THERE] * 4))
    now = START + 25 * HOUR
    ids, (alert,) = due((), wrong, now)
    assert alert.kind == Kind.OPERATOR and alert.glider == ""
    assert due(ids, wrong, now + HOUR) == (ids, [])
    assert due((), wrong, now + 31 * 86400.0) == ((), [])


@pytest.mark.parametrize("later", [0.5 * HOUR, 1.5 * HOUR])
def test_two_gliders_whose_files_come_under_one_name(later):
    """As their files come, in any order: no dive of either is called an anomaly, and it is known."""
    legs = [Leg(hours=3.0, heading=1.0 + 0.02 * (k % 3)) for k in range(12)]
    one, other = mission(legs), []
    for k, s in enumerate(mission(legs)):
        held = dict(s.quantities)
        held["fix_lat"] = replace(held["fix_lat"], v=held["fix_lat"].v - 8.5)
        held["fix_lon"] = replace(held["fix_lon"], v=held["fix_lon"].v - 14.0)
        moved = shifted(replace(s, quantities=held), later)
        other.append(replace(moved, id=replace(moved.id, name=f"unit-2023-318-7-{k}")))
    files = random.Random(7).sample(one + other, len(one + other))
    store = feed(files)
    assert [
        irregularity_text.title(i) for i in irregularities("unit", [], store.facts("unit").places(12))
    ] == ["files of two gliders come under the name unit"]
    assert not store.incidents("unit")
