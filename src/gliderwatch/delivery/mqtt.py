"""The connection to an MQTT broker (version 5): topics that other relays read and write.

paho works in a thread of its own and connects again by itself; its news go to callbacks that must not wait.
"""

from __future__ import annotations

import secrets
import ssl
import sys
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote, urlsplit

from gliderwatch.errors import GliderwatchError

if TYPE_CHECKING:
    from paho.mqtt.client import Client

PORTS = {"mqtt": 1883, "mqtts": 8883}
SESSION = 30 * 86400
"""s for which the broker keeps messages for a relay that is away."""
LONGEST_RETRY = 60
"""s between two attempts to connect at the most."""
ANSWER = 10.0
"""s within which a broker has to answer the doctor."""
_ONCE_AT_LEAST = 1
_LOST = {
    "Session taken over": "another relay has the same name: give each its own (relays.name)",
    "Unspecified error": "the connection was lost",
}
"""Plainer words for some reasons of a disconnection (MQTT 5)."""


@dataclass(frozen=True, slots=True)
class Broker:
    """Where a broker is, and as whom to log in there; ``ca`` is a file of certificates to trust instead of
    those of the system."""

    host: str
    port: int
    is_tls: bool
    user: str | None = None
    password: str | None = field(default=None, repr=False)
    ca: str | None = None

    @property
    def place(self) -> str:
        """Host and port."""
        return f"{self.host}:{self.port}"


@dataclass(frozen=True, slots=True)
class Ears:
    """Who is called, in the thread of the connection: with whether it is ``up`` and why not, with the topic
    and content of what ``came``, and with the number of a message that was ``sent`` and why it was refused
    (empty: it was taken)."""

    up: Callable[[bool, str], None]
    came: Callable[[str, bytes], None]
    sent: Callable[[int, str], None]


def broker_of(url: str, ca: str | None = None) -> Broker:
    """The broker of a URL, `mqtt://[USER:PASSWORD@]HOST[:PORT]` or `mqtts://...`. Raises ValueError, without
    any part of the URL in it."""
    try:
        parts = urlsplit(url)
        port = parts.port
    except ValueError:
        raise ValueError("must be mqtt://[USER:PASSWORD@]HOST[:PORT] or mqtts://...") from None
    if parts.scheme not in PORTS or not parts.hostname or parts.path.strip("/") or parts.query:
        raise ValueError("must be mqtt://[USER:PASSWORD@]HOST[:PORT] or mqtts://...")
    user, password = (None if each is None else unquote(each) for each in (parts.username, parts.password))
    is_tls = parts.scheme == "mqtts"
    if ca is not None and not is_tls:
        raise ValueError("must begin with mqtts:// where there is a `ca`")
    return Broker(parts.hostname, port or PORTS[parts.scheme], is_tls, user, password, ca)


class Connection:
    """A lasting connection under a name that no other has: the broker keeps what comes while it is away."""

    def __init__(self, broker: Broker, name: str, topics: Sequence[str], ears: Ears) -> None:
        self._client = _client(broker, f"gliderwatch-{name}")
        self._broker, self._topics, self._ears = broker, tuple(topics), ears
        self._refused = False
        self._client.on_connect = self._on_connect
        self._client.on_connect_fail = self._on_failure
        self._client.on_disconnect = self._on_disconnect
        self._client.on_message = lambda _client, _data, m: ears.came(m.topic, bytes(m.payload))
        self._client.on_publish = lambda _client, _data, number, code, _properties: ears.sent(
            number, str(code) if code.is_failure else ""
        )

    def start(self) -> None:
        """Connect, in the background, again and again."""
        _connect(self._client, self._broker, SESSION)
        self._client.loop_start()

    def stop(self) -> None:
        """End the connection."""
        self._client.disconnect()
        self._client.loop_stop()

    def publish(self, topic: str, data: bytes, *, is_kept: bool = False) -> int:
        """Hand a message over, at least once; its number. ``is_kept``: the broker gives the last one of the
        topic to all who come later."""
        return self._client.publish(topic, data, _ONCE_AT_LEAST, retain=is_kept).mid

    def _on_connect(self, client: Any, _data: Any, _flags: Any, code: Any, _properties: Any) -> None:
        from paho.mqtt.subscribeoptions import SubscribeOptions  # noqa: PLC0415 (an extra)

        self._refused = code.is_failure
        if code.is_failure:
            self._ears.up(False, str(code))
            return
        client.subscribe([(t, SubscribeOptions(_ONCE_AT_LEAST, noLocal=True)) for t in self._topics])
        self._ears.up(True, "")

    def _on_failure(self, _client: Any, _data: Any) -> None:
        self._ears.up(False, _words(sys.exc_info()[1]))

    def _on_disconnect(self, _client: Any, _data: Any, _flags: Any, code: Any, _properties: Any) -> None:
        # A broker that refuses closes the connection then: the reason is the one that it gave before.
        if not self._refused:
            self._ears.up(False, _LOST.get(str(code), str(code)) if code.is_failure else "")


def reach(broker: Broker) -> str | None:
    """Why a broker lets nobody in; None: it does. For the doctor: it waits."""
    done, found = threading.Event(), ["no answer"]

    def on_connect(_client: Any, _data: Any, _flags: Any, code: Any, _properties: Any) -> None:
        found[0] = str(code) if code.is_failure else ""
        done.set()

    def on_connect_fail(_client: Any, _data: Any) -> None:
        found[0] = _words(sys.exc_info()[1])
        done.set()

    client = _client(broker, f"gliderwatch-doctor-{secrets.token_hex(6)}")
    client.on_connect, client.on_connect_fail = on_connect, on_connect_fail
    _connect(client, broker, 0)
    client.loop_start()
    done.wait(ANSWER)
    client.disconnect()
    client.loop_stop()
    return found[0] or None


def _client(broker: Broker, identity: str) -> Client:
    """Raises GliderwatchError where paho is not installed, or the certificates cannot be read."""
    try:
        from paho.mqtt.client import Client  # noqa: PLC0415 (an extra)
        from paho.mqtt.enums import CallbackAPIVersion, MQTTProtocolVersion  # noqa: PLC0415
    except ImportError as error:
        raise GliderwatchError(f"{error.name} is not installed: docs/install.md says how") from None
    client = Client(CallbackAPIVersion.VERSION2, identity, protocol=MQTTProtocolVersion.MQTTv5)
    if broker.user is not None:
        client.username_pw_set(broker.user, broker.password)
    if broker.is_tls:
        try:
            client.tls_set_context(ssl.create_default_context(cafile=broker.ca))
        except OSError as error:
            raise GliderwatchError(f"{broker.ca} cannot be used as relays.ca: {_words(error)}") from None
    client.reconnect_delay_set(1, LONGEST_RETRY)
    return client


def _connect(client: Client, broker: Broker, session: int) -> None:
    from paho.mqtt.packettypes import PacketTypes  # noqa: PLC0415 (an extra)
    from paho.mqtt.properties import Properties  # noqa: PLC0415

    wanted = Properties(PacketTypes.CONNECT)  # type: ignore[no-untyped-call]
    wanted.SessionExpiryInterval = session
    client.connect_async(broker.host, broker.port, clean_start=session == 0, properties=wanted)


def _words(error: BaseException | None) -> str:
    """What went wrong, in few words."""
    if isinstance(error, ssl.SSLCertVerificationError):
        return f"its certificate is not trusted: {error.verify_message}"
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return "it cannot be reached" if error is None else str(error) or type(error).__name__
