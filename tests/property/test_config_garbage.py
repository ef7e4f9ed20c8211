"""Whatever stands in the file: settings, or a `ConfigError` that names the file; never anything else."""

from __future__ import annotations

import tempfile
from pathlib import Path

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ruamel.yaml import YAML

from gliderwatch.config import Config, load
from gliderwatch.errors import ConfigError

EXAMPLE = (Path(__file__).resolve().parents[2] / "config" / "gliderwatch.yml").read_text(encoding="utf-8")
WORDS = ["roots", "estimator", "centres", "normal_speed", "preset", "url", "rules", *Config.model_fields]
MARKS = [
    ": ",
    "- ",
    "? ",
    "!!int ",
    "!!set ",
    "!!binary ",
    "&a ",
    "*a",
    "|\n",
    ">\n",
    "---\n",
    "...",
    "<<: ",
    "${",
]
SCALARS = ["null", ".nan", "1e999", "0o9", "2020-13-45", "9" * 5000, "true", "-1", "%YAML 9.9\n", "\n\n  "]
PIECES = st.sampled_from([*"{}[],!|>'\"\t\n#~@`=\\\r\x00\u2028\U0001f600", *WORDS, *MARKS, *SCALARS])
VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8) | PIECES,
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=6) | PIECES, inner, max_size=4)
    ),
    max_leaves=12,
)
SLOW_IS_FINE = settings(max_examples=50, deadline=None, suppress_health_check=[HealthCheck.too_slow])


def loads_or_says_why(data: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "c.yml"
        path.write_bytes(data)
        try:
            config = load(path)
        except ConfigError as error:
            lines = str(error).splitlines()
            assert lines
            assert all(line.startswith(f"{path}:") for line in lines)
        else:
            assert config.glider("never-heard-of").speed_min < config.glider("never-heard-of").speed_max


@given(st.binary(max_size=60) | st.text(max_size=60).map(lambda text: text.encode("utf-8", "surrogatepass")))
@SLOW_IS_FINE
def test_any_bytes(data: bytes) -> None:
    loads_or_says_why(data)


@given(st.lists(PIECES, max_size=14).map("".join))
@SLOW_IS_FINE
def test_pieces_of_yaml(text: str) -> None:
    loads_or_says_why(text.encode())


@given(st.integers(0, len(EXAMPLE)), st.integers(0, 12), PIECES)
@SLOW_IS_FINE
def test_a_damaged_example(at: int, cut: int, piece: str) -> None:
    loads_or_says_why((EXAMPLE[:at] + piece + EXAMPLE[at + cut :]).encode())


@given(st.dictionaries(st.sampled_from(list(Config.model_fields)), VALUES, max_size=6))
@SLOW_IS_FINE
def test_any_values_under_known_keys(data: dict[str, object]) -> None:
    with tempfile.TemporaryFile("w+", encoding="utf-8") as file:
        try:
            YAML(typ="safe", pure=True).dump(data, file)
        except UnicodeEncodeError:
            return
        file.seek(0)
        loads_or_says_why(file.read().encode())
