"""Settings: what loads, who wins, and where each key stands."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import pytest

from config_support import MINIMAL, Write, problems
from gliderwatch.config import Config, load
from gliderwatch.config.loading import presets_path
from gliderwatch.config.schema import Adaptive, Anomaly, FalseAlarm
from gliderwatch.model import Severity
from gliderwatch.params import AnomalyRule, Attention, FalseAlarmRule, GliderParams, LearnerParams
from gliderwatch.pipeline import digest

EXAMPLE = Path(__file__).resolve().parents[2] / "config" / "gliderwatch.yml"


@pytest.fixture
def presets(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Write:
    def _presets(text: str) -> Path:
        path = tmp_path / "presets.yml"
        path.write_text(text, encoding="utf-8")
        monkeypatch.setattr("gliderwatch.config.loading.presets_path", lambda: path)
        return path

    return _presets


# --------------------------------------------------------------------------- what loads


def test_minimal_file_has_the_documented_defaults(write: Write) -> None:
    config = load(write(MINIMAL))
    dockserver = config.dockserver
    assert dockserver.roots == ("/data",)
    assert (dockserver.settle_seconds, dockserver.rescan_seconds, dockserver.observer) == (60, 300, "inotify")
    assert config.glider("never-heard-of") == GliderParams()
    assert (config.gliders, config.channels, config.recipients) == ({}, {}, {})


def test_built_in_gains_are_those_of_franklin_with_a_threshold_that_can_be_exceeded(write: Write) -> None:
    params = load(write(MINIMAL)).glider("electa")
    learner = params.learner
    assert (learner.sigma, learner.k, learner.gamma) == (13e3, 0.003, 5e-7)
    assert (learner.kernel, params.gamma_f, learner.speed_gain) == ("exponential", 0.3, None)
    assert (params.speed_min, params.speed_max) == (0.15, 0.75)


def test_shipped_example_loads() -> None:
    config = load(EXAMPLE)
    assert set(config.gliders) == {"electa", "unit_595"}
    assert config.glider("electa") == GliderParams()
    assert config.glider("unit_595").speed_max == 0.30


def test_sections_and_lists_without_lines_count_as_left_out(write: Write) -> None:
    text = (
        MINIMAL.replace("]}", "], cache: }")
        + "state:\ndefaults:\ngliders:\n  electa:\nchannels:\nrecipients:\n"
    )
    config = load(write(text))
    assert config.dockserver.cache == ()
    assert config.glider("electa") == GliderParams()


def test_paths_start_at_the_folder_of_the_file(write: Write, tmp_path: Path) -> None:
    config = load(write("dockserver: {roots: [gliders, '../*/x']}\nstate: {path: state.sqlite}\n"))
    assert config.dockserver.roots == (f"{tmp_path}/gliders", f"{tmp_path.parent}/*/x")
    assert config.state.path == f"{tmp_path}/state.sqlite"


def test_paths_in_the_home_folder(write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", "/home/pilot")
    assert load(write("dockserver: {roots: [~/gliders]}")).dockserver.roots == ("/home/pilot/gliders",)


def test_names_of_gliders_are_matched_in_lower_case_and_may_look_like_other_things(write: Write) -> None:
    text = MINIMAL + (
        "gliders:\n  Electa: {normal_speed: {max: 0.4}}\n  2024:\n  null:\n"
        "channels: {a: {url: 'json://h'}}\n"
        "recipients: {p: {channels: [a], gliders: [ELECTA, '2024'], surfacing: [eleCta]}}\n"
    )
    config = load(write(text))
    assert set(config.gliders) == {"electa", "2024", "null"}
    assert config.glider("ELECTA").speed_max == 0.4
    assert config.recipients["p"].gliders == ("electa", "2024")
    assert config.recipients["p"].surfacing == ("electa",)


def test_recipients(write: Write) -> None:
    text = MINIMAL + (
        "channels: {a: {url: 'json://h'}}\n"
        "recipients: {all: {channels: [a]}, loud: {channels: [a], gliders: [], min_severity: critical}}\n"
    )
    everyone, loud = load(write(text)).recipients.values()
    assert (everyone.gliders, everyone.min_severity, everyone.surfacing) == (None, Severity.WARNING, ())
    assert (loud.gliders, loud.min_severity) == ((), Severity.CRITICAL)


def test_config_is_frozen(write: Write) -> None:
    with pytest.raises(ValueError, match="frozen"):
        load(write(MINIMAL)).dockserver.settle_seconds = 1.0  # type: ignore[misc]


# --------------------------------------------------------------------------- who wins


LAYERED = (
    MINIMAL
    + """\
defaults:
  preset: slow
  adaptive: {k: 0.004, sigma: 2.0e+3}
  rules: {anomaly: {open_after: 3}}
gliders:
  plain:
  own:
    normal_speed: {max: 0.4}
    estimator: joint
    adaptive: {k: 0.005, speed_gain: null, centres: [[27, -83.5]]}
    rules: {anomaly: {clear_after: 5}, reminder_hours: null}
  other: {preset: fast, normal_speed: {min: 0.5}}
"""
)
TWO_PRESETS = """\
slow:
  normal_speed: {min: 0.1, max: 0.2}
  estimator: adaptive
  adaptive: {k: 0.001, gamma: 1.0e-6, speed_gain: 2.0e-6}
  detection: {gamma_f: 0.5}
fast: {normal_speed: {min: 0.4, max: 0.9}, adaptive: {nu: 1, kernel: gaussian}}
"""


def test_precedence(write: Write, presets: Write) -> None:
    presets(TWO_PRESETS)
    config = load(write(LAYERED))
    plain, own, other = (config.glider(name) for name in ("plain", "own", "other"))
    assert plain == config.glider("never-heard-of")

    # built-in < preset < defaults
    assert (plain.speed_min, plain.speed_max) == (0.1, 0.2)
    assert plain.learner == LearnerParams(sigma=2e3, k=0.004, gamma=1e-6, speed_gain=2e-6)
    assert (plain.estimator, plain.gamma_f, plain.speed_learnt) == ("adaptive", 0.5, False)
    assert plain.rules.anomaly == AnomalyRule(open_after=3)

    # < glider, key by key; null is a value
    assert (own.speed_min, own.speed_max) == (0.1, 0.4)
    assert (own.estimator, own.learner.k, own.learner.sigma, own.learner.gamma) == (
        "joint",
        0.005,
        2e3,
        1e-6,
    )
    assert own.learner.speed_gain is None
    assert own.learner.centres == ((27.0, -83.5),)
    assert own.rules.anomaly == AnomalyRule(open_after=3, clear_after=5)
    assert own.rules.reminder_hours is None

    # the glider's preset replaces that of the defaults, whose explicit keys win over either
    assert (other.speed_min, other.speed_max) == (0.5, 0.9)
    assert other.learner == LearnerParams(kernel="gaussian", sigma=2e3, k=0.004, nu=1.0)


def test_every_parameter_has_its_key() -> None:
    for section, params in (
        (Adaptive, LearnerParams),
        (Anomaly, AnomalyRule),
        (FalseAlarm, FalseAlarmRule),
    ):
        assert set(section.model_fields) == {field.name for field in fields(params)}
        assert params(**dict(section())) == params()


def test_no_presets(write: Write, presets: Write) -> None:
    presets("# none yet\n")
    assert load(write(MINIMAL)).glider("never-heard-of") == GliderParams()
    assert problems(write(MINIMAL + "defaults: {preset: x}\n")) == [
        "c.yml:2: defaults.preset: there is no preset `x` (remove it)"
    ]


def test_a_broken_presets_file_is_named(write: Write, presets: Write) -> None:
    presets("slow:\n  adaptive: {sgma: 3}\n")
    assert problems(write(MINIMAL)) == [
        "presets.yml:2: slow.adaptive.sgma: unknown key (did you mean `sigma`?)"
    ]


def test_every_shipped_preset_loads(write: Write) -> None:
    assert presets_path() == EXAMPLE.with_name("presets.yml")
    config = load(write(MINIMAL + "defaults: {preset: franklin}\n"))
    assert set(config._presets) == {"franklin", "usf-sam", "usf-gansett", "usf-stella"}
    assert (config.glider("never-heard-of").speed_min, config.glider("never-heard-of").speed_max) == (
        0.15,
        0.25,
    )


def test_locate_gives_the_line_of_a_key_or_of_what_it_belongs_to(write: Write) -> None:
    config = load(write("dockserver:\n  roots:\n  - /a\n  - /b\ngliders:\n  Electa:\n    rules: {}\n"))
    lines = {
        key: config.locate(key) for key in ("dockserver.roots.1", "gliders.electa", "gliders.electa.rules")
    }
    assert list(lines.values()) == [4, 6, 7]
    assert config.locate("gliders.electa.rules.anomaly.open_after") == 7
    assert config.locate("recipients") == 1


@pytest.mark.parametrize("package", ["apprise", "scipy"])
def test_no_command_loads_what_is_slow_and_seldom_used(write: Write, package: str) -> None:
    code = (
        "from sys import *; import gliderwatch.cli.main; from gliderwatch.config import load; load(argv[1]); "
        "print(argv[2] in modules)"
    )
    command = [sys.executable, "-c", code, str(write(MINIMAL)), package]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


def test_a_config_made_without_a_file_works() -> None:
    config = Config.model_validate({"dockserver": {"roots": ["/data"]}})
    assert config.glider("electa") == GliderParams()
    assert config.locate("dockserver.roots") == 1


# --------------------------------------------------------------------------- silence


def test_silence_is_as_the_glider_says_else_as_the_defaults(write: Write) -> None:
    text = "defaults: {overdue_hours: 5, surfacing_hours: 6}\n"
    text += "gliders:\n  a: {overdue_hours: 2}\n  b:\n  c: {overdue_hours: }"
    config = load(write(MINIMAL + text))
    assert [config.attention(g).overdue_hours for g in "abcd"] == [2, 5, None, 5]
    assert config.glider("a").surfacing_hours == 6
    assert load(write(MINIMAL)).attention("a") == Attention()


@pytest.mark.parametrize(
    ("written", "seconds"),
    [
        ("2026-12-01", 1796083200),
        ("2026-12-01 14:30", 1796135400),
        ("'2026-12-01T14:30Z'", 1796135400),
        ("2026-12-01T14:30:00+02:00", 1796128200),
        ("", None),
    ],
)
def test_a_mute_ends_at_a_time_in_utc(write: Write, written: str, seconds: float | None) -> None:
    config = load(write(MINIMAL + f"gliders: {{A: {{muted_until: {written}}}}}"))
    assert config.attention("a").muted_until == seconds


def test_who_is_quiet_is_estimated_alike(write: Write) -> None:
    """Nothing of a mute or a recovery goes into the parameters, whose hash each assessment carries."""
    quiet = "gliders: {a: {muted_until: 2026-12-01, recovered: true, overdue_hours: 2}}"
    config = load(write(MINIMAL + quiet))
    assert digest(config.glider("a")) == digest(load(write(MINIMAL)).glider("a"))
    assert config.attention("a").is_quiet(2e9) and not config.attention("b").is_quiet(0.0)


def test_a_mute_is_over_when_it_ends() -> None:
    assert [Attention(muted_until=100.0).is_quiet(t) for t in (99.9, 100.0)] == [True, False]
