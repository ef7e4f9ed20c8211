"""What is usual for a glider, and how little disturbs it."""

import math
from pathlib import Path

import numpy as np
import pytest

from gliderwatch.estimation import healthy_baseline
from gliderwatch.estimation.healthy_baseline import Baseline, evidence_of, learn
from gliderwatch.messages.evidence import usual
from gliderwatch.model import Dive, DiveFeatures
from gliderwatch.navigation.dives import Navigation, extend
from gliderwatch.navigation.features import evidence
from gliderwatch.store import codec
from missions import real

DIVE = {
    "duration": 3.0 * 3600,
    "roll_mean": 0.02,
    "pitch_dive": -0.45,
    "pitch_climb": 0.44,
    "depth_rate_dive": 0.16,
    "depth_rate_climb": -0.15,
    "ballast_dive": -250e-6,
    "ballast_climb": 240e-6,
    "depth_max": 180.0,
    "yos": 6.0,
    "vacuum": 24e3,
}


def healthy(n: int = 12, seed: int = 1, **changes: float) -> list[dict[str, float]]:
    """Dives like `DIVE` that scatter by 3 %."""
    rng = np.random.default_rng(seed)
    return [
        {k: v * (1 + 0.03 * rng.standard_normal()) for k, v in (DIVE | changes).items()} for _ in range(n)
    ]


def taught(dives: list[dict[str, float]], known: Baseline | None = None) -> Baseline:
    known = Baseline() if known is None else known
    for dive in dives:
        known = learn(known, DiveFeatures(**dive))
    return known


def compare(known: Baseline, dive: dict[str, float]) -> dict[str, healthy_baseline.Usual]:
    return healthy_baseline.compare(known, DiveFeatures(**dive))


def outside(known: Baseline, **changes: float) -> set[str]:
    return {name for name, u in compare(known, DIVE | changes).items() if not u.low <= u.value <= u.high}


def test_nothing_is_usual_before_enough_dives() -> None:
    assert compare(taught(healthy(4)), DIVE) == {}
    assert set(compare(taught(healthy(5)), DIVE)) == {q.name for q in healthy_baseline.QUANTITIES}


def test_a_healthy_dive_is_as_usual() -> None:
    known = taught(healthy(12))
    assert all(not outside(known, **dive) for dive in healthy(50, seed=2))


@pytest.mark.parametrize(
    ("changes", "names"),
    [
        ({"roll_mean": 0.3}, {"roll_mean"}),
        ({"depth_rate_climb": -0.09}, {"depth_rate_climb", "rate_ratio"}),
        ({"depth_rate_climb": -0.1, "depth_rate_dive": 0.1}, {"depth_rate_climb", "depth_rate_dive"}),
        ({"pitch_climb": 0.3}, {"pitch_climb", "pitch_asymmetry"}),
        ({"ballast_climb": 120e-6}, {"ballast_climb"}),
        ({"duration": 5.0 * 3600, "yos": 10.0}, {"duration_h"}),
        ({"yos": 3.0}, {"yos_per_hour"}),
        ({"vacuum": 17e3}, {"vacuum"}),
    ],
)
def test_what_is_wrong_is_named(changes: dict[str, float], names: set[str]) -> None:
    assert outside(taught(healthy()), **changes) == names


def test_the_range_is_the_median_with_a_floor() -> None:
    usual = compare(taught([DIVE] * 5), DIVE)["roll_mean"]
    assert (usual.value, usual.low, usual.usual, usual.high) == pytest.approx((0.02, -0.06, 0.02, 0.10))


def test_a_wider_scatter_makes_a_wider_range() -> None:
    rolls = [0.0, 0.02, 0.04, 0.06, 0.08]
    usual = compare(taught([DIVE | {"roll_mean": roll} for roll in rolls]), DIVE)["roll_mean"]
    assert usual.high - usual.usual == pytest.approx(4 * 1.4826 * 0.02)


def test_one_odd_dive_moves_nothing() -> None:
    clean = compare(taught([DIVE] * 9), DIVE)
    assert compare(taught([*[DIVE] * 8, DIVE | {"depth_rate_climb": -0.4}]), DIVE) == clean


def test_slow_growth_is_not_learnt() -> None:
    """Each dive is 1 % slower than the one before, and taken for healthy."""
    dives = [
        DIVE | {"depth_rate_climb": -0.15 * 0.99**k, "depth_rate_dive": 0.16 * 0.99**k} for k in range(60)
    ]
    assert outside(taught(dives), **dives[-1]) == {"depth_rate_climb", "depth_rate_dive"}


def test_another_trim_is_another_rate() -> None:
    """A pilot pumps less: slower dives at that ballast are usual, at the old one they are not."""
    slower = {"ballast_climb": 150e-6, "depth_rate_climb": -0.10}
    known = taught([*healthy(14), *healthy(6, seed=3, **slower)])
    assert outside(known, **slower) == set()
    assert "depth_rate_climb" in outside(known, depth_rate_climb=-0.10)


def test_a_trim_never_flown_says_nothing_of_rates() -> None:
    found = compare(taught(healthy()), DIVE | {"ballast_climb": 100e-6, "depth_rate_climb": -0.05})
    assert "depth_rate_climb" not in found
    assert found["ballast_climb"].value < found["ballast_climb"].low


def test_thruster_and_buoyancy_are_kept_apart() -> None:
    fast = {"thruster": 0.4, "roll_mean": 0.3}
    known = taught([*healthy(8), *healthy(4, seed=4, **fast)])
    assert compare(known, DIVE | fast) == {}
    known = taught(healthy(4, seed=5, **fast), known)
    assert outside(known, **fast) == set()
    assert outside(known, roll_mean=0.3) == {"roll_mean"}
    assert compare(known, DIVE | {"thruster": 0.03}) == {}  # hardly on is on


def test_short_dives_teach_nothing_and_the_shortest_are_not_compared() -> None:
    assert not len(taught(healthy(9, duration=0.7 * 3600)).dives)
    known = taught(healthy())
    assert "roll_mean" in outside(known, duration=0.7 * 3600, yos=1.4, roll_mean=0.3)
    assert compare(known, DIVE | {"duration": 0.4 * 3600, "roll_mean": 0.3}) == {}


def test_missing_numbers_are_left_out() -> None:
    known = taught([{"duration": 3.0 * 3600, "roll_mean": 0.0}] * 6)
    assert np.isfinite(known.dives).all()
    assert set(compare(known, DIVE)) == {"roll_mean", "duration_h"}
    assert compare(known, {"duration": 0.0}) == {}
    assert compare(known, {"duration": 3.0 * 3600, "roll_mean": math.nan}).keys() == {"duration_h"}


def test_what_is_told() -> None:
    found = evidence_of(taught(healthy()), DiveFeatures(**DIVE | {"duration": 4.5 * 3600}))
    assert found["surfacing_delay_h"] == pytest.approx(4.5 - found["duration_h_usual"])
    assert found["roll_mean_low"] < found["roll_mean_usual"] < found["roll_mean_high"]
    assert found["pitch_asymmetry"] == pytest.approx(-0.01)
    assert found["yos_per_hour"] == pytest.approx(6 / 4.5)
    assert found.keys().isdisjoint(DIVE)
    assert set(evidence_of(Baseline(), DiveFeatures(**DIVE))) == {
        "pitch_asymmetry",
        "rate_ratio",
        "yos_per_hour",
    }


def test_memory_is_bounded_and_survives_the_state_file() -> None:
    known = Baseline()
    for k in range(40):
        known = taught(healthy(30, seed=k, thruster=k / 40), known)
    assert len(known.dives) <= healthy_baseline.BASELINE_MOST
    assert not known.dives.flags.writeable
    again = codec.decode(codec.encode(known), Baseline)
    assert np.array_equal(again.dives, known.dives)
    assert np.array_equal(again.measured, known.measured)
    assert len(codec.encode(known)) < 20_000


def test_the_first_dives_are_kept_and_the_latest() -> None:
    dives = [DIVE | {"roll_mean": 0.001 * k} for k in range(60)]
    rolls = taught(dives).dives[:, 0] * 1000
    assert rolls.round().tolist() == [*range(12), *range(48, 60)]


# Usable dives after the first 12 h of which a number points to the glider; there are 42, 24, 12, 3 and 9.
# In its last day george-2024 flies spirals, rolled by 10 degrees, and tells few headings.
@pytest.mark.real
@pytest.mark.parametrize(
    ("name", "most"),
    [("electa-2022", 3), ("george-2024", 9), ("maria-2022", 0), ("osu-2025", 0), ("usf-sam-2019", 1)],
)
def test_on_healthy_missions_little_points_to_the_glider(shared_data: Path, name: str, most: int) -> None:
    state, dives = Navigation(), dict[float, Dive]()
    for segment in real(shared_data, name):
        state, news = extend(state, segment)
        dives |= {dive.t_dive: dive for dive in news}
    known, odd, compared = Baseline(), 0, 0
    for t in sorted(t for t in dives if dives[t].track is not None):
        more = evidence_of(known, dives[t].features)
        if t - min(dives) > 12 * 3600:
            numbers = usual({**evidence(dives[t].features), **more})
            odd, compared = odd + any(n.telling for n in numbers), compared + bool(numbers)
        known = learn(known, dives[t].features)
    assert compared >= 3
    assert odd <= most
