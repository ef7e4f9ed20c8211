"""The clock of a mission, kept from segment to segment, says what a look at all segments says."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from gliderwatch.navigation.clock import DAY, HOUR, ROLLOVER, Correction, Stamp, corrections, mission_clock

STEPS = st.sampled_from([0.0, 0.0, 0.0, 0.0, HOUR, 10 * DAY, ROLLOVER, -2 * DAY, 5000.0])
NUMBERS = st.sampled_from([1, 1, 1, 2, 5])
SEGMENT = st.tuples(NUMBERS, st.floats(60.0, 20000.0), st.floats(60.0, 4000.0), STEPS)


@given(st.lists(SEGMENT, min_size=1, max_size=20), st.sampled_from([Correction(), Correction(HOUR, HOUR)]))
def test_the_next_segment_is_corrected_as_all_together(
    segments: list[tuple[int, float, float, float]], start: Correction
) -> None:
    """Lost segments, clocks that fall back or are set, ends that are wild: the short way says the same."""
    number, t, stamps = 0, 1.7e9, list[Stamp]()
    for ahead, length, pause, step in segments:
        number, t = number + ahead, t + pause - step
        stamp = Stamp(number, t, t + length)
        clock = mission_clock(stamps, corrections(stamps, start)) if stamps else None
        before, stamps, t = stamps, [*stamps, stamp], t + length
        found = None if clock is None else clock.next(stamp)
        if clock is not None and found is not None:
            assert corrections(stamps, start) == [*corrections(before, start), found]


def test_a_segment_of_a_usual_length_needs_no_look_at_all_others() -> None:
    """Most segments: what makes a file cost the same at the first and at the ten thousandth."""
    stamps = [Stamp(n, n * 10800.0, n * 10800.0 + 10000.0 + n % 7) for n in range(20)]
    clock = mission_clock(stamps, corrections(stamps))
    assert clock is not None
    assert clock.next(Stamp(20, 20 * 10800.0, 20 * 10800.0 + 9000.0)) == Correction()
    assert clock.next(Stamp(20, 10 * 10800.0, 10 * 10800.0 + 9000.0)) not in (None, Correction())
    assert clock.next(Stamp(19, 20 * 10800.0, 20 * 10800.0 + 9000.0)) is None
