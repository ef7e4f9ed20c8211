"""What relays write to each other."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gliderwatch.fleet import exchange
from gliderwatch.fleet.constants import LARGEST_PARCEL
from gliderwatch.fleet.exchange import FORM, FieldHoldings, Holdings, Parcel, Request, Sample


@pytest.mark.parametrize(
    "message",
    [
        Parcel(FORM, "a", "sst", "k", (Sample("x@1", "x", b"\x00\xff"),)),
        Holdings(FORM, "b c", 1.5, {"sst": FieldHoldings("k", {20000: (3, 2**40)})}),
        Request(FORM, "a", "sst", "k", 20000, {"x@1": 7}),
    ],
)
def test_messages_come_back_as_they_went(message: Parcel | Holdings | Request) -> None:
    assert exchange.decode(exchange.encode(message), type(message)) == message


@settings(max_examples=25)
@given(st.binary(max_size=80))
def test_nonsense_is_a_value_error(data: bytes) -> None:
    for kind in (Parcel, Holdings, Request):
        with pytest.raises(ValueError, match=r"relay|form"):
            exchange.decode(data, kind)


def test_another_form_and_what_is_too_long_is_refused() -> None:
    later = Request(FORM + 1, "a", "sst", "k", 1, {})
    with pytest.raises(ValueError, match="install the same"):
        exchange.decode(exchange.encode(later), Request)
    with pytest.raises(ValueError, match="too many"):
        exchange.decode(bytes(4 * LARGEST_PARCEL + 1), Request)


def test_parcels_are_as_large_as_brokers_take() -> None:
    samples = [Sample(f"b{k}", "g", bytes(n)) for k, n in enumerate([30_000, 30_000, 30_000, 90_000, 10])]
    made = list(exchange.parcels("a", "sst", "k", samples))
    assert [[each.id for each in parcel.batches] for parcel in made] == [["b0", "b1"], ["b2"], ["b3"], ["b4"]]
    assert list(exchange.parcels("a", "sst", "k", [])) == []


def test_only_days_of_which_another_has_batches_differ() -> None:
    own, other = {1: (1, 5), 2: (2, 9)}, {1: (1, 5), 3: (1, 1)}
    assert exchange.differing(own, other) == [3]
    assert exchange.differing({}, {}) == []
