"""Find dead links between the pages of the built site, and anything that a page would load from a network.

    python tools/dead_links.py docs/_build

Prints each with the page that has it; the exit code is 1 if there is one.
"""

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

LOADED = {"script": "src", "img": "src", "link": "href", "iframe": "src", "source": "src"}
NOT_LOADED = {"canonical", "search", "next", "prev", "index", "author"}  # kinds of <link> that a browser does not fetch


class Page(HTMLParser):
    """Targets of a page's links, what it loads, and its anchors."""

    def __init__(self, path):
        super().__init__()
        self.links, self.loaded, self.anchors = [], [], {"", "top"}
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.anchors |= {found[name] for name in ("id", "name") if found.get(name)}
        if tag == "a" and found.get("href"):
            self.links.append(found["href"])
        if tag in LOADED and found.get(LOADED[tag]) and found.get("rel") not in NOT_LOADED:
            self.loaded.append(found[LOADED[tag]])


def faults(root):
    written = (path for path in root.rglob("*.html") if "_static" not in path.parts)  # the theme's templates are there
    pages = {path.resolve(): Page(path) for path in written}
    for path, page in pages.items():
        for address in page.links + page.loaded:
            parts = urlsplit(address)
            if parts.scheme or parts.netloc:
                if address in page.loaded and parts.scheme != "data":
                    yield path, f"loads {address}"
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not target.is_file():
                yield path, f"dead link {address}"
            elif target in pages and unquote(parts.fragment) not in pages[target].anchors:
                yield path, f"no anchor {address}"


if __name__ == "__main__":
    root = Path(sys.argv[1])
    found = sorted({f"{path.relative_to(root.resolve())}: {fault}" for path, fault in faults(root)})
    print(*found, f"{len(found)} faults", sep="\n")
    sys.exit(bool(found))
