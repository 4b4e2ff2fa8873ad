"""Collect an MJCF model: resolve every file that it names inside the workspace, and write one text that names none.

MuJoCo opens the files that a model names. It gets a text that was written here instead. Included files are part of the
text, and each name of a mesh in it stands for a file that was resolved in the workspace. `FILES` lists the elements
that may name a file; a format that is read later gets a row there. An attribute without a row whose
name matches `LIKE_A_FILE` is refused. Counts that could exhaust the memory are limited.
"""

from __future__ import annotations

import html
import math
import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final, Literal, NoReturn
from xml.etree.ElementTree import Element

from sim_action.core.errors import Location, Problem, RefusedModel
from sim_action.core.records import dataclass, field
from sim_action.core.wording import shown
from sim_action.robot.documents.packages import PackageError, Packages
from sim_action.robot.documents.part_table import ALL, PartRow, part_table
from sim_action.robot.documents.urdf_elements import is_numbers
from sim_action.robot.documents.xml_document import MAX_BYTES, MAX_ELEMENTS, ModelDocument, read_document
from sim_action.robot.model.findings import Finding, Places, finding
from sim_action.robot.model.robot_model import FloorLook

Use = Literal["include", "model", "mesh", "unused"]


@dataclass(frozen=True, slots=True)
class FileRow:
    """An element that may name files."""

    attributes: tuple[str, ...]  # the attributes that name a file
    # the attribute of <compiler> with the folder of these files; empty: the folder of the model
    folder: Literal["", "meshdir", "texturedir"]
    # "include": its elements replace the element; "model": a model to attach; "mesh": our reader reads it; "unused": it
    # must be in the workspace and may be missing, because it is not opened
    use: Use


_SIDES: Final = ("fileback", "filedown", "filefront", "fileleft", "fileright", "fileup")

FILES: Final[Mapping[str, FileRow]] = {
    "include": FileRow(("file",), "", "include"),
    "model": FileRow(("file",), "", "model"),
    "mesh": FileRow(("file",), "meshdir", "mesh"),
    "texture": FileRow(("file", *_SIDES), "texturedir", "unused"),
    "hfield": FileRow(("file",), "meshdir", "unused"),
    "skin": FileRow(("file",), "meshdir", "unused"),
}
"""The elements that may name files. A format that is read later needs a row here, and a reader."""

FOLDERS: Final = ("assetdir", "meshdir", "texturedir")
"""The attributes of <compiler> that name folders. The first one sets both others."""

DROPPED: Final = frozenset({*FOLDERS, "strippath", "content_type"})
"""Attributes that state how MuJoCo opens a file. The text for MuJoCo has none of them."""

LIKE_A_FILE: Final = re.compile(r"file|path|dir$|^ur[il]$|librar|^content_type$")
"""The names of attributes that may name a file."""

NO_FILES: Final = frozenset({("light", "dir")})  # attributes that match `LIKE_A_FILE`, but are directions

REMOVED: Final = frozenset({"light", "camera", "skin", "sensor", "texture", "layer", "visual", "statistic"})
"""Elements that are removed from the text for MuJoCo, because they have no effect on a simulation."""

SECTIONS: Final = frozenset({"sensor"})  # elements of `REMOVED` whose children count

UNDRAWN: Final = frozenset({"texture", "texrepeat", "texuniform"})
"""Attributes of <material> that are removed from the text."""

_GIGABYTE: Final = 1 << 30

LIMITS: Final[Mapping[tuple[str, str], int]] = {
    ("replicate", "count"): MAX_ELEMENTS,
    ("hfield", "nrow"): 1_000,
    ("hfield", "ncol"): 1_000,
    ("texture", "width"): 4_096,
    ("texture", "height"): 4_096,
    ("mesh", "params"): 300,
    ("numeric", "size"): 100_000,
    ("size", "memory"): _GIGABYTE,
    ("size", "nkey"): 1_000,
    ("size", "nuserdata"): 100_000,
    **{("size", name): 20_000 for name in ("nconmax", "njmax")},
    ("size", "nstack"): _GIGABYTE // 8,
    **{
        ("size", f"nuser_{kind}"): 100
        for kind in ("actuator", "body", "cam", "geom", "jnt", "sensor", "site", "tendon")
    },
}
"""An element and its attribute -> the largest value. MuJoCo allocates memory in proportion."""

_UNITS: Final[Mapping[str, int]] = {"": 0, **{unit: 10 * (n + 1) for n, unit in enumerate("KMGTPE")}}
_NUMBER: Final = re.compile(r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d{1,3})?")
_SIZE: Final = re.compile(r"(-?\d{1,18})([KMGTPE]?)", re.IGNORECASE)
_MAX_SHOWN: Final = 60
_MAX_TEXT: Final = 1_000
NUMBERS_PER_ELEMENT: Final = 200  # as many numbers of a heightfield, mesh or <numeric> count as one element
_AREAS: Final = {"hfield": ("nrow", "ncol"), "mesh": ("params", "params"), "numeric": ("size",)}


def refusal(message: str, place: Location) -> RefusedModel:
    """Return the error of a model with one problem."""
    return RefusedModel([Problem(place, message)])


def check_element(element: Element, place: Location) -> None:
    """Raise RefusedModel if an element is not simulated, may not name a file, or demands too much memory."""
    tag = element.tag
    row = part_table("mjcf").row(ALL, tag)
    if row is not None and row.effect == "refused":
        raise refusal(f"<{tag}> is not simulated, because {row.text}; remove it from the model", place)
    check_attributes(element, place)
    for name, text in element.attrib.items():
        most = LIMITS.get((tag, name))
        if most is not None:
            _check_number(tag, name, text, most, place)


def numbers_in(element: Element) -> int:
    """Return the number of values that MuJoCo allocates for an element that has passed `check_element`."""
    sizes = _AREAS.get(element.tag, ())
    stated = [max(map(float, element.get(name, "0").split())) for name in sizes]
    return int(abs(math.prod(stated))) if stated else 0


def check_attributes(element: Element, place: Location) -> None:
    """Raise RefusedModel if an element has an attribute that may name a file, and that is not in the table."""
    attributes = FILES[element.tag].attributes if element.tag in FILES else ()
    for name in element.attrib:
        if not LIKE_A_FILE.search(name) or name in attributes or (element.tag, name) in NO_FILES:
            continue
        if name in DROPPED and (element.tag in FILES or element.tag == "compiler"):
            continue
        allowed = ", ".join(f"<{tag} {row.attributes[0]}>" for tag, row in FILES.items())
        problem = f"<{shown_name(element.tag)} {shown_name(name)}> may not name a file"
        raise refusal(f"{problem}; allowed are {allowed}: remove the attribute", place)


def shown_name(name: str) -> str:
    """Return the name of an element or attribute as messages show it."""
    return name if len(name) <= _MAX_SHOWN else f"{name[:_MAX_SHOWN]}..."


def _check_number(tag: str, name: str, text: str, most: int, place: Location) -> None:
    """Raise RefusedModel if a number is above the limit, or is not a plain number."""

    def refuse(problem: str) -> NoReturn:
        raise refusal(f"<{tag} {name}={shown(text)}>: {problem}; at most {most:,} is allowed", place)

    if name == "memory":
        size = _SIZE.fullmatch(text.strip())
        if size is None:
            refuse("this is not a size in bytes, such as 10M")
        if int(size[1]) << _UNITS[size[2].upper()] > most:
            refuse("this is too much memory")
        return
    if len(text) > _MAX_TEXT:
        refuse("this is too large")
    words = text.split()
    if not words or not all(map(_NUMBER.fullmatch, words)) or (name == "count" and not text.isdecimal()):
        refuse("this is not a whole number" if name == "count" else "this is not a number")
    if max(map(float, words)) > most:
        refuse("this is too large")


# MuJoCo's default colours, of a geom and of a texture.
_NO_COLOUR: Final = [0.5, 0.5, 0.5, 1.0]
_FIRST, _SECOND = "0.8 0.8 0.8", "0.5 0.5 0.5"

# m: smaller squares could not be distinguished, and larger ones do not look like squares.
_MIN_SQUARE_M: Final = 0.01
_MAX_SQUARE_M: Final = 1_000.0


@dataclass(frozen=True, slots=True)
class Pattern:
    """A texture that MuJoCo computes, on a material."""

    # first, second: red, green and blue; `second` is for every other square, None without squares
    first: tuple[float, ...]
    second: tuple[float, ...] | None
    # pictures along the x axis, in a metre or on the whole plane; a picture has two squares along a side
    repeats: float
    is_uniform: bool  # True if `repeats` counts pictures in a metre


def patterns_of(root: Element) -> dict[str, Pattern]:
    """Return name of a material -> its pattern, for materials with a texture that MuJoCo computes."""
    textures = {texture.get("name"): texture for texture in root.iterfind("asset/texture") if not texture.get("file")}
    return dict(_patterns(root, textures))


def _patterns(root: Element, textures: Mapping[str | None, Element]) -> Iterator[tuple[str, Pattern]]:
    for material in root.iterfind("asset/material"):
        texture = textures.get(material.get("texture", ""))
        kind = "none" if texture is None else texture.get("builtin", "none")
        if texture is None or kind == "none":
            continue
        first, second = (_numbers(texture, name, usual) for name, usual in (("rgb1", _FIRST), ("rgb2", _SECOND)))
        stated = material.get("texrepeat", "")
        repeats = float(stated.split()[0]) if is_numbers(stated, 2) else 1.0
        is_uniform = material.get("texuniform") == "true"
        yield (
            material.get("name", ""),
            Pattern(first, second if kind == "checker" else None, abs(repeats) or 1.0, is_uniform),
        )


def _numbers(texture: Element, name: str, usual: str) -> tuple[float, ...]:
    stated = texture.get(name, usual)
    return tuple(map(float, (stated if is_numbers(stated, 3) else usual).split()))


def floor_look(spec: Any, geom: Any, patterns: Mapping[str, Pattern]) -> FloorLook | None:
    """Return how a plane is drawn: its colour, or the squares of its material; None if the file does not say."""
    material = next((candidate for candidate in spec.materials if candidate.name == geom.material), None)
    tint = geom.rgba.tolist()
    if tint == _NO_COLOUR and material is not None:
        tint = material.rgba.tolist()
    pattern = patterns.get(geom.material)
    if pattern is None:
        return None if tint in (_NO_COLOUR, [1.0] * 4) else FloorLook(_tinted((1.0, 1.0, 1.0), tint))
    if pattern.second is None:
        return FloorLook(_tinted(pattern.first, tint))
    # A plane without an end repeats pictures in each metre, too.
    extent = float(geom.size[0])
    side = extent / pattern.repeats if extent > 0 and not pattern.is_uniform else 0.5 / pattern.repeats
    square = min(_MAX_SQUARE_M, max(_MIN_SQUARE_M, side))
    return FloorLook(_tinted(pattern.first, tint), _tinted(pattern.second, tint), square)


def _tinted(colour: tuple[float, ...], tint: list[float]) -> tuple[float, float, float]:
    red, green, blue = (round(min(1.0, max(0.0, a * b)), 3) for a, b in zip(colour, tint, strict=False))
    return red, green, blue


MAX_FILES: Final = 100  # the largest number of XML files of a model
_MAX_DEPTH: Final = 100
_MAX_NAME: Final = 1000
_TIMESTEP: Final = re.compile(r"(?:\d{1,30}(?:\.\d{1,30})?|\.\d{1,30})(?:[eE]-?\d{1,2})?")


@dataclass(frozen=True, slots=True)
class MeshFile:
    """A mesh that a model names; `name`: the file's name in the model."""

    path: Path
    name: str
    place: Location


@dataclass(frozen=True)
class MjcfFiles:
    """A collected model."""

    text: str  # the model with its included files; each element begins on a line of its own
    models: Mapping[str, bytes] = field(repr=False)  # name in the text -> text of each model to attach
    meshes: Mapping[str, MeshFile]  # name in the text -> the file of each mesh
    # the place of each line of the texts; lines count through all texts
    places: tuple[Location, ...] = field(repr=False)
    # the parts that are not read: rule and message of each kind -> its places
    left_out: Mapping[tuple[str, str], Places] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()  # notes about files that are spelled otherwise
    # material of the text, which lacks textures -> its texture, if MuJoCo computes it
    patterns: Mapping[str, Pattern] = field(default_factory=dict)

    def place(self, line: int) -> Location | None:
        """Return the place in the user's files of a line of the text; None if there is no such line."""
        return self.places[line - 1] if 0 < line <= len(self.places) else None


def collect_files(path: Path, packages: Packages) -> MjcfFiles:
    """Read an MJCF file with its includes and attached models, and resolve its other files. Raise RefusedModel."""
    return _Collector(packages, path).collected()


@dataclass(frozen=True, eq=False)
class _Source:
    """A file of a model; `folder`: its folder, relative to the main file's folder."""

    document: ModelDocument
    folder: Path


@dataclass(frozen=True, eq=False)
class _Merged:
    """A model with its includes: copies of all elements, the place and the source of each, and the files read."""

    path: Path
    root: Element
    places: dict[Element, Location] = field(default_factory=dict)
    sources: dict[Element, _Source] = field(default_factory=dict)
    read: set[Path] = field(default_factory=set)


class _Collector:
    """The state of collecting one model."""

    def __init__(self, packages: Packages, path: Path) -> None:
        self._packages, self._main = packages, path
        self._findings: dict[Path, Finding] = {}
        self._models: dict[str, bytes] = {}
        self._meshes: dict[str, MeshFile] = {}
        self._lines: list[Location] = []
        self._left_out: dict[tuple[str, str], Places] = {}
        self._patterns: dict[str, Pattern] = {}
        self._files = self._bytes = self._elements = self._named = 0

    def collected(self) -> MjcfFiles:
        text, _ = self._model(self._main, None, ())
        findings = tuple(self._findings.values())
        return MjcfFiles(text, self._models, self._meshes, tuple(self._lines), self._left_out, findings, self._patterns)

    # --- files and includes ---

    def _model(self, path: Path, named_at: Location | None, above: tuple[Path, ...]) -> tuple[str, int]:
        """Return the text of a model, and the number of its elements after the engine has expanded it."""
        document = self._read(path, named_at)
        if document.root.tag != "mujoco":
            raise refusal(
                f"the root element of an MJCF file is <mujoco>, but this file has <{shown_name(document.root.tag)}>",
                document.places[document.root],
            )
        merged = _Merged(path, Element("mujoco", document.root.attrib))
        merged.places[merged.root] = document.places[document.root]
        merged.read.add(path)
        self._copy(document.root, _Source(document, Path()), merged, merged.root)
        folders = _folders(merged.root)
        sizes: dict[str, int] = {}
        for element in merged.root.iter():
            check_element(element, merged.places[element])
            row = FILES.get(element.tag)
            if row is not None and row.use == "model":
                self._attached(element, merged, (*above, path), sizes)
            elif row is not None:
                self._resolve(element, row, merged, folders)
            for name in DROPPED & element.attrib.keys():
                del element.attrib[name]
        expanded = self._expanded(merged.root, merged, sizes)
        if not above:
            self._patterns = patterns_of(merged.root)
        self._leave_out(merged.root, merged)
        # MuJoCo counts lines in each text: blank lines make the numbers distinct.
        written = ["\n" * len(self._lines)]
        self._write(merged.root, merged, written)
        return "".join(written), expanded

    def _read(self, path: Path, place: Location | None) -> ModelDocument:
        self._files += 1
        document = read_document(path)
        where = place or document.places[document.root]
        self._bytes += document.size
        if self._files > MAX_FILES:
            raise refusal(f"a model may have at most {MAX_FILES} files, all included files together", where)
        if self._bytes > MAX_BYTES:
            raise refusal(f"a model may have at most {MAX_BYTES // 1_000_000} MB, all included files together", where)
        return document

    def _copy(self, element: Element, source: _Source, merged: _Merged, target: Element, depth: int = 1) -> None:
        """Copy the children of an element; the elements of an included file replace its <include>."""
        for child in element:
            place = source.document.places[child]
            if child.tag == "include":
                included = self._included(child, source, merged)
                self._copy(included.document.root, included, merged, target, depth)
                continue
            self._elements += 1
            if depth > _MAX_DEPTH:
                raise refusal(f"more than {_MAX_DEPTH} elements inside each other", place)
            if self._elements > MAX_ELEMENTS:
                raise refusal(f"more than {MAX_ELEMENTS:,} elements, all included files together", place)
            copy = Element(child.tag, child.attrib)
            target.append(copy)
            merged.places[copy], merged.sources[copy] = place, source
            self._copy(child, source, merged, copy, depth + 1)

    def _included(self, element: Element, source: _Source, merged: _Merged) -> _Source:
        place = source.document.places[element]
        check_attributes(element, place)
        name = _file_name(element, place)
        if len(element):
            raise refusal("<include> has elements in it; move them out of it", place)
        folder = merged.path.parent
        # MuJoCo looks for the file in the folder of the main file first.
        path = self._file([folder / name, folder / source.folder / name], name, place)
        if path in merged.read:
            raise refusal(f"'{name}' includes itself, or is included twice; include each file once", place)
        merged.read.add(path)
        beside = Path(name).parent
        is_nested = not (folder / name).is_file()
        return _Source(self._read(path, place), source.folder / beside if is_nested else beside)

    def _attached(self, element: Element, merged: _Merged, above: tuple[Path, ...], sizes: dict[str, int]) -> None:
        place = merged.places[element]
        name = _file_name(element, place)
        path = self._file([merged.path.parent / merged.sources[element].folder / name], name, place)
        if path in above:
            raise refusal(f"'{name}' attaches itself", place)
        if len(above) > _MAX_DEPTH:
            raise refusal(f"more than {_MAX_DEPTH} models attach each other", place)
        text, size = self._model(path, place, above)
        model_name = element.get("name", "")
        sizes[model_name] = max(size, sizes.get(model_name, 0))
        element.set("file", self._token(".xml"))
        self._models[element.attrib["file"]] = text.encode()

    def _resolve(self, element: Element, row: FileRow, merged: _Merged, folders: Mapping[str, str]) -> None:
        """Replace the names of files by names that stand for them."""
        place = merged.places[element]
        for attribute in row.attributes:
            reference = element.get(attribute)
            if reference is None:
                continue
            beside = merged.sources[element].folder / reference
            name = Path(_base_name(reference)) if folders["strippath"] == "true" else beside
            paths = [merged.path.parent / folders[row.folder] / name, merged.path.parent / beside]
            stated = element.get("name") or _base_name(reference).rpartition(".")[0] or _base_name(reference)
            token = self._token(name.suffix if row.use == "mesh" else "")
            if row.use == "mesh":
                self._meshes[token] = MeshFile(self._file(paths, reference, place), reference, place)
            else:
                self._place(paths[0], reference, place)
            element.set(attribute, token)
            element.set("name", stated)

    def _leave_out(self, element: Element, merged: _Merged, parent: str = "") -> None:
        """Remove the elements without an effect on the simulation, and note the parts that are not read."""
        for name in UNDRAWN & element.attrib.keys() if element.tag == "material" else ():
            del element.attrib[name]
        table, place = part_table("mjcf"), merged.places[element]
        at = table.place(parent, element.tag)
        rows: dict[PartRow, list[str]] = {}
        for part in table.attributes(element, at):
            if part.row is not None and (part.row.effect == "harmless" or part.row.is_lost(part.name, part.value)):
                rows.setdefault(part.row, []).append(part.name[1:])
        for stated, names in rows.items():
            self._note_row(stated, f"{', '.join(names)} of <{element.tag}>", ", ".join(names), place)
        if element.tag == "option" and _TIMESTEP.fullmatch(element.get("timestep", "").strip()):
            rate = 1 / max(float(element.attrib["timestep"]), 1e-6)
            message = f"<option timestep> is ignored; for the same steps, state physics: {{rate: {rate:.0f} Hz}}"
            self._note("passed-over", message, place)
        for child in list(element):
            row = table.row(at, child.tag)
            if row is not None and element.tag != "default":
                count = len(child) if child.tag in SECTIONS else 1
                self._note_row(row, f"<{child.tag}>", f"<{child.tag}>", merged.places[child], count)
            if child.tag in REMOVED:
                element.remove(child)
            elif row is None:
                self._leave_out(child, merged, at)

    def _note_row(self, row: PartRow, stated: str, names: str, place: Location, count: int = 1) -> None:
        """Note parts of a row; `stated`, `names`: as messages on harmless and on lost parts show them."""
        if row.effect == "harmless":
            self._note("harmless-part", f"{stated} does not change the motion: {row.text}", place, count)
        elif count:
            self._note("passed-over", row.text.format(names), place, count)

    def _note(self, rule: str, message: str, place: Location, count: int = 1) -> None:
        self._left_out.setdefault((rule, message), Places(place)).add(place, count)

    def _token(self, suffix: str) -> str:
        self._named += 1
        return f"sim-action-{self._named}{suffix}"

    def _file(self, paths: list[Path], reference: str, place: Location) -> Path:
        """Return the first of several paths that names a file. Raise RefusedModel with the problem of the first one."""
        problems = []
        _check_name(reference, place)
        for path in paths:
            try:
                return self._packages.file(path, reference)
            except PackageError as error:
                problems.append(error)
        respelled = self._respelled(paths, place)
        if respelled is None:
            raise refusal(str(problems[0]), place)
        return respelled

    def _respelled(self, paths: list[Path], place: Location) -> Path | None:
        """Return the file at one of several paths in another letter case, or with backslashes, and note it."""
        for path in paths:
            # The search begins below a folder that may be read. With a dot, no name looks like package://.
            beside = f"./{os.path.relpath(path, self._main.parent)}"
            try:
                file = self._packages.resolve(beside, self._main)
            except PackageError:
                continue
            for note in file.notes:
                self._findings.setdefault(file.path, finding(note.rule, note.text.replace(beside, beside[2:]), place))
            return file.path
        return None

    def _place(self, path: Path, reference: str, place: Location) -> None:
        """Raise RefusedModel if a file may not be read, whether it exists or not."""
        _check_name(reference, place)
        try:
            self._packages.place(path, reference)
        except PackageError as error:
            raise refusal(str(error), place) from None

    # --- checks ---

    def _expanded(self, element: Element, merged: _Merged, sizes: Mapping[str, int]) -> int:
        """Return the number of elements after <replicate> and <attach> are expanded. Raise RefusedModel."""
        inside = sum(self._expanded(child, merged, sizes) for child in element)
        if element.tag == "replicate":
            inside *= int(element.get("count", "1"))
        if element.tag == "attach":
            # A model without a name gets one from its file.
            inside += sizes.get(element.get("model", ""), max(sizes.values(), default=0))
        if inside > MAX_ELEMENTS:
            problem = f"<{element.tag}> makes {inside:,} elements"
            most = f"at most {MAX_ELEMENTS:,} are allowed"
            if element.tag not in ("replicate", "attach"):
                most += f", and {NUMBERS_PER_ELEMENT} numbers of a heightfield, mesh or <numeric> count as one"
            raise refusal(f"{problem}; {most}: reduce the counts", merged.places[element])
        return inside + 1 + numbers_in(element) // NUMBERS_PER_ELEMENT

    # --- writing ---

    def _write(self, element: Element, merged: _Merged, written: list[str]) -> None:
        place = merged.places[element]
        attributes = "".join(f' {name}="{_escaped(text)}"' for name, text in element.attrib.items())
        self._lines.append(place)
        written.append(f"<{element.tag}{attributes}{'' if len(element) else '/'}>\n")
        if len(element):
            for child in element:
                self._write(child, merged, written)
            self._lines.append(place)
            written.append(f"</{element.tag}>\n")


def _escaped(text: str) -> str:
    return html.escape(text).replace("\n", "&#10;").replace("\t", "&#9;").replace("\r", "&#13;")


def _folders(root: Element) -> dict[str, str]:
    """Return the folders of files that <compiler> states; the last one counts."""
    folders = {"": "", "meshdir": "", "texturedir": "", "strippath": ""}
    for compiler in root.iter("compiler"):
        everything = compiler.get("assetdir")
        if everything is not None:
            folders |= {"meshdir": everything, "texturedir": everything}
        folders |= {name: text for name, text in compiler.attrib.items() if name in folders}
    return folders


def _file_name(element: Element, place: Location) -> str:
    if not element.get("file"):
        raise refusal(f"<{element.tag}> has no attribute 'file', or it is empty", place)
    return element.attrib["file"]


def _base_name(reference: str) -> str:
    return re.split(r"[/\\]", reference)[-1]


def _check_name(reference: str, place: Location) -> None:
    if not reference.isprintable() or len(reference) > _MAX_NAME:
        raise refusal(f"{shown(reference)} is not a valid path", place)
