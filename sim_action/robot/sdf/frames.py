"""Where the frames of an SDF are, and which link each moves with (SDFormat's proposal on pose frame semantics)."""

from __future__ import annotations

from collections.abc import Iterator
from xml.etree.ElementTree import Element

from sim_action.core import geometry
from sim_action.core.geometry import Pose
from sim_action.core.messages import FirstFew, did_you_mean, shown
from sim_action.robot.robot_model import WORLD
from sim_action.robot.sdf.composition import MODEL_FRAME, Entry, Scope
from sim_action.robot.sdf.elements import SdfProblem, pose_of, text_of


class Frames:
    """The frames of a model and of all below it."""

    def __init__(self, root: Scope) -> None:
        self._root = root
        self._models = {entry.scope: entry for scope in root.scopes() for entry in scope.members if entry.scope}
        self._poses: dict[Entry, Pose] = {}
        self._links: dict[Entry, Entry] = {}
        self._canonical: dict[Scope, Entry | SdfProblem] = {}
        self._lost: dict[Entry, SdfProblem] = {}
        self._hinted = FirstFew()

    def root_in_world(self) -> Pose:
        """The outermost model's frame, where its <pose> puts it. Raises SdfProblem."""
        root = self._root
        if root.pose is not None and (root.pose.get("relative_to") or WORLD) != WORLD:
            name = shown(root.pose.get("relative_to"))
            message = f"the pose of the outermost model is relative to {name}; it can be so to the world alone"
            raise SdfProblem("unknown-frame", root.pose, message)
        pose = pose_of(root.pose)
        placed = self.named(root, root.placement_frame, root.element)
        return geometry.compose(pose, geometry.inverse(self.in_root(placed))) if placed else pose

    def check(self, entry: Entry) -> None:
        """Also what nobody refers to has to lead somewhere. Raises SdfProblem."""
        self.in_root(entry)
        if entry.kind == "frame":
            self.link_of(entry, entry.owner)

    def named(self, scope: Scope, name: str, element: Element) -> Entry | None:
        """What `element` calls so; None is the frame of the model itself. Raises SdfProblem."""
        if name in {"", MODEL_FRAME}:
            return None
        entry = scope.find(name)
        if entry is None:
            inner, rest = scope.innermost(name)
            where = "which is not there" if inner is scope else f"and there is no '{rest}' in that model"
            hint = did_you_mean(rest, inner.names) if self._hinted.one_more() else ""
            raise SdfProblem("unknown-frame", element, f"<{element.tag}> refers to '{name}', {where}{hint}")
        return entry

    def placed(self, scope: Scope, element: Element | None, otherwise: Pose) -> Pose:
        """The pose in the outermost model's frame that a <pose> in `scope` says, `otherwise` being its usual frame."""
        name = "" if element is None else element.get("relative_to", "")
        outer = otherwise
        if element is not None and name:
            entry = self.named(scope, name, element)
            outer = self.in_root(entry) if entry else self.model_in_root(scope)
        return geometry.compose(outer, pose_of(element))

    def in_root(self, entry: Entry) -> Pose:
        """The pose of a frame in the outermost model's. Raises SdfProblem."""
        self._resolve(entry)
        for model in self._around(entry.owner, self._root):
            self._resolve(model)
        return self._seen_from(entry, self._root)

    def model_in_root(self, scope: Scope) -> Pose:
        """The pose of a model's frame in the outermost one's. Raises SdfProblem."""
        return self.in_root(self._models[scope]) if scope in self._models else Pose()

    def link_of(self, entry: Entry | None, scope: Scope) -> Entry:
        """The link that a frame is attached to; None: the frame of the model `scope`. Raises SdfProblem."""
        passed = dict[Entry, None]()
        try:
            link = self._end_of(entry, scope, passed)
        except SdfProblem as problem:
            self._lost.update(dict.fromkeys(passed, problem))
            raise
        self._links.update(dict.fromkeys(passed, link))
        return link

    def _end_of(self, entry: Entry | None, scope: Scope, passed: dict[Entry, None]) -> Entry:
        """Follows frames to a link, and notes which it has passed."""
        while entry is not None and entry.kind in {"frame", "joint"} and entry not in self._links:
            self._raise_if_lost(entry)
            if entry in passed:
                raise SdfProblem("frame-loop", entry.element, f"frame '{entry.full_name}' is attached to itself")
            passed[entry] = None
            scope = entry.owner
            is_frame = entry.kind == "frame"
            name = entry.element.get("attached_to", "") if is_frame else text_of(entry.element, "child")
            entry = self.named(scope, name, entry.element)
        known = self._links.get(entry) if entry else None
        return known or self._link_at(entry, scope)

    def _link_at(self, entry: Entry | None, scope: Scope) -> Entry:
        """A link itself, or that of a model's frame."""
        if entry is not None and entry.scope is None:
            return entry
        return self._canonical_link(scope if entry is None or entry.scope is None else entry.scope)

    def _canonical_link(self, scope: Scope) -> Entry:
        """That of a model, looked for once: any number of frames may be attached to it."""
        if scope not in self._canonical:
            try:
                self._canonical[scope] = self._first_link(scope)
            except SdfProblem as problem:
                self._canonical[scope] = problem
        found = self._canonical[scope]
        if isinstance(found, SdfProblem):
            raise found.with_traceback(None)
        return found

    def _first_link(self, scope: Scope) -> Entry:
        name = scope.element.get("canonical_link", "")
        if name:
            entry = self.named(scope, name, scope.element)
            if entry is not None and entry.kind == "link":
                return entry
            raise SdfProblem("unknown-frame", scope.element, f"the canonical_link '{name}' is no link")
        own = (entry for entry in scope.members if entry.kind == "link")
        link = next(own, None) or next(scope.all_of("link"), None)
        if link is None:
            raise SdfProblem("missing-part", scope.element, "a <model> without a <link> has no frame to be attached to")
        return link

    def _resolve(self, wanted: Entry) -> None:
        """Finds the pose of a frame in its own model, after those of all frames that it is given relative to."""
        waiting = [] if wanted in self._poses else [wanted]
        try:
            self._find(waiting)
        except SdfProblem as problem:
            # Whatever waits for this is lost, too, and is not followed down here once more.
            self._lost.update(dict.fromkeys((entry for entry in waiting if entry not in self._poses), problem))
            raise

    def _find(self, waiting: list[Entry]) -> None:
        begun = set[Entry]()
        while waiting:
            entry = waiting[-1]
            self._raise_if_lost(entry)
            missing = (
                [] if entry in self._poses else [other for other in self._needed(entry) if other not in self._poses]
            )
            if not missing:
                self._poses.setdefault(entry, self._pose(entry))
                waiting.pop()
                continue
            if entry in begun:
                circle = ", ".join(f"'{other.full_name}'" for other in dict.fromkeys(waiting) if other in begun)
                message = f"poses that are given relative to each other in a circle, by way of {circle}"
                raise SdfProblem("frame-loop", missing[0].element, message)
            begun.add(entry)
            waiting += missing

    def _raise_if_lost(self, entry: Entry) -> None:
        if entry in self._lost:
            raise self._lost[entry].with_traceback(None)

    def _needed(self, entry: Entry) -> Iterator[Entry]:
        """What must be known before the pose of a frame is."""
        base = self._base(entry)
        if base is not None:
            yield base
            yield from self._around(base.owner, entry.owner)
        placed = self._placed_by(entry)
        if placed is not None:
            yield placed
            yield from self._around(placed.owner, entry.scope)

    def _pose(self, entry: Entry) -> Pose:
        base, placed = self._base(entry), self._placed_by(entry)
        pose = pose_of(entry.pose)
        if base is not None:
            pose = geometry.compose(self._seen_from(base, entry.owner), pose)
        if placed is not None and entry.scope is not None:
            pose = geometry.compose(pose, geometry.inverse(self._seen_from(placed, entry.scope)))
        return pose

    def _base(self, entry: Entry) -> Entry | None:
        """What a frame is given relative to; None is the frame of its model."""
        stated = "" if entry.pose is None else entry.pose.get("relative_to", "")
        usual = ""
        if entry.kind == "joint":
            usual = text_of(entry.element, "child")
        elif entry.kind == "frame":
            usual = entry.element.get("attached_to", "")
        return self.named(entry.owner, stated or usual, entry.element if entry.pose is None else entry.pose)

    def _placed_by(self, entry: Entry) -> Entry | None:
        """Which frame inside a model its pose is meant for; None is the model's own."""
        if entry.scope is None:
            return None
        return self.named(entry.scope, entry.scope.placement_frame, entry.element)

    def _around(self, inner: Scope, outer: Scope | None) -> Iterator[Entry]:
        """The models from one to one around it, without the latter."""
        scope: Scope | None = inner
        while scope is not outer and scope is not None and scope in self._models:
            yield self._models[scope]
            scope = scope.parent

    def _seen_from(self, entry: Entry, scope: Scope) -> Pose:
        pose = self._poses[entry]
        for model in self._around(entry.owner, scope):
            pose = geometry.compose(self._poses[model], pose)
        return pose
