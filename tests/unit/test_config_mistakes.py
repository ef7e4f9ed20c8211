"""What each mistake in the settings says, on which line, and what to do."""

from __future__ import annotations

from pathlib import Path

import pytest

from config_support import MINIMAL, Write, problems

RECIPIENT = MINIMAL + "channels: {m: {url: 'json://h'}}\nrecipients:\n  a: {channels: [m]}\n"


def of_recipient(key: str) -> str:
    """A file whose fifth line is a key of a recipient."""
    return RECIPIENT.replace("a: {channels: [m]}", f"a:\n    {key}\n    channels: [m]")


def night(hours: str) -> str:
    """One whose fifth line is quiet hours."""
    return of_recipient(f"quiet_hours: {{{hours}}}")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("dockserver: {root: [/d]}", "1: dockserver.root: unknown key (did you mean `roots`?)"),
        ("dockserver: {root: [/d]}", "1: dockserver.roots: is missing (add `roots:`)"),
        ("state: {path: /s}", "1: dockserver: is missing (add `dockserver:`)"),
        ("dockserver:\n  roots:", "2: dockserver.roots: is missing (add `roots:`)"),
        ("dockserver:\n  roots: []", "2: dockserver.roots: holds too few items"),
        ("dockserver:\n  roots: /d", "2: dockserver.roots: must be a list (write `- ITEM` lines)"),
        ("dockserver:\n  roots:\n  - /d\n  - 3", "4: dockserver.roots.1: must be text (put it in quotes)"),
        ("dockserver: 3", "1: dockserver: must be a section (`key: value` lines below it)"),
        ("- a", "1: must be a section (`key: value` lines below it)"),
        (
            MINIMAL + "gliders: {a: {layers: {max_depth: 9, min_depth: 1, sensor: temprature}}}",
            "2: gliders.a.layers.sensor: is temperature, salinity, density, oxygen, or a name"
            " that begins with sci_",
        ),
        ("gliders: [electa]", "1: gliders: must be a section (`key: value` lines below it)"),
        (
            MINIMAL + "defaults: {zzzz: 1}",
            "2: defaults.zzzz: unknown key (known are: adaptive, battery, detection, estimator, health, "
            "neighbours, normal_speed, overdue_hours, preset, reference, rules, surfacing_hours, "
            "unknown_dives, unknown_hours)",
        ),
        (MINIMAL + "defaults: {paths: [/d]}", "2: defaults.paths: unknown key (known are: adaptive"),
        (MINIMAL + "stat: {}", "2: stat: unknown key (did you mean `state`?)"),
        (MINIMAL + "state:\n  path:\n  - /d", "3: state.path: must be text (put it in quotes)"),
        (
            MINIMAL.replace("]}", "],\n  observer: inotfy}"),
            "2: dockserver.observer: must be 'inotify' or 'polling'",
        ),
        (
            MINIMAL.replace("]}", "],\n\n  settle_seconds: 0.5}"),
            "3: dockserver.settle_seconds: must be greater than or equal to 1",
        ),
        (
            MINIMAL.replace("]}", "],\n  settle_seconds: '60'}"),
            "2: dockserver.settle_seconds: must be a number (write it without quotes or unit)",
        ),
        (
            MINIMAL.replace("]}", "],\n  settle_seconds: true}"),
            "2: dockserver.settle_seconds: must be a number (write it without quotes or unit)",
        ),
        (
            MINIMAL.replace("]}", "],\n  settle_seconds: .inf}"),
            "2: dockserver.settle_seconds: must be a finite number",
        ),
        (MINIMAL + "defaults: {adaptive:\n  {sigma: }}", "3: defaults.adaptive.sigma: must be a number"),
        (
            MINIMAL + "defaults: {adaptive:\n  {centres: [[1, 2], [3, 400]]}}",
            "3: defaults.adaptive.centres.1.1: must be less than or equal to 180",
        ),
        (
            MINIMAL + "defaults:\n  adaptive:\n    centres:\n    - [1, 2]\n    - [3]",
            "6: defaults.adaptive.centres.1.1: is missing (write two numbers)",
        ),
        (
            MINIMAL + "gliders:\n  a:\n    muted_until: soon",
            "4: gliders.a.muted_until: must be a date (2026-12-01) or a date and time in UTC (2026-12-01",
        ),
        (
            MINIMAL + "gliders: {a: {muted_until: 2026-02-30}}",
            "2: gliders.a.muted_until: is no date that exists: write 2026-12-01, or 2026-12-01 14:30",
        ),
        (MINIMAL + "gliders: {a: {muted_until: 20261201}}", "2: gliders.a.muted_until: must be a date"),
        (MINIMAL + "gliders: {a: {muted_until: 2026-W01}}", "2: gliders.a.muted_until: must be a date"),
        (
            MINIMAL + "ocean: {area: {soth: 3, north: 4, west: 5, east: 6}}",
            "2: ocean.area.soth: unknown key (did you mean `south`?)",
        ),
        (night("start: '22:00', end: '7:00'"), "5: recipients.a.quiet_hours.end: must be a time of day"),
        (night("start: 2200, end: '24:00'"), "5: recipients.a.quiet_hours.end: must be a time of day"),
        (night("start: 22:00, end: 22:00"), "5: recipients.a.quiet_hours: start and end are the same"),
        (night("start: 22:00"), "5: recipients.a.quiet_hours.end: is missing"),
        (
            night("start: 22:00, end: 07:00, below: info"),
            "5: recipients.a.quiet_hours.below: must be warning or critical",
        ),
        (
            night("start: 22:00, end: 07:00, time_zone: Europe/Amsterdm"),
            "5: recipients.a.quiet_hours.time_zone: there is no such time zone (did you mean Europe/Ams",
        ),
        (
            night("start: 22:00, end: 07:00, time_zone: ../../etc/passwd"),
            "5: recipients.a.quiet_hours.time_zone: there is no such time zone (write UTC, or a name as",
        ),
        (
            night("start: 22:00, end: 07:00, time_zone: Europe"),
            "5: recipients.a.quiet_hours.time_zone: there is no such time zone",
        ),
        (
            night("start: 22:00, end: 07:00, from: 1"),
            "5: recipients.a.quiet_hours.from: unknown key (known are: below",
        ),
        (
            of_recipient("unacknowledged_minutes: 0"),
            "5: recipients.a.unacknowledged_minutes: must be greater than 0",
        ),
        (MINIMAL + "gliders: {a: {recovered: 1}}", "2: gliders.a.recovered: must be true or false"),
        (MINIMAL + "gliders: {a: {recovered: }}", "2: gliders.a.recovered: must be true or false"),
        (MINIMAL + "defaults: {recovered: true}", "2: defaults.recovered: unknown key"),
        (MINIMAL + "defaults: {muted_until: 2026-12-01}", "2: defaults.muted_until: unknown key"),
        (MINIMAL + "gliders: {a: {overdue_hours: 0}}", "2: gliders.a.overdue_hours: must be greater than 0"),
        (MINIMAL + "defaults: {surfacing_hours: '3'}", "2: defaults.surfacing_hours: must be a number"),
        (
            MINIMAL + "defaults: {rules: {anomaly: {open_after: 1.5}}}",
            "2: defaults.rules.anomaly.open_after: must be a whole number",
        ),
        (
            MINIMAL + "defaults:\n  rules:\n    anomaly: {severity: loud}",
            "4: defaults.rules.anomaly.severity: must be info, warning or critical",
        ),
        (
            MINIMAL + "defaults:\n  rules:\n    false_alarm:\n      severity: critical",
            "5: defaults.rules.false_alarm.severity: must be info or warning",
        ),
        (
            MINIMAL + "gliders:\n  electa: {preset: usf-sm}",
            "3: gliders.electa.preset: there is no preset `usf-sm` (did you mean `usf-sam`?)",
        ),
        (
            MINIMAL + "gliders:\n  my glider:",
            "3: gliders.my glider: must be a name of letters, digits, `-` and `_`",
        ),
        (
            MINIMAL + "gliders:\n  '#2!':",
            '3: gliders."#2!": must be a name of letters, digits, `-` and `_`',
        ),
        (
            MINIMAL + "channels:\n  $mail: {url: json://x}",
            '3: channels."$mail": must be a name of letters, digits, `-` and `_`',
        ),
        (
            MINIMAL + "gliders:\n  Electa:\n  electa:",
            "4: gliders.electa: given twice (case aside) (keep one)",
        ),
        (
            MINIMAL + "channels:\n  mail:\n    uri: json://h",
            "4: channels.mail.uri: unknown key (did you mean `url`?)",
        ),
        (MINIMAL + "channels:\n  mail: {}", "3: channels.mail.url: is missing (add `url:`)"),
        (
            MINIMAL + "channels:\n  mail: {url: {fil: x}}",
            "3: channels.mail.url: must be a URL or {file: PATH}",
        ),
        (
            MINIMAL + "channels:\n  mail: {url: '${a b}'}",
            "3: channels.mail.url: a reference must be ${NAME}, ${file:PATH} or ${credential:NAME}",
        ),
        (MINIMAL + "channels:\n  mail: {url: 'a${x'}", "3: channels.mail.url: a reference must be"),
        (
            MINIMAL + "channels: {slack: {url: 'json://h'}}\nrecipients:\n  p:\n    channels: [slak]",
            "5: recipients.p.channels.0: `slak` is not under `channels` (did you mean `slack`?)",
        ),
        (
            MINIMAL + "recipients:\n  p:\n    channels: [mail]",
            "4: recipients.p.channels.0: `mail` is not under `channels` (add it under `channels`)",
        ),
        (
            MINIMAL + "gliders: {electa: }\nrecipients:\n  p:\n    channels: []\n    gliders: [elektra]",
            "6: recipients.p.gliders.0: `elektra` is not under `gliders` (did you mean `electa`?)",
        ),
        (
            MINIMAL + "gliders: {electa: }\nrecipients:\n  p:\n    surfacing:\n    - electa\n    - sam",
            "7: recipients.p.surfacing.1: `sam` is not under `gliders` (known are: electa)",
        ),
        (
            MINIMAL + "recipients: {p: {channels: [a], min_severity: 2}}",
            "2: recipients.p.min_severity: must be info, warning or critical",
        ),
        (
            MINIMAL + "defaults:\n  normal_speed: {min: 0.8}",
            "3: defaults.normal_speed: min 0.8 must be below max 0.75 m/s",
        ),
        (
            MINIMAL + "gliders:\n  a:\n    normal_speed: {min: 0.3, max: 0.3}",
            "4: gliders.a.normal_speed: min 0.3 must be below max 0.3 m/s",
        ),
        (
            MINIMAL + "gliders:\n  a:\n    preset: usf-sam\n    normal_speed: {min: 0.3}",
            "5: gliders.a.normal_speed: min 0.3 must be below max 0.25 m/s",
        ),
        (MINIMAL + "state: {path: '/a\\tb'}\nstate: {}", "3: state: given twice, first on line 2"),
        (MINIMAL + 'state: {path: "/a\\tb"}', "2: state.path: a line break or a control character"),
        (MINIMAL + "defaults: &d {}\ngliders:\n  a: *d", "4: gliders.a: YAML aliases (`*name`) are not used"),
        (MINIMAL + "state: !x {path: y}", "2: state: YAML tags (`!name`) are not used here"),
        (MINIMAL + "? [a]\n: 1", "2: a key that is not a word"),
        (MINIMAL + "defaults: {adaptive: {k: !!int x}}", "2: defaults.adaptive.k: not a number"),
    ],
)
def test_mistake_is_named_with_its_line_and_cure(write: Write, text: str, expected: str) -> None:
    found = problems(write(text))
    assert any(line.startswith(f"c.yml:{expected}") for line in found), found


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (MINIMAL + "state:\n\tpath: x", "3: a tab is used for indentation (indent with spaces)"),
        (MINIMAL + "state: path: x", "2: a `:` where none can stand"),
        (MINIMAL + "state: {path: x\nrecipients: {}", "2: a bracket is not closed"),
        (MINIMAL + "state: [x\ngliders: {}", "2: a bracket is not closed"),
        (MINIMAL + "state:\n  path: x\n gliders: {}", "4: the indentation is not that of the lines around"),
        (MINIMAL + "state: {path: 'x}\n", "2: a quote is not closed"),
        (MINIMAL + 'state: {path: "\\d"}', "2: an unknown `\\` in a quoted text"),
        (MINIMAL + "state: {path: @x}", "2: a value starts with a character that YAML reserves"),
        (MINIMAL + "state: {path: *x}", "2: a value starts with `*`"),
        (MINIMAL + "---\nstate: {}", "2: a second document begins"),
        (MINIMAL + "state\ngliders: {}", "2: a key without `:`"),
        (MINIMAL + "\n\x07", "3: a control character"),
        ("%YAML 9.9\n---\n" + MINIMAL, "1: not valid YAML"),
        ("[" * 5000, "1: nested too deeply"),
        ("", "1: the file is empty"),
        ("# nothing\n", "1: the file is empty"),
    ],
)
def test_what_is_no_yaml_says_what_to_do(write: Write, text: str, expected: str) -> None:
    found = problems(write(text))
    assert len(found) == 1
    assert found[0].startswith(f"c.yml:{expected}")
    assert found[0].endswith(")")


def test_all_mistakes_are_listed_in_the_order_of_the_file(write: Write) -> None:
    text = """\
dockserver:
  roots: 3
  observr: polling
gliders:
  a: {normal_speed: {min: 2, max: 1}, preset: x}
  a: {}
channels: {m: {url: "${"}}
recipients:
  p: {channels: [n]}
"""
    found = problems(write(text))
    assert [line.split(":")[1] for line in found] == ["2", "3", "5", "5", "6", "7", "9"]


def test_an_empty_range_of_the_defaults_is_named_once(write: Write) -> None:
    text = MINIMAL + "defaults:\n  normal_speed: {min: 0.8}\ngliders: {a: , b: {rules: }}\n"
    assert len(problems(write(text))) == 1


def test_a_file_that_cannot_be_read(tmp_path: Path) -> None:
    assert problems(tmp_path / "c.yml") == [
        "c.yml: cannot be read: No such file or directory (check the path and its permissions)"
    ]
    (tmp_path / "folder").mkdir()
    assert problems(tmp_path / "folder")[0].startswith("folder: cannot be read: Is a directory")
    (tmp_path / "latin.yml").write_bytes(b"# ok\nstate: {path: caf\xe9}\n")
    assert problems(tmp_path / "latin.yml") == ["latin.yml:2: not UTF-8 text (save the file as UTF-8)"]
