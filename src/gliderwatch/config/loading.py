"""Reading the settings: the whole of them, and the parameters of each glider, or every problem in one
`ConfigError`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from types import UnionType
from typing import TYPE_CHECKING, Any, get_args, get_origin

from pydantic import Field, PrivateAttr, SecretStr, TypeAdapter, ValidationError

from gliderwatch.config import secrets
from gliderwatch.config.document import Document, Problem, nearest, read, shown
from gliderwatch.config.fields import GliderName, Name, Section, limits_of
from gliderwatch.config.schema import (
    Ais,
    Channel,
    Dockserver,
    Export,
    FieldSetting,
    Glider,
    Heartbeat,
    Maps,
    Metrics,
    Ocean,
    Operator,
    Pages,
    Preset,
    Recipient,
    Relays,
    Settings,
    State,
    Web,
)
from gliderwatch.errors import ConfigError
from gliderwatch.health.rule import Limits
from gliderwatch.params import Attention, GliderParams

if TYPE_CHECKING:
    from gliderwatch.delivery import channels as delivery

# ----------------------------------------
# The whole of the settings, and the parameters of each glider that follow from them.

_OF_ONE = {"preset", *(Glider.model_fields.keys() - Settings.model_fields.keys())}
"""Keys that are not laid over those of `defaults`."""


class Config(Section):
    """The whole file. Made by `gliderwatch.config.load`."""

    dockserver: Dockserver = Field(description="Where files arrive.")
    ocean: Ocean = Field(default=Ocean(), description="An ocean model, for `reference: model` or `fleet`.")
    fields: dict[Name, FieldSetting] = Field(
        default_factory=dict, description="Fields that the gliders measure together."
    )
    relays: Relays = Field(default=Relays(), description="Other dockservers, over an MQTT broker.")
    state: State = Field(default=State(), description="What gliderwatch remembers.")
    defaults: Settings = Field(default=Settings(), description="Settings of all gliders.")
    gliders: dict[GliderName, Glider] = Field(
        default_factory=dict,
        description="The gliders to watch, by name (as in the headers of their files; any case).",
    )
    channels: dict[Name, Channel] = Field(default_factory=dict, description="Ways to send messages.")
    recipients: dict[Name, Recipient] = Field(default_factory=dict, description="Who gets what.")
    operator: Operator = Field(default=Operator(), description="When the operator gets a message.")
    heartbeat: Heartbeat = Field(default=Heartbeat(), description="For a dead man's switch.")
    metrics: Metrics = Field(default=Metrics(), description="For Prometheus.")
    maps: Maps = Field(default=Maps(), description="Finer maps.")
    pages: Pages = Field(default=Pages(), description="Pages for pilots as files.")
    export: Export = Field(default=Export(), description="Files for other programs.")
    ais: Ais = Field(default=Ais(), description="Virtual AIS.")
    web: Web = Field(default=Web(), description="The pages live.")
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
            settings.neighbours,
        )

    def health(self, name: str) -> Mapping[str, Limits]:
        """The limits of the rules of health of a glider, but for rules that are off."""
        settings, glider = self._of(name), self.gliders.get(name.lower(), Glider())
        return limits_of(settings.health, glider.recovery, settings.battery)

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
        return SecretStr(self.secret(f"channels.{name}.url", self.channels[name].url))

    def secret(self, key: str, template: SecretStr) -> str:
        """What stands at a key, with its references filled in.

        Raises `ConfigError` naming the key and the reference that cannot be had.
        """
        try:
            return secrets.resolve(template.get_secret_value(), self.folder)
        except ConfigError as error:
            raise ConfigError(f"{self._document.path}:{self.locate(key)}: {key}: {error}") from None

    def channel(self, name: str, illustrator: delivery.Illustrator | None = None) -> delivery.Channel:
        """A channel by which messages can be sent, its mails with pictures where there is who draws them;
        every option of its section goes to it by name.

        Raises `ConfigError` as `channel_url`.
        """
        from gliderwatch.delivery import channels  # noqa: PLC0415 (most commands send nothing)

        options = self.channels[name].model_dump(exclude={"url"})
        return channels.Channel(name, self.channel_url(name).get_secret_value(), illustrator, **options)

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


# ----------------------------------------
# Reading the settings: every problem of the file in one `ConfigError`.

_PRESETS = dict[str, Preset]
_WORDS = {
    "extra_forbidden": "unknown key",
    "missing": "is missing",
    "model_type": "must be a section (`key: value` lines below it)",
    "dict_type": "must be a section (`key: value` lines below it)",
    "tuple_type": "must be a list",
    "too_long": "holds too many items",
    "too_short": "holds too few items",
    "string_type": "must be text",
    "string_pattern_mismatch": "must be a name of letters, digits, `-` and `_`",
    "float_type": "must be a number",
    "int_type": "must be a whole number",
}
_CURES = {
    "tuple_type": "write `- ITEM` lines",
    "string_type": "put it in quotes",
    "float_type": "write it without quotes or unit",
    "int_type": "write it without quotes or unit",
}


def load(path: Path) -> Config:
    """Read, check and resolve the settings.

    Secrets are left unresolved: see `Config.channel_url`.

    Raises `ConfigError` with one line for each problem, `FILE:LINE: key: what is wrong (cure)`.
    """
    document, problems = _with_lower_gliders(read(Path(path)))
    if document.data is None and not problems:
        raise ConfigError(f"{path}:1: the file is empty (copy config/gliderwatch.yml and edit it)")
    presets = _presets()
    problems += _unknown_names(document, presets)
    problems += _empty_ranges(document, presets)
    config = None
    try:
        config = Config.model_validate(document.data, context={"base": document.path.absolute().parent})
    except ValidationError as error:
        problems += _explain(error, Config, document)
    if config is None or problems:  # not raised above: a traceback must not show what pydantic saw
        raise ConfigError(_listed(problems))
    return config.bound_to(document, presets)


def presets_path() -> Path:
    """The presets file: beside this module in a wheel, in `config/` of a checkout."""
    installed = Path(__file__).with_name("presets.yml")
    return installed if installed.is_file() else Path(__file__).parents[3] / "config" / "presets.yml"


def _presets() -> Mapping[str, Preset]:
    document = read(presets_path())
    problems = list(document.problems)
    presets: dict[str, Preset] = {}
    try:
        presets = TypeAdapter(_PRESETS).validate_python(document.data or {})
    except ValidationError as error:
        problems += _explain(error, _PRESETS, document)
    if problems:
        raise ConfigError(_listed(problems))
    return presets


def _listed(problems: Iterable[Problem]) -> str:
    """Problems one per line, in the order of the file."""
    lines = {str(problem): int(problem.where.rpartition(":")[2]) for problem in problems}
    return "\n".join(sorted(lines, key=lambda text: lines[text]))


def _with_lower_gliders(document: Document) -> tuple[Document, list[Problem]]:
    """The document with the names of gliders in lower case; two names that become one are a problem."""
    problems = list(document.problems)
    gliders: dict[str, Any] = {}
    for name, settings in _section(document, "gliders").items():
        if name.lower() in gliders:
            problems.append(document.error(("gliders", name), "given twice (case aside)", "keep one"))
        gliders.setdefault(name.lower(), settings)
    if not gliders:
        return document, problems
    lines: dict[str, int] = {}
    for key, line in document.lines.items():
        parts = key.split(".")
        if parts[0] == "gliders" and len(parts) > 1:
            parts[1] = parts[1].lower()
        lines.setdefault(".".join(parts), line)
    return replace(document, data={**document.data, "gliders": gliders}, lines=lines), problems


def _section(document: Document, name: str) -> dict[str, Any]:
    data = document.data.get(name) if isinstance(document.data, dict) else None
    return data if isinstance(data, dict) else {}


def _explain(error: ValidationError, root: Any, document: Document) -> Iterator[Problem]:
    """The findings of pydantic in the user's words; what was found is not repeated."""
    for found in error.errors(include_url=False, include_input=False):
        kind = found["type"]
        parts = [str(part) for part in found["loc"] if part != "[key]"]
        text = _WORDS.get(kind) or found["msg"].removeprefix("Value error, ")
        text = text.replace("Input should be", "must be").replace("String should", "must")
        cure = _CURES.get(kind, "")
        if kind == "extra_forbidden":
            cure = nearest(parts[-1], _known_keys(root, parts[:-1]))
        elif kind == "missing":
            cure = "write two numbers" if parts[-1].isdigit() else f"add `{parts[-1]}:`"
        yield document.error(parts, text, cure)


def _known_keys(annotation: Any, parts: list[str]) -> list[str]:
    """The keys of the section at a place."""
    for part in parts:
        if get_origin(annotation) is dict:
            annotation = get_args(annotation)[1]
        else:
            annotation = annotation.model_fields[part].annotation
        choices = [
            kind for kind in get_args(annotation) if isinstance(kind, type) and issubclass(kind, Section)
        ]
        if get_origin(annotation) is UnionType and choices:
            annotation = choices[0]
    return list(annotation.model_fields) if issubclass(annotation, Section) else []


def _unknown_names(document: Document, presets: Mapping[str, Preset]) -> Iterator[Problem]:
    """Names of channels, gliders and presets that are not there."""
    gliders, channels = _section(document, "gliders"), _section(document, "channels")
    for name, recipient in _section(document, "recipients").items():
        for key, section, known in (
            ("channels", "channels", channels),
            ("gliders", "gliders", gliders),
            ("surfacing", "gliders", gliders),
        ):
            items = recipient.get(key) if isinstance(recipient, dict) else None
            for i, item in enumerate(items if isinstance(items, list) else ()):
                word = item.lower() if section == "gliders" and isinstance(item, str) else item
                if isinstance(word, str) and word not in known:
                    cure = nearest(word, known) or f"add it under `{section}`"
                    text = f"`{shown(item)}` is not under `{section}`"
                    yield document.error(("recipients", name, key, str(i)), text, cure)
    for parts, settings in _settings(document):
        preset = settings.get("preset")
        if isinstance(preset, str) and preset not in presets:
            cure = nearest(preset, presets) or "remove it"
            yield document.error((*parts, "preset"), f"there is no preset `{shown(preset)}`", cure)


def _settings(document: Document) -> Iterator[tuple[tuple[str, ...], dict[str, Any]]]:
    """The defaults and each glider's settings, with their place."""
    yield ("defaults",), _section(document, "defaults")
    for name, settings in _section(document, "gliders").items():
        yield ("gliders", name), settings if isinstance(settings, dict) else {}


def _empty_ranges(document: Document, presets: Mapping[str, Preset]) -> Iterator[Problem]:
    """Ranges of speed that are empty once presets and defaults are counted in."""
    defaults = _section(document, "defaults")
    for parts, settings in _settings(document):
        if not settings.keys() & {"normal_speed", "preset"}:
            continue  # as the defaults, which have their own line
        preset = presets.get(str(settings.get("preset") or defaults.get("preset")), Preset())
        speed = preset.normal_speed.model_dump()
        for layer in (defaults, settings):
            given = layer.get("normal_speed")
            speed |= given if isinstance(given, dict) else {}
        low, high = speed["min"], speed["max"]
        if isinstance(low, int | float) and isinstance(high, int | float) and low >= high:
            text = f"min {low:g} must be below max {high:g} m/s"
            yield document.error((*parts, "normal_speed"), text, "what is left out comes from the defaults")
