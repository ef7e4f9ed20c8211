"""How the features of a dive are published."""

import math
from dataclasses import fields

import pytest

from gliderwatch.model import DiveFeatures
from gliderwatch.navigation.features import evidence
from gliderwatch.navigation.track import Closure

WHOLE = DiveFeatures(**{field.name: k + 1.0 for k, field in enumerate(fields(DiveFeatures))})


def test_each_feature_is_published_once() -> None:
    """A feature that is left out, or a key that stands for two, would make the counts differ."""
    closed = Closure(0.3, 0.01, 0.02)
    assert len(evidence(WHOLE)) == len(fields(DiveFeatures))
    assert len(evidence(WHOLE, closed)) == len(fields(DiveFeatures)) + len(closed)
    for field in fields(DiveFeatures):
        other = DiveFeatures(**{f.name: getattr(WHOLE, f.name) + (f is field) for f in fields(DiveFeatures)})
        assert len(evidence(other).items() - evidence(WHOLE).items()) == 1, field.name


def test_units() -> None:
    found = evidence(
        DiveFeatures(
            duration=3 * 3600.0,
            fix_gap=90.0,
            drift=1800.0,
            heading_mean=-math.pi / 2,
            heading_gap=5400.0,
            unobserved=7200.0,
            yos=4,
        )
    )
    assert found == pytest.approx(
        {
            "duration_h": 3.0,
            "fix_gap_minutes": 1.5,
            "drift_h": 0.5,
            "heading_mean": 270.0,
            "yos": 4.0,
            "heading_gap_h": 1.5,
            "unobserved_h": 2.0,
        }
    )


def test_what_is_not_known_is_left_out_and_zero_is_not() -> None:
    assert evidence(DiveFeatures(duration=60.0, roll_mean=0.0, thruster=0.0)).keys() == {
        "duration_h",
        "roll_mean",
        "thruster",
    }
