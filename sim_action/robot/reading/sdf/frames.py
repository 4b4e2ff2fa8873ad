"""Resolve the frames of an SDF: their poses, and the links that they move with.

It follows SDFormat's proposal on pose frame semantics.
"""

from __future__ import annotations

from collections.abc import Iterator
from xml.etree.ElementTree import Element

from sim_action.core import geometry
from sim_action.core.geometry import Pose
from sim_action.core.wording import FirstFew, did_you_mean, shown
from sim_action.robot.documents.sdf_elements import MODEL_FRAME, SdfProblem, needed, pose_of, text_of
from sim_action.robot.model.robot_model import WORLD
from sim_action.robot.reading.sdf.composition import Entry, Scope


class Frames:
    """The frames of a model and of all models below it."""

    def __init__(self, root: Scope) -> None:
        self._root = root
        self._models = {entry.scope: entry for scope in root.scopes() for entry in scope.members if entry.scope}
        self._poses: dict[Entry, Pose] = {}
        self._links: dict[Entry, Entry] = {}
        self._canonical: dict[Scope, Entry | SdfProblem] = {}
        self._failed: dict[Entry, SdfProblem] = {}
        self._hinted = FirstFew()

    def root_in_world(self) -> Pose:
        """Return the pose of the outermost model's frame in the world. Raises SdfProblem."""
        root = self._root
        if root.pose is not None and (root.pose.get("relative_to") or WORLD) != WORLD:
            name = shown(root.pose.get("relative_to"))
            message = f"the pose of the outermost model is relative to {name}; it can be relative only to the world"
            raise SdfProblem("unknown-frame", root.pose, message)
        pose = pose_of(root.pose)
        placed = self.named(root, root.placement_frame, root.element)
        return geometry.compose(pose, geometry.inverse(self.in_root(placed))) if placed else pose

    def check(self, entry: Entry) -> None:
        """Raise SdfProblem if a frame cannot be resolved, even if nothing refers to it."""
        self.in_root(entry)
        if entry.kind == "frame":
            self.link_of(entry, entry.owner)

    def named(self, scope: Scope, name: str, element: Element) -> Entry | None:
        """Return the entry with a name that `element` uses; None is the frame of the model. Raises SdfProblem."""
        if name in {"", MODEL_FRAME} or (name == WORLD and scope.element.tag == WORLD):
            return None
        entry = scope.find(name)
        if entry is None:
            inner, rest = scope.innermost(name)
            where = "which does not exist" if inner is scope else f"but that model has no '{rest}'"
            hint = did_you_mean(rest, inner.names) if self._hinted.one_more() else ""
            raise SdfProblem("unknown-frame", element, f"<{element.tag}> refers to '{name}', {where}{hint}")
        return entry

    def placed(self, scope: Scope, element: Element | None, otherwise: Pose) -> Pose:
        """Return a <pose> of `scope` in the outermost model's frame; it is relative to `otherwise` by default."""
        name = "" if element is None else element.get("relative_to", "")
        outer = otherwise
        if element is not None and name:
            entry = self.named(scope, name, element)
            outer = self.in_root(entry) if entry else self.model_in_root(scope)
        return geometry.compose(outer, pose_of(element))

    def in_root(self, entry: Entry) -> Pose:
        """Return the pose of a frame in the outermost model's frame. Raises SdfProblem."""
        self._resolve(entry)
        for model in self._around(entry.owner, self._root):
            self._resolve(model)
        return self._seen_from(entry, self._root)

    def model_in_root(self, scope: Scope) -> Pose:
        """Return the pose of a model's frame in the outermost model's frame. Raises SdfProblem."""
        return self.in_root(self._models[scope]) if scope in self._models else Pose()

    def end_of(self, joint: Entry, tag: str) -> Entry | None:
        """Return the link that <parent> or <child> of a joint leads to; None is the world. Raises SdfProblem."""
        stated = needed(joint.element, tag)
        name = (stated.text or "").strip()
        if not name:
            message = f"joint '{joint.full_name}' has an empty <parent> or <child>"
            raise SdfProblem("missing-part", joint.element, message)
        if name == WORLD and joint.owner.find(WORLD) is None:
            return None
        return self.link_of(self.named(joint.owner, name, stated), joint.owner)

    def link_of(self, entry: Entry | None, scope: Scope) -> Entry:
        """Return the link that a frame is attached to; None: the frame of the model `scope`. Raises SdfProblem."""
        passed = dict[Entry, None]()
        try:
            link = self._end_of(entry, scope, passed)
        except SdfProblem as problem:
            self._failed.update(dict.fromkeys(passed, problem))
            raise
        self._links.update(dict.fromkeys(passed, link))
        return link

    def _end_of(self, entry: Entry | None, scope: Scope, passed: dict[Entry, None]) -> Entry:
        """Follow frames to a link; `passed` collects them."""
        while entry is not None and entry.kind in {"frame", "joint"} and entry not in self._links:
            self._raise_if_failed(entry)
            if entry in passed:
                raise SdfProblem("frame-loop", entry.element, f"frame '{entry.full_name}' is attached to itself")
            passed[entry] = None
            scope = entry.owner
            is_frame = entry.kind == "frame"
            name = entry.element.get("attached_to", "") if is_frame else text_of(entry.element, "child")
            entry = self.named(scope, name, entry.element)
        link = self._links.get(entry) if entry else None
        return link or self._link_at(entry, scope)

    def _link_at(self, entry: Entry | None, scope: Scope) -> Entry:
        if entry is not None and entry.scope is None:
            return entry
        return self._canonical_link(scope if entry is None or entry.scope is None else entry.scope)

    def _canonical_link(self, scope: Scope) -> Entry:
        """Return the canonical link of a model, from a cache: any number of frames may be attached to it."""
        if scope not in self._canonical:
            try:
                self._canonical[scope] = self._first_link(scope)
            except SdfProblem as problem:
                self._canonical[scope] = problem
        outcome = self._canonical[scope]
        if isinstance(outcome, SdfProblem):
            raise outcome.with_traceback(None)
        return outcome

    def _first_link(self, scope: Scope) -> Entry:
        name = scope.element.get("canonical_link", "")
        if name:
            entry = self.named(scope, name, scope.element)
            if entry is not None and entry.kind == "link":
                return entry
            raise SdfProblem("unknown-frame", scope.element, f"the canonical_link '{name}' is not a link")
        link = next(_own_links(scope), None) or next(scope.all_of("link"), None)
        if link is None:
            raise SdfProblem(
                "missing-part", scope.element, "<model> has no <link>, so nothing can be attached to its frame"
            )
        return link

    def _resolve(self, frame: Entry) -> None:
        """Compute the pose of a frame in its own model, after the frames that it is relative to."""
        waiting = [] if frame in self._poses else [frame]
        try:
            self._find(waiting)
        except SdfProblem as problem:
            # All frames that depend on this one fail, too, and are not resolved again.
            self._failed.update(dict.fromkeys((entry for entry in waiting if entry not in self._poses), problem))
            raise

    def _find(self, waiting: list[Entry]) -> None:
        begun = set[Entry]()
        while waiting:
            entry = waiting[-1]
            self._raise_if_failed(entry)
            missing = (
                [] if entry in self._poses else [other for other in self._needed(entry) if other not in self._poses]
            )
            if not missing:
                base = self._base(entry)
                placed = self._placed_by(entry)
                pose = pose_of(entry.pose)
                if base is not None:
                    pose = geometry.compose(self._seen_from(base, entry.owner), pose)
                if placed is not None and entry.scope is not None:
                    pose = geometry.compose(pose, geometry.inverse(self._seen_from(placed, entry.scope)))
                self._poses.setdefault(entry, pose)
                waiting.pop()
                continue
            if entry in begun:
                circle = ", ".join(f"'{other.full_name}'" for other in dict.fromkeys(waiting) if other in begun)
                message = f"poses are relative to each other in a loop: {circle}"
                raise SdfProblem("frame-loop", missing[0].element, message)
            begun.add(entry)
            waiting += missing

    def _raise_if_failed(self, entry: Entry) -> None:
        if entry in self._failed:
            raise self._failed[entry].with_traceback(None)

    def _needed(self, entry: Entry) -> Iterator[Entry]:
        """Yield the frames whose poses are needed for the pose of a frame."""
        base = self._base(entry)
        if base is not None:
            yield base
            yield from self._around(base.owner, entry.owner)
        placed = self._placed_by(entry)
        if placed is not None:
            yield placed
            yield from self._around(placed.owner, entry.scope)

    def _base(self, entry: Entry) -> Entry | None:
        """Return the frame that a frame is relative to; None is the frame of its model."""
        stated = "" if entry.pose is None else entry.pose.get("relative_to", "")
        default = ""
        if entry.kind == "joint":
            default = text_of(entry.element, "child")
        elif entry.kind == "frame":
            default = entry.element.get("attached_to", "")
        return self.named(entry.owner, stated or default, entry.element if entry.pose is None else entry.pose)

    def _placed_by(self, entry: Entry) -> Entry | None:
        if entry.scope is None:
            return None
        return self.named(entry.scope, entry.scope.placement_frame, entry.element)

    def _around(self, inner: Scope, outer: Scope | None) -> Iterator[Entry]:
        """Yield the models from `inner` out to `outer`, without `outer`."""
        scope: Scope | None = inner
        while scope is not outer and scope is not None and scope in self._models:
            yield self._models[scope]
            scope = scope.parent

    def _seen_from(self, entry: Entry, scope: Scope) -> Pose:
        pose = self._poses[entry]
        for model in self._around(entry.owner, scope):
            pose = geometry.compose(self._poses[model], pose)
        return pose


def _own_links(scope: Scope) -> Iterator[Entry]:
    """Yield the links of a model and of its merged models, in the order of the file."""
    for entry in scope.members:
        if entry.kind == "link":
            yield entry
        elif entry.scope is not None and not entry.name:
            yield from _own_links(entry.scope)
