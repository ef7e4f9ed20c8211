"""A dive beside its fleet: the flow by the others, fused with its own and a model, and what does not fit."""

from dataclasses import replace

import numpy as np
import pytest

from gliderwatch.fleet.reference import beside_neighbours, fleet_reference
from gliderwatch.messages.samples import SAMPLES
from gliderwatch.model import OTHER_REFERENCE, Assessment, Flag
from gliderwatch.navigation.geodesy import from_plane

T0, HOUR, W, FLOW = 1.7e9, 3600.0, 0.3, (0.1, -0.05)


def dives(glider: str, east: float, n: int = 26, lost: float = 0.0, since: int = 20) -> list[Assessment]:
    """Dives of 3 h to the north in a steady current; from one on part of the speed is lost."""
    from gliderwatch.messages.samples import _HEALTHY, _at

    assert SAMPLES
    out = []
    for k in range(n):
        lat, lon = from_plane((east, 3000.0 * k), 50.0, 1.0)
        v = FLOW[1] - (lost * W if k >= since else 0.0)
        numbers = {"heading_mean": 0.0, "heading_steadiness": 1.0, "own_speed": W}
        dive = _at(_HEALTHY, T0 + 3.2 * HOUR * (k + 1) + east / 100)
        out.append(
            replace(
                dive,
                glider=glider,
                t_dive=dive.t_surface - 3 * HOUR,
                lat=lat,
                lon=lon,
                flag=int(Flag.NORMAL),
                speed=W,
                reference_u=FLOW[0] + 0.004 * (-1) ** k,
                reference_v=v,
                reference_final=True,
                evidence=numbers,
                notes=(),
            )
        )
    return out


def fleet(lost: float = 0.0) -> dict[str, list[Assessment]]:
    return {
        "a": dives("a", 0.0, lost=lost),
        "b": dives("b", 8e3),
        "c": dives("c", -9e3),
        "d": dives("d", 15e3),
    }


def last_of(found: dict[str, list[Assessment]], glider: str = "a") -> Assessment:
    return beside_neighbours(found[glider][-1:], found.values())[0]


def test_a_healthy_dive_gets_the_flow_by_the_others_and_keeps_its_flag():
    seen = last_of(fleet())
    numbers = seen.evidence
    assert (numbers["fleet_u"], numbers["fleet_v"]) == pytest.approx(FLOW, abs=0.03)
    assert 0 < numbers["fused_sigma"] <= numbers["fleet_sigma"] < 0.1
    assert numbers["fleet_gliders"] == 3
    assert 7e3 < numbers["fleet_nearest"] < 9e3
    assert (seen.flag, seen.notes[-1]) == (Flag.NORMAL, "flow by the fleet: b, c, d")
    assert "fleet_loss" not in numbers


def test_a_hidden_loss_on_one_course_is_a_flag_with_the_neighbours_as_evidence():
    found = fleet(lost=0.4)
    seen = last_of(found)
    assert seen.flag == Flag.ANOMALY
    assert seen.reason.startswith("40 % slower through the water than it believes, by its neighbours b, c, d")
    assert seen.evidence["fleet_loss"] == pytest.approx(0.4, abs=3 * seen.evidence["fleet_loss_sigma"])
    assert seen.speed == pytest.approx(0.6 * W, abs=0.05)
    assert seen.flow_v == pytest.approx(FLOW[1], abs=0.03)
    assert last_of(found, "b").flag == Flag.NORMAL


def test_the_order_of_what_came_does_not_matter_and_what_came_after_the_dive_does_not_count():
    found = fleet(lost=0.4)
    other = {glider: found[glider] for glider in reversed(found)}
    dive = found["a"][24]
    known = {glider: [d for d in own if d.t_surface <= dive.t_surface] for glider, own in found.items()}
    seen = beside_neighbours([dive], found.values())
    assert seen == beside_neighbours([dive], other.values())
    assert seen == beside_neighbours([dive], known.values())


def test_who_is_alone_or_compared_with_another_reference_stays_as_it_is():
    found = fleet()
    assert last_of({"a": found["a"]}) == found["a"][-1]
    noted = [replace(each, notes=(f"{OTHER_REFERENCE} tides",)) for each in found["a"]]
    assert beside_neighbours(noted[-1:], [noted, found["b"]]) == noted[-1:]
    others = {"a": found["a"], "b": [replace(each, notes=(f"{OTHER_REFERENCE} x",)) for each in found["b"]]}
    assert last_of(others) == found["a"][-1]


def test_a_neighbour_in_doubt_counts_less_or_not_at_all():
    def with_b(flag: int | None) -> dict[str, float]:
        found = fleet()
        wrong = [replace(each, flag=flag, reference_v=FLOW[1] + 0.3) for each in found["b"]]
        return last_of({"a": found["a"], "b": wrong, "c": found["c"]}).evidence

    normal, unknown, disagrees = (with_b(flag) for flag in (0, None, int(Flag.FALSE_ALARM)))
    off = [abs(each["fleet_v"] - FLOW[1]) for each in (normal, unknown, disagrees)]
    assert off[0] > off[2]
    assert off[0] > off[1]
    assert disagrees["fleet_gliders"] == 1


def test_a_model_is_weighed_in_by_its_covariance():
    found = fleet()
    plain = last_of(found).evidence
    told = [*found["a"][:-1], replace(found["a"][-1], evidence={**found["a"][-1].evidence, "model_u": 0.3,
            "model_v": 0.0, "model_sigma": plain["fused_sigma"]})]  # fmt: skip
    seen = last_of({**found, "a": told}).evidence
    assert plain["fused_u"] + 0.02 < seen["fused_u"] < 0.3
    assert seen["fused_sigma"] < plain["fused_sigma"]
    assert (seen["fleet_u"], seen["fleet_sigma"]) == (plain["fleet_u"], plain["fleet_sigma"])


def test_its_own_dives_are_not_among_the_others():
    from gliderwatch.fleet.cross_check import current_of

    found = fleet()
    currents = [current_of(each, None) for own in found.values() for each in own]
    one = fleet_reference(currents, "a")
    moved = [replace(each, u=each.u + 0.02) if each.glider == "a" else each for each in currents]
    other = fleet_reference(moved, "a")
    assert np.allclose(one.others.flow, other.others.flow)
    assert other.fused[0][0] > one.fused[0][0]
