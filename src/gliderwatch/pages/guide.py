"""`docs/pilots.md` as a page beside those of the gliders: what to do, a section for each kind of message."""

from __future__ import annotations

import re
from functools import cache
from itertools import pairwise
from pathlib import Path

from markdown_it import MarkdownIt

from gliderwatch.messages.guide import anchor
from gliderwatch.pages.render import part, policy

_PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<title>What to do: gliderwatch</title><style>{style}</style></head>
<body><main class="guide"><p><a href="index.html">All gliders</a></p>
{body}</main></body></html>
"""
_ELSEWHERE = re.compile(r"\[([^\]]+)\]\((?!https?:|#)[^)]*\)")
"""Links to other pages of the documentation, which do not lie here."""


@cache
def guide_page() -> str:
    """The page; its headings are the targets of the links in messages."""
    style, reader = part("style.css"), MarkdownIt()
    tokens = reader.parse(_ELSEWHERE.sub(r"\1", _path().read_text(encoding="utf-8")))
    for opening, inline in pairwise(tokens):
        if opening.type == "heading_open":
            opening.attrSet("id", anchor(inline.content))
    body = reader.renderer.render(tokens, reader.options, {})
    return _PAGE.format(policy=policy([style], []), style=style, body=body)


def _path() -> Path:
    """Where the guide is: beside this module in a wheel, in `docs/` of a checkout."""
    installed = Path(__file__).with_name("pilots.md")
    return installed if installed.is_file() else Path(__file__).parents[3] / "docs" / "pilots.md"
