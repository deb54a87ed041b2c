"""HTML elements, in which all text is escaped that is not HTML already."""

from base64 import b64encode
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any


class Html(str):
    """Text that is HTML already; any other text is escaped when it becomes part of an element."""

    __slots__ = ()


VOID = {"img", "meta"}


def element(tag: str, *content: Any, **attributes: Any) -> Html:
    """An element with its content, none of it escaped twice.

    Parameters
    ----------
    tag : str
        Its name.
    *content : Html or object
        What is in it; anything but Html is turned into text and escaped.
    **attributes : object
        Its attributes; an underscore at the end of a name is left out, others become hyphens.

    Returns
    -------
    Html
    """
    named = "".join(
        f' {name.rstrip("_").replace("_", "-")}="{escape(str(value))}"' for name, value in attributes.items()
    )
    inner = "".join(part if isinstance(part, Html) else escape(str(part)) for part in content)
    return Html(f"<{tag}{named}>" if tag in VOID else f"<{tag}{named}>{inner}</{tag}>")


def joined(parts: Iterable[Html]) -> Html:
    """Elements one after the other."""
    return Html("\n".join(parts))


def paragraphs(*sentences: Any) -> Html:
    """A paragraph of each text that is not empty."""
    return joined(element("p", text) for text in sentences if text)


def bullets(items: Iterable[Any]) -> Html:
    """An unordered list; nothing without items."""
    listed = [element("li", item) for item in items]
    return element("ul", *listed) if listed else Html()


def section(name: str, title: str, *content: Html) -> Html:
    """A section with a heading and an anchor."""
    heading = element("h2", title, id=f"{name}-title")
    return element("section", heading, Html("\n"), joined(content), id=name, aria_labelledby=f"{name}-title")


def table(caption: str, columns: Sequence[Any], rows: Iterable[Sequence[Any]]) -> Html:
    """A table that scrolls within itself; the first column heads the rows, other columns are right-aligned numbers."""
    head = element("tr", *(element("th", name, scope="col") for name in columns))
    body = [
        element("tr", element("th", first, scope="row"), *(element("td", v) for v in rest)) for first, *rest in rows
    ]
    parts = element("caption", caption), element("thead", head), element("tbody", joined(body))
    inner = element("table", *parts)
    return element("div", inner, class_="scroll", tabindex=0, role="region", aria_label=caption)


def bar(share: float, text: str) -> Html:
    """A share as text, with a bar of its length behind it."""
    length = 100 * min(max(share, 0.0), 1.0) if share == share else 0.0
    drawn = element("span", class_="bar", style=f"width:{length:.1f}%", aria_hidden="true")
    return element("span", drawn, element("span", text), class_="rate")


def image(svg: bytes, alt: str) -> Html:
    """A drawing within the page."""
    return element("img", src=f"data:image/svg+xml;base64,{b64encode(svg).decode()}", alt=alt)


def figure(caption: str, images: Sequence[Html]) -> Html:
    """Drawings beside each other where there is room, and what they show."""
    cells = element("div", *images, class_="panels")
    return element("figure", cells, element("figcaption", caption)) if images else Html()
