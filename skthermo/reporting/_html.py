"""HTML elements of drawings, in which all text is escaped that is not HTML already."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable
from html import escape

from skthermo._core.text import printable


class Html(str):
    """Text that is HTML already; any other text is escaped when it becomes part of an element."""

    __slots__ = ()

    def __html__(self) -> Html:
        """By which templates know it."""
        return self


VOID = {"img", "input", "meta"}  # elements without content


def element(tag: str, *content: object, **attributes: object) -> Html:
    """An element with its content; an underscore at the end of an attribute's name is left out, others are hyphens."""
    named = "".join(f' {name.rstrip("_").replace("_", "-")}="{_escaped(one)}"' for name, one in attributes.items())
    inner = "".join(_escaped(part) for part in content)
    return Html(f"<{tag}{named}>" if tag in VOID else f"<{tag}{named}>{inner}</{tag}>")


def _escaped(value: object) -> str:
    return str(value) if hasattr(value, "__html__") else escape(printable(value))


def joined(parts: Iterable[Html]) -> Html:
    """Elements one after the other."""
    return Html("\n".join(parts))


def image(svg: bytes, alt: str) -> Html:
    """A drawing within the page."""
    return element("img", src=f"data:image/svg+xml;base64,{b64encode(svg).decode()}", alt=alt)
