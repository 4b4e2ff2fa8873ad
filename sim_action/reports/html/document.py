"""The HTML document: escaped elements, and the page around them with its policy, style, scripts, data and replays."""

from __future__ import annotations

import base64
import gzip
import hashlib
import html
import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from importlib.resources import files
from math import isfinite
from pathlib import Path
from typing import Final, Self

from sim_action.core.errors import Location
from sim_action.core.records import dataclass, field
from sim_action.recording.replay.replay_data import Replay, ReplayError, ReplayReader
from sim_action.recording.replay.scene_data import MAX_TEXT_LENGTH, MeshData
from sim_action.reports import ReportOptions
from sim_action.reports.display import RowStatus, display_of
from sim_action.reports.escaping import one_line, plain_text
from sim_action.reports.formatting import moment
from sim_action.reports.links import file_and_line, source_url
from sim_action.reports.table import Bar, Row, Table, Value
from sim_action.results.artifacts import stored_file
from sim_action.results.outcome import Outcome

SCRIPTS: Final = (
    "dom.js",
    "unpacking.js",
    "units.js",
    "colours.js",
    "player/poses.js",
    "player/scans.js",
    "player/motion.js",
    "player/outlines.js",
    "player/overlays.js",
    "player/top_view.js",
    "player/forces.js",
    "player/clock.js",
    "page/embed.js",
    "page/address.js",
    "player/layers.js",
    "player/pictures.js",
    "plots/curves.js",
    "plots/drawing.js",
    "plots/menu.js",
    "plots/plot.js",
    "plots/chooser.js",
    "plots/export.js",
    "plots/panel.js",
    "player/controls.js",
    "player/ruler.js",
    "player/views.js",
    "player/ghost.js",
    "page/keyboard.js",
    "player/player.js",
    "plots/sweep_axes.js",
    "plots/sweep.js",
    "page/filter.js",
    "page/list.js",
    "page/suite.js",
    "page/scenarios.js",
    "page/copying.js",
    "page/start.js",
)
"""The scripts of the page in their order; they become one script, and each needs only those before it."""

LIVE_SCRIPT: Final = "live.js"  # the script of pages that a server on this machine gives; no file has it
_LIVE_STYLE: Final = "live.css"

VIEWER: Final = "viewer3d.json"
"""The 3D viewer, built from `tools/viewer/`; it is missing in a checkout where it was not built."""

_REMARK: Final = re.compile(r"/\*\*.*?\*/|^ *// [^\n]*$", re.DOTALL | re.MULTILINE)
_INDENT: Final = re.compile(r"^ +|\n+(?=\n)", re.MULTILINE)

_ICON: Final = (
    "data:image/svg+xml,<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 16 16'>"
    "<circle cx='8' cy='8' r='7' fill='{colour}'/></svg>"
)


@dataclass(frozen=True, slots=True)
class Page:
    """The parts of a page, which are read once."""

    title: str
    failed: bool
    body: Iterable[bytes]  # the encoded parts of the body
    index: str  # JSON for the script
    blocks: Mapping[str, str]  # element id -> packed data
    has_replays: bool  # True if one of the blocks is a replay, which needs the 3D viewer
    is_embedded: bool = False  # True if the page shows only the player of its first scenario, for a frame
    is_live: bool = False  # True if a server on this machine gives the page, which asks it for news

    @property
    def policy(self) -> str:
        """The content security policy of the page."""
        return self._policy(viewer() if self.has_replays else None)

    def _policy(self, built: Viewer | None) -> str:
        scripts = [fingerprint(page_script()), *([built.fingerprint] if built else [])]
        style = fingerprint(self._style)
        if not self.is_live:
            return policy(style, scripts)
        return policy(style, [*scripts, fingerprint(_bare(_asset(LIVE_SCRIPT)))]) + "; connect-src 'self'"

    @property
    def _style(self) -> str:
        return _asset("page.css") + _asset("embed.css") + (_asset(_LIVE_STYLE) if self.is_live else "")

    def text(self) -> str:
        """Return the whole file."""
        return b"".join(self.parts()).decode()

    def parts(self) -> Iterator[bytes]:
        """Yield the encoded file in parts: a page may have tens of megabytes."""
        built = viewer() if self.has_replays else None
        carried = dict(self.blocks) | ({"viewer3d": built.packed} if built else {})
        top = _head(self.title, self._policy(built), self._style, failed=self.failed)
        layout = " data-embed" if self.is_embedded else ""
        yield encoded(f'<!doctype html>\n<html lang="en"{layout}>{top}<body>')
        yield from self.body
        yield encoded(f"\n{element('script', Html(self.index), type='application/json', id='index')}\n")
        for name, block in carried.items():
            yield encoded(element("script", Html(block), type="text/plain", id=name) + "\n")
        yield encoded(element("script", Html(page_script())))
        if self.is_live:
            yield encoded(element("script", Html(_bare(_asset(LIVE_SCRIPT)))))
        yield encoded("</body></html>\n")


def _head(title: str, policy_text: str, style: str, *, failed: bool) -> Html:
    return element(
        "head",
        element("meta", charset="utf-8"),
        element("meta", http_equiv="Content-Security-Policy", content=policy_text),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("meta", name="color-scheme", content="light dark"),
        element("meta", name="generator", content="sim-action"),
        element("title", title),
        element("link", rel="icon", href=_ICON.format(colour="%23c62f2f" if failed else "%233a6ea5")),
        element("style", Html(style)),
    )


def still_page(title: str, body: Html, *, failed: bool) -> bytes:
    """Return a page without a script."""
    style = _asset("page.css")
    top = _head(title, policy(fingerprint(style), ["'none'"]), style, failed=failed)
    return encoded(f'<!doctype html>\n<html lang="en">{top}<body>{body}</body></html>\n')


def encoded(text: str) -> bytes:
    """Return a part of the page as it is in the file."""
    return text.encode("utf-8", errors="replace")


def policy(style: str, scripts: Iterable[str]) -> str:
    """Return the content security policy: nothing is loaded, and only scripts with these hashes run."""
    rest = "img-src data:; base-uri 'none'; form-action 'none'"
    return f"default-src 'none'; script-src {' '.join(scripts)}; style-src {style}; {rest}"


@lru_cache(maxsize=1)
def page_script() -> str:
    """Return the script of the page, without the 3D viewer."""
    return "(() => {\n'use strict';\n" + "".join(_bare(_asset(name)) for name in SCRIPTS) + "})();\n"


@dataclass(frozen=True, slots=True)
class Viewer:
    """The 3D viewer: its packed script, and the hash of the unpacked script for the policy."""

    packed: str
    fingerprint: str


def viewer() -> Viewer | None:
    """Read the 3D viewer; None if it was not built."""
    try:
        built = json.loads(_asset(VIEWER))
    except FileNotFoundError:
        return None
    return Viewer(built["packed"], f"'sha256-{built['sha256']}'")


def _bare(script: str) -> str:
    return _INDENT.sub("", _REMARK.sub("", script))


def _asset(name: str) -> str:
    return (files("sim_action.reports") / "viewer" / name).read_text(encoding="utf-8")


def fingerprint(content: str) -> str:
    """Return the hash of a script or style sheet as a policy names it."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(content.encode()).digest()).decode()}'"


_VOID = frozenset({"meta", "link", "input"})  # the elements of HTML without an end tag


class Html(str):
    """A string that is HTML already and is not escaped again."""

    __slots__ = ()


def text(words: str) -> Html:
    """Escape text as HTML, without characters that reorder or hide text."""
    if isinstance(words, Html):
        return words
    return _short_text(words) if len(words) <= _MAX_KEPT_CHARS else Html(html.escape(plain_text(words)))


_MAX_KEPT_CHARS: Final = 100  # labels, classes and values come again in each article


@lru_cache(maxsize=4096)
def _short_text(words: str) -> Html:
    return Html(html.escape(plain_text(words)))


def element(name: str, /, *children: str, **attributes: str | float | bool | None) -> Html:
    """Return an element; children that are not `Html` are escaped.

    In attribute names an underscore stands for a hyphen, and one at the end is removed. True gives an attribute without
    a value; False and None omit it.
    """
    start = f"<{name}"
    for key, value in attributes.items():
        if value is not None and value is not False:
            start += _attribute(key, value)
    if name in _VOID:
        return Html(f"{start}>")
    inner = "".join([child if isinstance(child, Html) else text(child) for child in children])
    return Html(f"{start}>{inner}</{name}>")


def joined(*parts: str) -> Html:
    """Join parts, each on its own line, and omit empty ones."""
    return Html("\n".join([part if isinstance(part, Html) else text(part) for part in parts if part]))


def dotted(parts: Iterable[str]) -> Html:
    """Join facts on one line by dots, and omit empty ones."""
    return Html(" · ".join(element("span", part) for part in parts if part))


def titled(title: str, *parts: str) -> Html:
    """Return parts below a heading; empty if there is no part."""
    return joined(element("h3", title), *parts) if any(parts) else Html("")


def faint(words: str) -> Html:
    """Return a paragraph of minor importance; empty without words."""
    return element("p", words, class_="faint") if words else Html("")


def bullets(items: Sequence[str], kind: str = "") -> Html:
    """Return a list of remarks; empty without items."""
    return element("ul", *items, class_=f"remarks {kind}".rstrip()) if items else Html("")


def reasons(sections: Sequence[str]) -> Html:
    """Return a frame around reasons, see `reason`; empty without any."""
    return element("div", joined(*sections), class_="reasons") if sections else Html("")


def reason(kind: str, title: Html, words: str, *parts: str) -> Html:
    """Return a reason for a status: `title` is a heading, `words` is the message."""
    return element("section", title, element("p", words, class_="what"), *parts, class_=f"reason {kind}")


def values(named: Iterable[tuple[str, str]], kind: str) -> Html:
    """Return a list of the label and value pairs with a value; empty if there is none."""
    pairs = [element("div", element("dt", name), element("dd", value)) for name, value in named if value]
    return element("dl", *pairs, class_=kind) if pairs else Html("")


@lru_cache(maxsize=32)
def status_mark(status: RowStatus, *, neutral: bool = False) -> Html:
    """Return the symbol of a status; assistive technology reads its word. `neutral`: without its colour."""
    display = display_of(status)
    kind = "mark" if neutral else f"mark {status}"
    return element("span", display.symbol, class_=kind, role="img", aria_label=display.word)


def source(location: Location | None, options: ReportOptions) -> Html:
    """Return `path:line`, linked to the file at the tested commit if it is known; empty for None."""
    if location is None:
        return Html("")
    shown = element("code", file_and_line(options.workspace, location))
    url = source_url(location, options)
    return element("a", shown, href=url, rel="noreferrer") if url else shown


def value_link(value: Value) -> Html:
    """Return a value of a row, with its bar; a sim time in s moves the replay of its article there."""
    if isinstance(value, Bar):
        return Html(text(value.text) + bar(value))
    return text(value) if isinstance(value, str) else element("span", moment(value), class_="moment", data_time=value)


_LEAST_BAR: Final = 1.5  # in units of a bar, which has 100


def bar(value: Bar) -> Html:
    """Return the bar of a value; one of a margin begins in the middle of its scale, for a missed one to the left."""
    if not isfinite(value.share):
        return Html("")
    whole, kind = (50, "margin-bar") if value.is_margin else (100, "share-bar")
    length = max(_LEAST_BAR, round(whole * min(1.0, abs(value.share)), 1))
    x, missed = (-length, "missed") if value.share < 0 else (None, None)
    filled = element("rect", x=x, width=length, height=1, class_=missed)
    box = f"{whole - 100} 0 100 1"
    return element("svg", filled, viewBox=box, preserveAspectRatio="none", aria_hidden="true", class_=kind)


def html_table(shown: Table, options: ReportOptions | None, *, around: str = "wide") -> Html:
    """Return a table with its rest in a fold; empty without rows."""
    first, rest = (_unfolded(shown, rows, options, around) if rows else "" for rows in (shown.rows, shown.rest))
    return joined(first, element("details", element("summary", shown.rest_title), rest, class_="rest") if rest else "")


def _unfolded(shown: Table, rows: Iterable[Row], options: ReportOptions | None, around: str) -> Html:
    """Return a table of some rows; each row that can be sorted has a body of its own."""
    titles = (title.strip() for title in shown.titles)
    heads = (element("th", title, scope="col", data_sort=shown.orders.get(title)) for title in titles)
    head = element("thead", element("tr", element("td"), *heads))
    written = [(joined(*_row(shown, row, options)), row.data) for row in rows]
    if not shown.orders:
        written = [(joined(*(part for part, _ in written)), {})]
    bodies = (element("tbody", part, **{f"data_{key}": words for key, words in data.items()}) for part, data in written)
    return element("div", element("table", head, *bodies), class_=around)


def _row(shown: Table, row: Row, options: ReportOptions | None) -> Iterator[Html]:
    """Yield a row of a table, and one with the table below it."""
    place = "" if options is None else source(row.location, options)
    about = dotted((place, *row.notes))
    small = (" ", element("small", about, class_="faint")) if about else ()
    name = element("a", row.name, href=f"#{row.link}") if row.link else element("span", row.name)
    message = element("td", row.message, class_="finding", data_title=shown.message) if shown.message else ""
    values = zip(shown.columns, shown.values_of(row), strict=True)
    yield element(
        "tr",
        element("td", status_mark(row.status, neutral=row.is_neutral)),
        element("th", name, *small, scope="row"),
        message,
        *(element("td", value_link(value), data_title=title.strip()) for title, value in values),
    )
    if row.below is not None:
        below = html_table(row.below, options, around="wide runs")
        yield element("tr", element("td", below, colspan=len(shown.titles) + 1), class_="below")


def page_header(title: str, kind: str, *lines: str) -> Html:
    """Return the header of a page: its title in the colour of a status, and lines below it."""
    return element("header", element("h1", title, class_=kind), *map(faint, filter(None, lines)), class_="run")


def article(identity: str, kind: str, header: Sequence[str], body: Html) -> Html:
    """Return an article of the page; its header has a heading with the id `IDENTITY-name`."""
    return element(
        "article",
        element("header", *header),
        body,
        id=identity,
        class_=f"scenario {kind}".rstrip(),
        aria_labelledby=f"{identity}-name",
    )


def packed_article(encoded_article: bytes) -> bytes:
    """Return an article whose content is one text for a browser with scripts, until the script of the page opens it."""
    start, content = encoded_article.split(b">", 1)
    return b"%b><noscript>%b</noscript></article>" % (start, content.removesuffix(b"</article>"))


def heading(identity: str, name: str) -> Html:
    """Return the name of an article, as its header has it."""
    return element("h2", name, id=f"{identity}-name")


def _attribute(key: str, value: str | float | bool | None) -> str:
    if value is True or (type(value) is str and len(value) <= _MAX_KEPT_CHARS):
        return _short_attribute(key, value)
    return f' {_attribute_name(key)}="{text(str(value))}"'


# Typed: True and "True" are no equals.
@lru_cache(maxsize=4096, typed=True)
def _short_attribute(key: str, value: str | bool) -> str:
    name = _attribute_name(key)
    return f" {name}" if value is True else f' {name}="{text(str(value))}"'


@lru_cache(maxsize=256)
def _attribute_name(key: str) -> str:
    return key.rstrip("_").replace("_", "-")


def replay_id(identity: str) -> str:
    """Return the element id of the replay of an article."""
    return f"replay-{identity}"


def stored_replay(outcome: Outcome, folder: Path, reader: ReplayReader) -> tuple[Replay | None, str]:
    """Return the replay of a run, or None and the reason why there is none."""
    if outcome.replay is None:
        return None, "" if outcome.digest is None else "No replay of this run was stored."
    path = stored_file(folder, outcome.replay)
    if path is None:
        return None, "The replay file of this run is missing."
    try:
        replay = reader.read(path)
    except ReplayError as error:
        return None, f"The replay cannot be read: {one_line(str(error))}"
    if replay.scenario is not None and replay.scenario != outcome.name[:MAX_TEXT_LENGTH]:
        return None, f"The replay is left out: it is of another scenario, '{one_line(replay.scenario)}'."
    return replay, ""


MAX_REPLAY_BYTES: Final = 8_000_000
"""The size of all replays and meshes in a page; scenarios beyond it, the best ones, get no replay."""

_LEVEL: Final = 5  # level 9 takes twice as long, for 1 % less


def packed(data: bytes) -> str:
    """Return data as gzip in base64, identical for identical data."""
    return base64.b64encode(gzip.compress(data, _LEVEL, mtime=0)).decode("ascii")


def page_json(data: object) -> str:
    """Return JSON that is safe inside a script element: it contains no `<`."""
    return json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")


@dataclass(frozen=True, slots=True)
class PackedReplay:
    """A replay as it is in a page: packed without its meshes, which other replays may share."""

    block: str
    meshes: Mapping[str, MeshData]

    @classmethod
    def of(cls, replay: Replay) -> Self:
        """Pack a replay."""
        data = replay.model_dump_json(exclude={"scene": {"meshes"}}, exclude_none=True).encode()
        return cls(packed(data), replay.scene.meshes)


@dataclass(slots=True)
class ReplayBlocks:
    """The packed replays of a page and the meshes that they share; `size` is an upper bound in bytes."""

    blocks: dict[str, str] = field(default_factory=dict)
    meshes: dict[str, MeshData] = field(default_factory=dict)
    size: int = 0

    def add(self, identity: str, replay: Replay) -> bool:
        """Add a replay if it fits; return False if it does not."""
        return self.put(identity, PackedReplay.of(replay))

    def put(self, identity: str, replay: PackedReplay) -> bool:
        """Add a packed replay if it fits; return False if it does not."""
        new = {digest: mesh for digest, mesh in replay.meshes.items() if digest not in self.meshes}
        size = self.size + len(replay.block) + (len(_packed_meshes(new)) if new else 0)
        if size > MAX_REPLAY_BYTES:
            return False
        self.size = size
        self.blocks[identity] = replay.block
        self.meshes |= new
        return True

    @property
    def shared(self) -> str:
        """The packed meshes by digest."""
        return _packed_meshes(self.meshes)

    @property
    def carried(self) -> dict[str, str]:
        """Element id -> packed replay, and the meshes if there are any."""
        return self.blocks | ({"meshes": self.shared} if self.meshes else {})


def _packed_meshes(meshes: Mapping[str, MeshData]) -> str:
    return packed(page_json({digest: mesh.model_dump() for digest, mesh in meshes.items()}).encode())
