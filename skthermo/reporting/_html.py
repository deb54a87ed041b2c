"""HTML elements, in which all text is escaped that is not HTML already, and the page around them."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable, Sequence
from hashlib import sha256
from html import escape
from importlib.resources import files
from typing import NamedTuple

from skthermo._tables.text import printable


class Html(str):
    """Text that is HTML already; any other text is escaped when it becomes part of an element."""

    __slots__ = ()


VOID = {"img", "input", "meta"}  # elements without content
STYLE, SCRIPT = (
    "\n" + files("skthermo.reporting").joinpath(name).read_text(encoding="utf-8") for name in ("page.css", "page.js")
)
POLICY = (
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; "
    f"script-src 'sha256-{b64encode(sha256(SCRIPT.encode()).digest()).decode()}'"
)
"""What a browser may load: drawings within the page, and the page's own script; nothing from a network."""


def element(tag: str, *content: object, **attributes: object) -> Html:
    """An element with its content; an underscore at the end of an attribute's name is left out, others are hyphens."""
    named = "".join(
        f' {name.rstrip("_").replace("_", "-")}="{escape(printable(value))}"' for name, value in attributes.items()
    )
    inner = "".join(part if isinstance(part, Html) else escape(printable(part)) for part in content)
    return Html(f"<{tag}{named}>" if tag in VOID else f"<{tag}{named}>{inner}</{tag}>")


def joined(parts: Iterable[Html]) -> Html:
    """Elements one after the other."""
    return Html("\n".join(parts))


def paragraphs(*sentences: str) -> Html:
    """A paragraph of each text that is not empty."""
    return joined(element("p", text) for text in sentences if text)


def bullets(items: Iterable[str]) -> Html:
    """An unordered list; nothing without items."""
    listed = [element("li", item) for item in items]
    return element("ul", *listed) if listed else Html()


def table(caption: str, columns: Sequence[object], rows: Iterable[Sequence[object]], *, is_cards: bool = False) -> Html:
    """A table that scrolls within itself, or on a telephone has its rows as cards; the first column heads the rows."""
    head = element("tr", *(element("th", name, scope="col") for name in columns))
    labels = [{"data_label": name} if is_cards else {} for name in columns]
    body = [
        element(
            "tr",
            element("th", first, scope="row", **labels[0]),
            *(element("td", value, **label) for value, label in zip(rest, labels[1:], strict=True)),
        )
        for first, *rest in rows
    ]
    parts = element("caption", caption), element("thead", head), element("tbody", joined(body))
    inner = element("table", *parts, **({"class_": "cards"} if is_cards else {}))
    return element("div", inner, class_="scroll", tabindex=0, role="region", aria_label=caption)


def bar(share: float, text: str) -> Html:
    """A share as text, with a bar of its length behind it."""
    length = 100 * min(max(share, 0.0), 1.0) if share == share else 0.0
    drawn = element("span", class_="bar", style=f"width:{length:.1f}%", aria_hidden="true")
    return element("span", drawn, element("span", text), class_="rate")


def image(svg: bytes, alt: str) -> Html:
    """A drawing within the page."""
    return element("img", src=f"data:image/svg+xml;base64,{b64encode(svg).decode()}", alt=alt)


def figure(caption: str, images: Sequence[Html], heading: str = "") -> Html:
    """Drawings beside each other where there is room, and what they show; nothing without drawings."""
    cells = element("div", *images, class_="panels")
    drawn = element("figure", cells, element("figcaption", caption))
    return joined([*([element("h3", heading)] if heading else []), drawn]) if images else Html()


class Section(NamedTuple):
    """A section of a page: its anchor, the name by which the links at the top call it, and what stands in it."""

    anchor: str
    link: str
    html: Html


def section(anchor: str, title: str, *content: Html | None, link: str = "") -> Section:
    """A section with a heading and an anchor; parts of the content that are empty are left out."""
    heading, inner = element("h2", title, id=f"{anchor}-title"), joined(part for part in content if part)
    html = element("section", heading, Html("\n"), inner, id=anchor, aria_labelledby=f"{anchor}-title")
    return Section(anchor, link or title, html)


def page(title: str, introduction: Html, sections: Sequence[Section], ending: Html) -> str:
    """The whole document, with links to the sections."""
    links = [element("li", element("a", one.link, href=f"#{one.anchor}")) for one in sections]
    head = (
        element("meta", charset="utf-8"),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("meta", http_equiv="Content-Security-Policy", content=POLICY),
        element("title", title),
        element("style", Html(STYLE)),
    )
    body = (
        element(
            "header", element("h1", title), introduction, element("nav", element("ul", *links), aria_label="Contents")
        ),
        element("main", joined(one.html for one in sections)),
        element("footer", ending),
        element("script", Html(SCRIPT)),
    )
    document = element("html", element("head", joined(head)), Html("\n"), element("body", joined(body)), lang="en")
    return f"<!DOCTYPE html>\n{document}\n"
