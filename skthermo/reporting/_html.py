"""HTML elements, in which all text is escaped that is not HTML already, and the page around them."""

from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

from skthermo._formatting import printable


class Html(str):
    """Text that is HTML already; any other text is escaped when it becomes part of an element."""

    __slots__ = ()


VOID = {"img", "meta"}  # elements without content
STYLE = """
:root { color-scheme: light dark; --page: #f6f7f9; --card: #ffffff; --text: #1d2530; --soft: #4c5866; --line: #d5dae1;
  --accent: #00609a; --bar: #cfe3f2; --drawing: #ffffff; --healthy: #006b4f; --alarm: #a83a00; --unjudged: #5b5200; }
@media (prefers-color-scheme: dark) { :root { --page: #12161c; --card: #1b2129; --text: #e6eaf0; --soft: #b0bac6;
  --line: #3a4450; --accent: #7cc4f5; --bar: #24506f; --healthy: #4fd1a5; --alarm: #ff9a62; --unjudged: #e3cf5a; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--page); color: var(--text); line-height: 1.55; overflow-wrap: break-word;
  font-family: system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif; }
header, main, footer { max-width: 68rem; margin: 0 auto; padding: 1rem clamp(0.75rem, 3vw, 2rem); }
h1 { font-size: clamp(1.5rem, 4vw, 2.1rem); line-height: 1.2; margin: 1rem 0 0.5rem; }
h2 { font-size: 1.3rem; line-height: 1.3; margin: 0 0 0.75rem; }
h3 { font-size: 1.05rem; margin: 1.5rem 0 0.5rem; }
p, li { max-width: 46rem; }
p { margin: 0.6rem 0; }
ul { padding-left: 1.3rem; margin: 0.6rem 0; }
li { margin: 0.3rem 0; }
a { color: var(--accent); }
nav ul { list-style: none; padding: 0; display: flex; flex-wrap: wrap; gap: 0.25rem 1.25rem; }
section { background: var(--card); border: 1px solid var(--line); border-radius: 0.6rem; margin: 0 0 1.25rem;
  padding: clamp(0.9rem, 3vw, 1.75rem); }
#answer, #today { border-top: 0.3rem solid var(--accent); }
.soft, figcaption, caption, footer { color: var(--soft); }
.scroll { overflow-x: auto; margin: 1rem 0; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: 0.92rem; }
caption { text-align: left; padding-bottom: 0.4rem; position: sticky; left: 0;
  max-width: min(46rem, calc(100vw - 4rem)); }
.text { display: block; min-width: 11rem; }
th, td { padding: 0.35rem 0.8rem 0.35rem 0; border-bottom: 1px solid var(--line); text-align: left;
  vertical-align: top; min-width: 5rem; max-width: 34rem; }
thead th { vertical-align: bottom; border-bottom-width: 2px; }
tbody th { font-weight: 600; min-width: 7rem; }
.rate { position: relative; display: block; min-width: 6rem; padding: 0 0.35rem; z-index: 0; }
.bar { position: absolute; inset: 0 auto 0 0; background: var(--bar); border-radius: 0.2rem; z-index: -1; }
.state { --state: var(--unjudged); display: flex; gap: clamp(0.75rem, 3vw, 1.5rem); align-items: flex-start;
  border: 3px solid var(--state); border-left-width: 0.9rem; border-radius: 0.6rem; margin: 0 0 1rem;
  padding: clamp(0.75rem, 3vw, 1.25rem); }
.state.healthy { --state: var(--healthy); }
.state.alarm { --state: var(--alarm); }
.state svg { flex: none; width: clamp(2.4rem, 9vw, 3.6rem); fill: none; stroke: var(--card); stroke-width: 2.6;
  stroke-linecap: round; stroke-linejoin: round; }
.state circle { fill: var(--state); stroke: none; }
.state p { margin: 0.35rem 0; }
.badge { display: inline-flex; gap: 0.4rem; align-items: center; color: var(--state, var(--unjudged)); font-weight: 600;
  white-space: nowrap; }
.badge.healthy { --state: var(--healthy); }
.badge.alarm { --state: var(--alarm); }
.badge svg { flex: none; width: 1.15rem; fill: none; stroke: var(--card); stroke-width: 2.6; stroke-linecap: round;
  stroke-linejoin: round; }
.badge circle { fill: var(--state, var(--unjudged)); stroke: none; }
.state .headline { color: var(--state); font-size: clamp(1.4rem, 5.5vw, 2.1rem); font-weight: 700; line-height: 1.2;
  margin: 0; }
figure { margin: 1.25rem 0; }
.panels { display: grid; gap: 0.75rem; grid-template-columns: repeat(auto-fit, minmax(min(100%, 21rem), 1fr)); }
img { display: block; width: 100%; max-width: 34rem; height: auto; background: var(--drawing); border-radius: 0.35rem;
  border: 1px solid var(--line); padding: 0.25rem; }
figcaption { font-size: 0.92rem; margin-top: 0.5rem; max-width: 46rem; }
.chart { display: block; width: 100%; max-width: 46rem; }
.chart text { fill: var(--soft); font-size: 12px; }
.spark { display: block; width: 8.25rem; }
.chart path, .spark path { fill: none; stroke: var(--soft); stroke-linecap: round; stroke-linejoin: round; }
.chart .event { fill: var(--alarm); opacity: 0.18; }
.chart .threshold, .spark .threshold { stroke: var(--text); stroke-dasharray: 5 4; }
.chart .dots { stroke: var(--accent); stroke-width: 4; }
.chart .above { stroke: var(--alarm); stroke-width: 6; }
.spark .course { stroke: var(--accent); stroke-width: 1.5; }
.spark .above { stroke: var(--alarm); stroke-width: 5; }
code { font-size: 0.88em; overflow-wrap: anywhere; }
.cards th, .cards td { min-width: 3.5rem; }
@media screen and (max-width: 40rem) {
  .cards thead { display: none; }
  .cards, .cards tbody, .cards tr { display: block; }
  .cards tr { border-bottom: 2px solid var(--line); padding: 0.4rem 0; }
  .cards caption { display: block; }
  .cards th, .cards td { display: flex; gap: 0.75rem; max-width: none; min-width: 0; border: 0; padding: 0.15rem 0; }
  .cards td:empty { display: none; }
  .cards th::before, .cards td::before { content: attr(data-label); flex: none; width: 8.5rem; color: var(--soft);
    font-weight: 400; }
  .cards .text { min-width: 0; }
}
@media print {
  :root { color-scheme: light; --page: #fff; --card: #fff; --text: #000; --soft: #333; --line: #bbb; --bar: #ddd;
    --accent: #00466f; --healthy: #004d38; --alarm: #7d2b00; --unjudged: #423c00; }
  body { font-size: 10pt; }
  table, figcaption { font-size: 9pt; }
  header, main, footer { max-width: none; padding: 0; }
  nav { display: none; }
  section { border: 0; padding: 0.5rem 0; }
  .scroll { overflow: visible; }
  h2, h3, caption { break-after: avoid; }
  tr, img, figcaption { break-inside: avoid; }
  .panels { grid-template-columns: 1fr 1fr; }
}
"""


def element(tag: str, *content: Any, **attributes: Any) -> Html:
    """An element with its content; an underscore at the end of an attribute's name is left out, others are hyphens."""
    named = "".join(
        f' {name.rstrip("_").replace("_", "-")}="{escape(printable(value))}"' for name, value in attributes.items()
    )
    inner = "".join(part if isinstance(part, Html) else escape(printable(part)) for part in content)
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


def table(caption: str, columns: Sequence[Any], rows: Iterable[Sequence[Any]], *, is_cards: bool = False) -> Html:
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


def page(title: str, introduction: Html, sections: Mapping[str, tuple[str, Html]], ending: Html) -> str:
    """The whole document, with links to the sections, which come with their titles by anchor."""
    links = [element("li", element("a", name, href=f"#{anchor}")) for anchor, (name, _) in sections.items()]
    head = (
        element("meta", charset="utf-8"),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("title", title),
        element("style", Html(STYLE)),
    )
    body = (
        element(
            "header", element("h1", title), introduction, element("nav", element("ul", *links), aria_label="Contents")
        ),
        element("main", joined(content for _, content in sections.values())),
        element("footer", ending),
    )
    document = element("html", element("head", joined(head)), Html("\n"), element("body", joined(body)), lang="en")
    return f"<!DOCTYPE html>\n{document}\n"
