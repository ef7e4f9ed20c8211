"""References in a channel's URL are filled in, and no secret ever shows."""

from __future__ import annotations

import os
import traceback
from pathlib import Path

import pytest
from pydantic import ValidationError

from config_support import MINIMAL, Write
from gliderwatch.config import Config, load
from gliderwatch.errors import ConfigError

SECRET = "s3cr3t-w0rd"


def url_of(write: Write, url: str) -> str:
    config = load(write(MINIMAL + f"channels:\n  mail:\n    url: {url}\n"))
    return config.channel_url("mail").get_secret_value()


def test_url_from_environment_file_and_credential(
    write: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLACK", "slack://T0/B0/x")
    monkeypatch.setenv("CREDENTIALS_DIRECTORY", str(tmp_path / "credentials"))
    (tmp_path / "credentials").mkdir()
    (tmp_path / "credentials" / "smtp-password").write_text("from systemd\n")
    (tmp_path / "token").write_text("A/B/C\n")
    (tmp_path / "url").write_text("json://host/x?y=z\n")
    assert url_of(write, "${SLACK}") == "slack://T0/B0/x"
    assert url_of(write, "'slack://${file:token}/#pilots'") == "slack://A/B/C/#pilots"
    assert url_of(write, f"'slack://${{file:{tmp_path}/token}}'") == "slack://A/B/C"
    assert url_of(write, "{file: url}") == "json://host/x?y=z"
    assert url_of(write, "mailtos://me:${credential:smtp-password}@h") == "mailtos://me:from%20systemd@h"


@pytest.mark.parametrize(
    ("template", "expected"),
    [
        ("mailtos://me:${V}@h.org?to=a@b.org", "mailtos://me:p%40%2F%3A%25%23%3F@h.org?to=a@b.org"),
        ("mailtos://${V}:${V}@h", "mailtos://p%40%2F%3A%25%23%3F:p%40%2F%3A%25%23%3F@h"),
        ("mailtos://h?pass=${V}&to=a@b.org", "mailtos://h?pass=p%40%2F%3A%25%23%3F&to=a@b.org"),
        ("json://h/x?pass=${V}&y=z", "json://h/x?pass=p%40%2F%3A%25%23%3F&y=z"),
        ("json://h/${V}/a@b", "json://h/p@/:%#?/a@b"),
        ("json://${V}/a@b", "json://p@/:%#?/a@b"),
        ("${V}", "p@/:%#?"),
    ],
)
def test_only_login_and_query_values_are_encoded(
    write: Write, monkeypatch: pytest.MonkeyPatch, template: str, expected: str
) -> None:
    monkeypatch.setenv("V", "p@/:%#?")
    assert url_of(write, template) == expected


@pytest.mark.parametrize(
    ("reference", "expected"),
    [
        ("${UNSET_HERE}", "environment variable UNSET_HERE is not set"),
        ("${EMPTY_HERE}", "environment variable EMPTY_HERE must hold one line of text"),
        ("${file:/no/such}", "file /no/such cannot be read: No such file or directory"),
        ("${file:two}", "file two must hold one line of text"),
        ("${file:binary}", "file binary cannot be read: not UTF-8 text"),
        ("${file:/dev/zero}", "file /dev/zero is no regular file: put the secret into one"),
        ("${file:fifo}", "file fifo is no regular file: put the secret into one"),
        ("${file:huge}", "file huge is larger than 64 kB: it must hold one line of text"),
        ("${file:.}", "file . cannot be read: Is a directory"),
        ("${credential:x}", "credential x is not there: systemd did not set CREDENTIALS_DIRECTORY"),
    ],
)
def test_a_reference_that_cannot_be_had_names_channel_and_line(
    write: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, reference: str, expected: str
) -> None:
    monkeypatch.setenv("EMPTY_HERE", " ")
    monkeypatch.delenv("CREDENTIALS_DIRECTORY", raising=False)
    (tmp_path / "two").write_text(f"{SECRET}\n{SECRET}\n")
    (tmp_path / "huge").write_text(SECRET * 100_000)
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "binary").write_bytes(SECRET.encode() + b"\xff")
    path = write(MINIMAL + f"channels:\n  mail:\n    url: json://u:{SECRET}@h/{reference}\n")
    with pytest.raises(ConfigError) as caught:
        load(path).channel_url("mail")
    assert str(caught.value) == f"{path}:4: channels.mail.url: {expected}"


def test_secrets_are_masked(write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PASSWORD", SECRET)
    config = load(
        write(
            MINIMAL
            + f"channels:\n  a: {{url: 'mailtos://u:{SECRET}@h'}}\n  b: {{url: 'mailtos://u:${{PASSWORD}}@h'}}\n"
        )
    )
    shown = [repr(config), str(config), config.model_dump_json(), repr(config.model_dump())]
    shown += [repr(config.channel_url("b")), str(config.channel_url("a"))]
    assert not [text for text in shown if SECRET in text]
    assert SECRET in config.channel_url("a").get_secret_value()
    assert SECRET in config.channel_url("b").get_secret_value()


URL = f"mailtos://user:{SECRET}@smtp.example.{SECRET}"


@pytest.mark.parametrize(
    "text",
    [
        f"channels: {{m: {URL}}}",
        f"channels: {{m: {{{URL}}}}}",
        f"channels: {{m: [{URL}]}}",
        f"channels: {{m: {{url: [{URL}]}}}}",
        f"channels: {{m: {{url: {{{URL}: x}}}}}}",
        f"channels: {{'{URL}': {{url: 3}}}}",
        f"channels: {{'{URL}': {{url: x}}, '{URL}': {{url: x}}}}",
        f"channels: {{m: {{url: '{URL}${{x'}}}}",
        f"channels: {{m: {{url: '{URL}${{{SECRET}!}}'}}}}",
        f"channels: {{m: {{url: x, '{URL}': 1}}}}",
        f"channels: {{m: {{url: !{SECRET} x}}}}",
        f"channels: {{m: {{url: *{SECRET}}}}}",
        f"channels: {{m: {{url: '{URL}}}}}",
        f"channels:\n  m:\n    url: x: {SECRET}",
        f'channels: {{m: {{url: "{URL}\\t"}}}}',
        f"recipients: {{p: {{channels: ['{URL}']}}}}",
        f"recipients: {{p: {{channels: '{URL}'}}}}",
        f"gliders: {{a: {{preset: '{URL}'}}}}",
        f"dockserver: {{observer: '{URL}'}}",
        f"gliders: {{'{URL}': }}",
        f"gliders: {{'T0A1B2C3D/B0A1B2C3D/{SECRET}{SECRET}': }}",
        f"'{URL}': x",
        URL,
    ],
)
def test_a_url_in_the_wrong_place_is_not_repeated(write: Write, text: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load(write(text + "\n"))
    shown = "".join(traceback.format_exception(caught.value))
    assert SECRET not in shown
    assert "c.yml:" in str(caught.value)


def test_pydantic_does_not_repeat_a_url_either() -> None:
    with pytest.raises(ValidationError) as caught:
        Config.model_validate({"dockserver": {"roots": ["/data"]}, "channels": {"m": URL}})
    assert SECRET not in str(caught.value)
