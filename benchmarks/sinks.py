"""Mail servers that are away, slow, or refuse, for now or for good."""

from __future__ import annotations

import asyncio
import time
from contextlib import ExitStack
from typing import Any

from storm import Kind, Lane, Storm

from acceptance.support import Mailbox, mail_server

_LASTS = (4.0, 12.0)
"""Seconds that a mood lasts: often shorter than until the next try, or the delays would grow to minutes."""


class Moody(Mailbox):
    """The handler of a mail server that does what its ``mood`` is."""

    mood = ""

    async def handle_RCPT(  # noqa: N802 (aiosmtpd)
        self, _server: Any, _session: Any, envelope: Any, address: str, _options: Any
    ) -> str:
        """Name somebody to take the mail to."""
        if self.mood == "greylisting":
            return "451 4.7.1 greylisted, come back later"
        envelope.rcpt_tos.append(address)
        return "250 OK"

    async def handle_DATA(self, *arguments: Any) -> str:  # noqa: N802 (aiosmtpd)
        """Take one mail, or not."""
        if self.mood == "for good":
            return "550 5.7.1 refused"
        if self.mood == "slow":
            await asyncio.sleep(2.0)
        return await Mailbox.handle_DATA(self, *arguments)


class Sinks:
    """The channels of a storm, by name."""

    def __init__(self, storm: Storm, servers: dict[str, ExitStack], boxes: dict[str, Moody]) -> None:
        self.storm, self._servers, self._boxes = storm, servers, boxes

    def kinds(self, channel: str) -> list[Kind]:
        """What can be wrong with a channel but a refusal for good."""
        return [
            (f"{channel}: server away, connections refused", lambda: self._away(channel)),
            (f"{channel}: server slow, 2 s a mail", lambda: self._mood(channel, "slow")),
            (f"{channel}: 451, greylisted", lambda: self._mood(channel, "greylisting")),
            (f"{channel}: 451, refused for now", lambda: self._refusing(channel)),
        ]

    def for_good(self, channel: str) -> Kind:
        """A channel that refuses for good: what is sent to it then is lost there."""
        return f"{channel}: 550, refused for good", lambda: self._mood(channel, "for good")

    def _mood(self, channel: str, mood: str) -> Lane:
        box = self._boxes[channel]
        box.mood = mood
        try:
            yield self.storm.chance.uniform(*_LASTS)
        finally:
            box.mood = ""

    def _refusing(self, channel: str) -> Lane:
        box = self._boxes[channel]
        box.refusing = True
        try:
            yield self.storm.chance.uniform(*_LASTS)
        finally:
            box.refusing = False

    def _away(self, channel: str) -> Lane:
        box, server = self._boxes[channel], self._servers[channel]
        self.storm.tally.at.append(time.monotonic())  # what it took and had not said so comes again
        server.close()
        self.storm.tally.at.append(time.monotonic())
        try:
            yield self.storm.chance.uniform(*_LASTS)
        finally:
            server.enter_context(mail_server(box))
