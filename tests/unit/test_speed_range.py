import math

import numpy as np
import pytest

from gliderwatch.estimation.constants import FASTEST
from gliderwatch.estimation.speed_range import Drive, Normal, RangeParams, drive, learn, speed_range
from gliderwatch.model import DiveFeatures

PARAMS = RangeParams()


GLIDE = Drive(0.0)


def learnt(speeds, at=0.0, normal=None, hours=3.0, volumes=(0.0, 0.0)):
    normal = normal or Normal()
    for speed in speeds:
        normal = learn(normal, speed, Drive(at, volumes), hours * 3600, PARAMS)
    return normal


def test_too_few_dives_tell_nothing():
    assert speed_range(Normal(), GLIDE, PARAMS) is None
    assert speed_range(learnt([0.25, 0.26]), GLIDE, PARAMS) is None
    assert speed_range(learnt([0.25, 0.26, 0.24]), GLIDE, PARAMS).dives == 3


@pytest.mark.parametrize("spread", [0.0, 0.005, 0.02, 0.1])
def test_loss_of_30_percent_is_outside_and_a_usual_dive_within(spread):
    """However much the speeds scatter, and however little."""
    rng = np.random.default_rng(3)
    speeds = 0.25 + spread * np.clip(rng.standard_normal(24), -1.5, 1.5)
    found = speed_range(learnt(speeds), GLIDE, PARAMS)
    assert 0.7 * found.usual < 0.75 * found.usual <= found.low <= 0.85 * found.usual
    assert found.high >= 1.349 * found.usual
    assert found.usual == pytest.approx(np.median(speeds))


def test_one_odd_dive_moves_nothing():
    plain = speed_range(learnt([0.25] * 9), GLIDE, PARAMS)
    odd = speed_range(learnt([0.25] * 8 + [0.6]), GLIDE, PARAMS)
    assert odd.low == plain.low


def test_short_dives_after_launch_do_not_count():
    """maria-2022: dives of a quarter of an hour at 0.39 m/s, then three days at 0.21."""
    normal = learnt([0.37, 0.39, 0.37, 0.35], hours=0.3)
    assert len(normal.speeds) == 0
    assert speed_range(learnt([0.21, 0.2, 0.22], normal=normal), GLIDE, PARAMS).usual == 0.21


def test_short_dives_count_when_the_trials_after_launch_are_over():
    """A coastal glider may surface every half hour for weeks."""
    normal = Normal()
    for before in range(11):
        normal = learn(normal, 0.2 + 0.01 * before, GLIDE, 1800.0, PARAMS, before)
    assert normal.speeds == pytest.approx([0.28, 0.29, 0.30])


@pytest.mark.parametrize("hours", [0.5, 1.0, 1.4, 3.0, 6.0])
def test_a_range_rests_on_three_days_however_short_the_dives_are(hours):
    """Water that is a little denser or lighter stays for a day, so that dives of a day are hardly one."""
    normal = Normal()
    for before in range(400):
        normal = learn(normal, before * hours / 24, GLIDE, hours * 3600, PARAMS, before)
    assert len(normal.speeds) == PARAMS.most
    assert normal.speeds[-1] - normal.speeds[0] > 2.5  # days


def test_only_the_first_dives_teach():
    """Slow fouling must not become normal."""
    normal = learnt([0.25] * PARAMS.most + [0.15] * 200)
    assert len(normal.speeds) == PARAMS.most
    assert speed_range(normal, GLIDE, PARAMS).usual == 0.25


def test_thruster_has_a_range_of_its_own():
    normal = learnt([0.54] * 5, at=0.14, normal=learnt([0.33] * 5))
    assert speed_range(normal, GLIDE, PARAMS).usual == 0.33
    assert speed_range(normal, Drive(0.16), PARAMS).usual == 0.54


def test_settings_that_are_near_are_compared():
    normal = learnt([0.54] * 5, at=0.14)
    assert speed_range(normal, Drive(0.18), PARAMS).high < FASTEST
    assert speed_range(normal, Drive(0.2), PARAMS).high == FASTEST


def test_stronger_setting_is_held_against_the_weaker_ones():
    """electa-2022: 0.505 m/s at 0.14 and 0.62 at 0.40; seven tenths of that are a loss."""
    normal = learnt([0.505] * 5, at=0.14, normal=learnt([0.33] * 5))
    found = speed_range(normal, Drive(0.4), PARAMS)
    assert found.usual == pytest.approx(math.sqrt(0.505**2 + 0.4 * 0.26))
    assert 0.7 * 0.62 < found.low < found.usual < 0.62
    assert found.high == FASTEST
    assert speed_range(learnt([0.54] * 5, at=0.3), GLIDE, PARAMS) is None  # a weaker one says nothing


def test_at_a_new_setting_more_volume_makes_more_expected():
    """electa-2022: 0.297 m/s with 250 cm3; with 408, and its thruster for the first time, 0.505."""
    normal = learnt([0.297] * 3, volumes=(-250e-6, 261e-6))
    found = speed_range(normal, Drive(0.14, (-408e-6, 0.0)), PARAMS)
    assert 0.7 * 0.505 < found.low < found.usual < 0.505
    assert found.usual == pytest.approx(math.sqrt(408 / 250 * 0.297**2 + 0.4 * 0.14))


@pytest.mark.parametrize(("before", "times"), [(-210e-6, 400 / 210), (-190e-6, 2.0), (-50e-6, 2.0)])
def test_at_most_twice_the_volume_is_counted_on(before, times):
    found = speed_range(learnt([0.25] * 3, volumes=(before, 0.0)), Drive(0.14, (-400e-6, 0.0)), PARAMS)
    assert found.usual == pytest.approx(math.sqrt(times * 0.25**2 + 0.4 * 0.14))


@pytest.mark.parametrize(
    ("before", "now"),
    [
        ((0.0, 0.0), (-408e-6, 421e-6)),
        ((-250e-6, 261e-6), (0.0, 0.0)),
        ((-250e-6, 0.0), (0.0, 421e-6)),
        ((0.0, 261e-6), (-408e-6, 261e-6)),
        ((-250e-6, 261e-6), (250e-6, 261e-6)),
    ],
)
def test_volumes_that_say_nothing_change_nothing(before, now):
    normal = learnt([0.3] * 3, volumes=before)
    found = speed_range(normal, Drive(0.14, now), PARAMS)
    assert found.usual == pytest.approx(math.sqrt(0.3**2 + 0.4 * 0.14))


def test_drop_to_buoyancy_is_not_held_against_the_thruster():
    normal = learnt([0.54] * 9, at=0.05)
    assert speed_range(normal, GLIDE, PARAMS) is None


def test_what_drives_a_dive():
    plain = drive(DiveFeatures(duration=1.0))
    assert plain.setting == 0.0
    assert plain.volumes == (0.0, 0.0)
    found = drive(DiveFeatures(duration=1.0, thruster=0.4, ballast_dive=-2e-4, ballast_climb=3e-4))
    assert found == Drive(0.4, (-2e-4, 3e-4))


def test_learning_does_not_change_its_input():
    normal = learnt([0.25])
    learn(normal, 0.3, GLIDE, 10800.0, PARAMS)
    assert len(normal.speeds) == 1
