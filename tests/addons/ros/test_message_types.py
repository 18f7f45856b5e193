"""Definitions of types agree with those of rosbags, which has them from ROS."""

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from radarsim.addons.ros.message_types import FIELDS, full_text, type_definition

STORE = get_typestore(Stores.ROS2_JAZZY)


@pytest.mark.parametrize("name", FIELDS)
def test_full_text_defines_the_type_and_all_within(name: str) -> None:
    found = get_types_from_msg(full_text(name), name)
    assert name in found
    for each, definition in found.items():
        assert definition[1] == STORE.fielddefs[each][1]


def test_arrays_have_their_lengths() -> None:
    lengths = dict(
        zip(
            *(
                type_definition(name)[key]
                for name in ("geometry_msgs/msg/PoseWithCovariance",)
                for key in ("fieldnames", "fieldarraylen")
            ),
            strict=True,
        )
    )
    assert lengths == {"pose": -1, "covariance": 36}
    assert type_definition("tf2_msgs/msg/TFMessage")["fieldarraylen"] == [0]
