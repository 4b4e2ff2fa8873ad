"""The texts that trainers add to an ONNX file: joints, default pose, scale of the action, motors, observation.

mjlab 0.1.0 and later write them (`joint_names`, `default_joint_pos`, `joint_stiffness`, `joint_damping`,
`action_scale`, `observation_names`, and since its module `exporter_utils` states them, `observation_terms_scale`,
`_clip` and `_history_length`). BeyondMimic for Isaac Lab 2.1 writes the same names, and `observation_history_lengths`.
Lists are separated by commas, lists in them also by `;` (mjlab 1.6), and rounded to three decimals. rsl_rl 5 and Isaac
Lab 2.3 themselves write none.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, Final

from sim_action.commands.policy_controller import PolicyAction
from sim_action.commands.policy_terms import Layout, Term, values_of
from sim_action.core.records import dataclass, field
from sim_action.core.wording import shown
from sim_action.core.yaml_document import SpecProblems
from sim_action.networks.onnx_network import NetworkProblem

_TERMS: Final[Mapping[str, str]] = {
    "base_lin_vel": "base.linear",
    "base_ang_vel": "base.angular",
    "projected_gravity": "gravity",
    **dict.fromkeys(("joint_pos", "joint_pos_rel"), "joints.position"),
    **dict.fromkeys(("joint_vel", "joint_vel_rel"), "joints.velocity"),
    **dict.fromkeys(("action", "actions", "last_action"), "last_action"),
    **dict.fromkeys(("command", "commands", "velocity_commands", "twist"), "commands"),
}
"""Name of an observation -> our term."""

_ACTION_KEYS: Final = {
    "scale": "action_scale",
    "offset": "default_joint_pos",
    "stiffness": "joint_stiffness",
    "damping": "joint_damping",
}
_ITEM: Final = re.compile(r"\[[^\]]*\]|[^,]+")
_ROUNDING: Final = 6e-4  # numbers are written with three decimals


@dataclass(frozen=True, slots=True)
class Stated:
    """The statements of a network about its use."""

    joints: tuple[str, ...] = ()  # their names in its order
    # key of an action -> a number for all joints, or one for each
    action: Mapping[str, float | tuple[float, ...]] = field(default_factory=dict)
    names: tuple[str, ...] = ()  # the names of its observations
    # for each observation, the keys of a term that it states; its name is missing if there is no such term
    terms: tuple[Mapping[str, Any], ...] = ()
    without_gains: str = ""  # a joint whose stiffness and damping differ from the policy; empty if there is none

    @property
    def unknown(self) -> list[str]:
        """The observations for which there is no term."""
        return [name for name, term in zip(self.names, self.terms, strict=True) if "term" not in term]


def stated_in(metadata: Mapping[str, str], order: tuple[str, ...] | None = None) -> Stated:
    """Return what the texts of a network state; `order`: of joints, for unnamed numbers. Raise NetworkProblem."""
    joints, names = (tuple(_items(metadata, key)) for key in ("joint_names", "observation_names"))
    numbers = {
        name: tuple(_number(name, text) for text in _items(metadata, name)) for name in _ACTION_KEYS.values() if joints
    }
    moved = [name in (order or ()) for name in joints]
    if any(1 < len(some) < len(joints) for some in numbers.values()) and order == (*itertools.compress(joints, moved),):
        for name, some in numbers.items():
            numbers[name] = tuple(itertools.compress(some, moved)) if len(some) == len(joints) else some
        joints = order
    action = {}
    for key, name in _ACTION_KEYS.items():
        if values := numbers.get(name):
            if len(values) not in (1, len(joints)):
                advice = "; name the joints that have a motor in 'order'" if len(values) < len(joints) else ""
                raise NetworkProblem(f"states {len(values)} numbers as '{name}' for {len(joints)} joints{advice}")
            action[key] = values if len(values) > 1 else values[0]
    if without_gains := _without_gains(action, joints):
        del action["stiffness"], action["damping"]
    return Stated(joints, action, names, tuple(_terms(metadata, names)), without_gains)


def _without_gains(action: Mapping[str, float | tuple[float, ...]], joints: Sequence[str]) -> str:
    """Return the first joint whose stated gains belong to its last actuator in MuJoCo, not to the policy.

    mjlab 1.6 states 1 and 0 for a motor, whose gains are outside of the model, and twice the damping for a position
    actuator with a velocity actuator after it.
    """
    if not {"stiffness", "damping"} <= action.keys():
        return ""
    gains = zip(joints, *(values_of(action[key], joints, {}) for key in ("stiffness", "damping")), strict=True)
    return next((name for name, spring, damper in gains if damper == spring > 0 or (spring, damper) == (1, 0)), "")


def _items(metadata: Mapping[str, str], key: str) -> list[str]:
    return [item.strip() for item in _ITEM.findall(metadata.get(key, "")) if item.strip()]


def _number(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise NetworkProblem(f"states {shown(text)} in '{name}', which is not a number") from None


def _terms(metadata: Mapping[str, str], names: Sequence[str]) -> Iterator[dict[str, Any]]:
    scales, clips, lengths = (
        next((entries for key in keys if (entries := _items(metadata, key))), [""] * len(names))
        for keys in (
            ("observation_terms_scale",),
            ("observation_terms_clip",),
            ("observation_terms_history_length", "observation_history_lengths"),
        )
    )
    if not len(names) == len(scales) == len(clips) == len(lengths):
        raise NetworkProblem(f"states {len(names)} observations, with scales, clips or histories for another number")
    for name, scale, clip, length in zip(names, scales, clips, lengths, strict=True):
        term: dict[str, Any] = {"term": _TERMS[name]} if name in _TERMS else {}
        numbers, bounds = _entry("observation_terms_scale", scale), _entry("observation_terms_clip", clip)
        if numbers:
            term["scale"] = numbers if len(numbers) > 1 else numbers[0]
        if len(bounds) > 1 and bounds[0] != -bounds[1]:
            text = f"states the clip {bounds[0]:g} to {bounds[1]:g} for '{name}'; a term is clipped to -X to X"
            raise NetworkProblem(text)
        # mjlab and Isaac Lab clip before they scale, a term is clipped after it.
        sizes = {abs(number) for number in numbers or (1.0,)}
        if bounds and math.isfinite(bounds[-1]) and sizes != {0.0}:
            if len(sizes) > 1:
                raise NetworkProblem(f"states one clip and several scales for '{name}'; a term has one clip after them")
            term["clip"] = bounds[-1] * sizes.pop()
        if length:
            term["frames"] = max(1, round(_number("observation history", length)))
        yield term


def _entry(name: str, text: str) -> tuple[float, ...]:
    """Return the numbers of an observation: "[1.0, 2.0]", or "1.000;2.000" as mjlab 1.6 has it."""
    return tuple(_number(name, number) for number in re.split("[,;]", text.strip("[]")) if text)


def contradictions(
    stated: Stated, layout: Layout, action: PolicyAction | None, terms: Sequence[Term], frames: Callable[[Term], int]
) -> SpecProblems:
    """Yield keys of a scenario that differ from the network's, with both values; `frames`: of a term."""
    if stated.joints and stated.joints != layout.joints:
        yield ("order",), f"the network states the joints {_few(stated.joints)}, and the scenario {_few(layout.joints)}"
        return
    for key, values in stated.action.items() if action is not None and action.joints == "position" else ():
        own = getattr(action, key)
        if own is not None:
            differing = _differing(values_of(values, layout.joints, {}), values_of(own, layout.joints, layout.home))
            for index, number, other in differing:
                source = f"'{_ACTION_KEYS[key]}' {number:g} for joint '{layout.joints[index]}'"
                yield ("action", key), f"the network states {source}, and the scenario {other:g}"
                break
    if terms and len(terms) != len(stated.names) > 0:
        texts = _few(stated.names), _few(term.term for term in terms)
        yield ("observation",), f"the network states the observations {texts[0]}, and the scenario {texts[1]}"
    elif terms and stated.names:
        for index, (name, theirs, term) in enumerate(zip(stated.names, stated.terms, terms, strict=True)):
            for problem in _term_problems(theirs, term, layout, frames(term)):
                yield ("observation", index), f"the network states {problem} for '{name}'"
                break


def _term_problems(theirs: Mapping[str, Any], term: Term, layout: Layout, frames: int) -> Iterator[str]:
    # A sensor may measure what the network states.
    if theirs.get("term", term.term) != term.term and term.sensor is None:
        yield f"'{theirs['term']}', and the scenario '{term.term}'"
    clip = theirs.get("clip", term.clip)
    if clip != term.clip and (term.clip is None or any(_differing((clip,), (term.clip,)))):
        yield f"'clip' {clip:g} after its scale, and the scenario {shown(term.clip)}"
    if theirs.get("frames", frames) != frames:
        yield f"'frames' {theirs['frames']:g}, and the scenario {frames}"
    names = layout.of(term) if isinstance(term.scale, Mapping) else list(map(str, range(term.size(layout) or 1)))
    scales = (values_of(scale, names, {}) for scale in (theirs.get("scale", term.scale), term.scale))
    for _, stated, ours in _differing(*scales):
        yield f"'scale' {stated:g}, and the scenario {ours:g}"


def _differing(theirs: Sequence[float], ours: Sequence[float]) -> Iterator[tuple[int, float, float]]:
    for index, (stated, own) in enumerate(zip(theirs, ours, strict=False)):
        if abs(stated - own) > _ROUNDING + 1e-3 * abs(stated):
            yield index, stated, own


def _few(names: Iterable[str], most: int = 12) -> str:
    texts = list(names)
    return ", ".join(texts[:most]) + (", ..." if len(texts) > most else "")
