"""Computes the poses of parts and frames of an SDF model or world.

Source: the specification of SDFormat 1.11, and its proposal "Pose Frame Semantics".
"""

import math
import warnings
from collections.abc import Callable
from typing import Final

from scipy.spatial.transform import Rotation

from radarsim.addons.imports.source_file import XmlElement
from radarsim.geometry import Pose3

MAX_CHAIN: Final = 100  # longest chain of relative poses
ORIGIN: Final = Pose3(0.0, 0.0, 0.0)
_HERE: Final = ("", "world", "__model__")


class LeftOut(Exception):
    """Raised if a part of an SDF file cannot be imported and is left out.

    Attributes:
        element: The element that contains the part, or refers to it.
        reason: Reason for the summary, in words that follow a number; empty for parts
            that a map does not need.
    """

    def __init__(self, element: XmlElement, text: str, reason: str) -> None:
        super().__init__(text)
        self.element = element
        self.reason = reason


class Frames:
    """Computes the poses of elements in a model or a world."""

    def __init__(
        self, scope: XmlElement, model_of: Callable[[XmlElement], XmlElement]
    ) -> None:
        """Create frames whose poses are not computed yet.

        Args:
            scope: The model or world.
            model_of: Returns the model of an include, or raises `LeftOut`.
        """
        self._scope = scope
        self._model_of = model_of
        self._named: dict[str, XmlElement] | None = None
        self._inner: dict[int, Frames] = {}  # frames by the id() of a model
        self._poses: dict[str, Pose3] = dict.fromkeys(_HERE, ORIGIN)

    def pose(
        self, element: XmlElement, base: Pose3 = ORIGIN, *, depth: int = 0
    ) -> Pose3:
        """Return the pose of an element in the frame of the model or world.

        Args:
            element: An element of the scope, or a child of such an element.
            base: Frame of the pose if the element names no frame.
            depth: Length of the chain of poses that depend on this pose.

        Raises:
            LeftOut: If the pose is relative to an unknown frame.
            ForeignFileError: If the pose is malformed, or relative to itself.
        """
        given = element.first("pose")
        relative = given.attributes.get("relative_to", "") if given else ""
        if not relative and element.tag == "frame":
            relative = element.attributes.get("attached_to", "")
        elif not relative and element.tag == "joint":
            relative = element.text_of("child")
        outer = self._frame(relative, element, depth) if relative else base
        pose = outer.compose(parse_pose(given)) if given else outer
        placed = element.attributes.get("placement_frame", "")
        if element.tag == "model" and placed:
            inner = self._inside(element)._frame(placed, element, depth)
            pose = pose.compose(inner.inverse())
        return pose

    def _frame(self, name: str, user: XmlElement, depth: int) -> Pose3:
        """Return the pose of a named frame; ``user`` is the element that names it."""
        if name not in self._poses:
            if depth >= MAX_CHAIN:
                text = f"a chain of more than {MAX_CHAIN} relative poses"
                raise user.wrong(f"{text}, expected no loop")
            head, _, rest = name.partition("::")
            named = self._find(head)
            if named is None or (rest and named.tag != "model"):
                text = f"<{user.tag}> {user.name!r} is left out: its pose is relative"
                reason = "with a pose relative to a missing element"
                raise LeftOut(user, f"{text} to {name!r}, which does not exist", reason)
            pose = self.pose(named, depth=depth + 1)
            if rest:
                inner = self._inside(named)._frame(rest, user, depth + 1)
                pose = pose.compose(inner)
            self._poses[name] = pose
        return self._poses[name]

    def _inside(self, model: XmlElement) -> "Frames":
        """Return the cached frames of a nested model."""
        # Two poses of a model may depend on frames of a nested model. Without a cache,
        # the time would double at each level of nesting.
        if id(model) not in self._inner:
            self._inner[id(model)] = Frames(model, self._model_of)
        return self._inner[id(model)]

    def _find(self, name: str) -> XmlElement | None:
        """Return the link, frame, joint or model with a name, or None if missing."""
        if self._named is None:
            self._named = {}
            for child in self._scope.children:
                if child.tag in ("link", "frame", "joint", "model"):
                    self._named.setdefault(child.name, child)
                elif child.tag == "include":
                    try:
                        model = self._model_of(child)
                    except LeftOut:
                        continue
                    self._named.setdefault(model.name, model)
        return self._named.get(name)


def parse_pose(pose: XmlElement) -> Pose3:
    """Parse the numbers of a ``pose`` element, without applying ``relative_to``.

    Raises:
        ForeignFileError: If the pose is malformed.
    """
    if not pose.text.strip():
        return ORIGIN
    if pose.attributes.get("rotation_format") == "quat_xyzw":
        x, y, z, *quaternion = pose.numbers(7)
        largest = max(map(abs, quaternion))  # the squared length may underflow
        if not largest:
            raise pose.wrong("a quaternion of length 0, expected more than 0")
        rotation = Rotation.from_quat([each / largest for each in quaternion])
        with warnings.catch_warnings():  # gimbal lock sets roll to 0, with a warning
            warnings.simplefilter("ignore")
            yaw, pitch, roll = map(float, rotation.as_euler("ZYX"))
    else:
        x, y, z, roll, pitch, yaw = pose.numbers(6)
        if pose.attributes.get("degrees") in ("true", "1"):
            roll, pitch, yaw = map(math.radians, (roll, pitch, yaw))
    return Pose3(x, y, z, roll, pitch, yaw)
