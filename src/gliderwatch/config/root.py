"""The whole of the settings, and the parameters of each glider that follow from them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import Field, PrivateAttr, SecretStr

from gliderwatch.config import references
from gliderwatch.config.document import Document
from gliderwatch.config.fields import GliderName, Name
from gliderwatch.config.section import Section
from gliderwatch.config.sections import Glider, Preset, Settings
from gliderwatch.config.service import (
    Channel,
    Dockserver,
    Heartbeat,
    Metrics,
    Ocean,
    Operator,
    Recipient,
    State,
)
from gliderwatch.errors import ConfigError
from gliderwatch.params import Attention, GliderParams

_OF_ONE = {"preset", *(Glider.model_fields.keys() - Settings.model_fields.keys())}
"""Keys that are not laid over those of `defaults`."""


class Config(Section):
    """The whole file. Made by `gliderwatch.config.load`."""

    dockserver: Dockserver = Field(description="Where files arrive.")
    ocean: Ocean = Field(default=Ocean(), description="An ocean model, for `reference: model`.")
    state: State = Field(default=State(), description="What gliderwatch remembers.")
    defaults: Settings = Field(default=Settings(), description="Settings of all gliders.")
    gliders: dict[GliderName, Glider] = Field(
        default_factory=dict,
        description="The gliders to watch, by name (as in the headers of their files; any case).",
    )
    channels: dict[Name, Channel] = Field(default_factory=dict, description="Ways to send messages.")
    recipients: dict[Name, Recipient] = Field(default_factory=dict, description="Who gets what.")
    operator: Operator = Field(default=Operator(), description="When the operator is told.")
    heartbeat: Heartbeat = Field(default=Heartbeat(), description="For a dead man's switch.")
    metrics: Metrics = Field(default=Metrics(), description="For Prometheus.")
    _document: Document = PrivateAttr(Document(Path("configuration"), None, {}))
    _presets: Mapping[str, Preset] = PrivateAttr(default_factory=dict)
    _known: dict[str, Settings] = PrivateAttr(default_factory=dict)

    def glider(self, name: str) -> GliderParams:
        """Parameters of a glider: built-in < preset < defaults < its own; defaults for an unknown one."""
        return self._of(name).params()

    def attention(self, name: str) -> Attention:
        """When a glider is spoken of that is silent or cannot be judged."""
        glider, settings = self.gliders.get(name.lower(), Glider()), self._of(name)
        return Attention(
            settings.overdue_hours,
            glider.muted_until,
            glider.recovered,
            settings.unknown_hours,
            settings.unknown_dives,
        )

    def locate(self, key: str) -> int:
        """The line of a dotted key (`channels.mail.url`, `dockserver.roots.0`) in the file."""
        return self._document.line(key)

    def bound_to(self, document: Document, presets: Mapping[str, Preset]) -> Config:
        """The same settings, knowing their file and the presets."""
        bound = self.model_copy()
        bound._document, bound._presets, bound._known = document, presets, {}
        return bound

    @property
    def folder(self) -> Path:
        """The folder of the file, where relative paths start."""
        return self._document.path.absolute().parent

    def channel_url(self, name: str) -> SecretStr:
        """The URL of a channel with its references filled in.

        Raises `ConfigError` naming the channel and the reference that cannot be had.
        """
        key = f"channels.{name}.url"
        try:
            url = references.resolve(self.channels[name].url.get_secret_value(), self.folder)
        except ConfigError as error:
            raise ConfigError(f"{self._document.path}:{self.locate(key)}: {key}: {error}") from None
        return SecretStr(url)

    def _of(self, name: str) -> Settings:
        """The settings of a glider, put together once: they are asked for with every file."""
        name = name.lower()
        if name not in self.gliders:
            return self._settings(Glider())
        if name not in self._known:
            self._known[name] = self._settings(self.gliders[name])
        return self._known[name]

    def _settings(self, glider: Glider) -> Settings:
        preset = self._presets.get(glider.preset or self.defaults.preset or "", Preset())
        merged: dict[str, Any] = {}
        for layer in (preset, self.defaults, glider):
            _merge(merged, layer.model_dump(exclude_unset=True, exclude=_OF_ONE))
        return Settings.model_validate(merged)


def _merge(into: dict[str, Any], layer: Mapping[str, Any]) -> None:
    """Lay one mapping over another, section by section, in place."""
    for key, value in layer.items():
        if isinstance(value, dict) and isinstance(into.get(key), dict):
            _merge(into[key], value)
        else:
            into[key] = value
