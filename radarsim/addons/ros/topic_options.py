"""Which topics a bridge has: options of ``radarsim ros``."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from annotated_types import Interval

from radarsim.cli.fields import Port
from radarsim.plans import RARE, Option, Sets


@dataclass(frozen=True, slots=True, kw_only=True)
class TopicOptions:
    """Which topics there are, and how they are named.

    Attributes:
        map: Map this robot, and publish the map each second.
        draw: Publish the surfaces of this map, which the server serves, on /scene.
        true_map: Publish on /map where robots cannot drive in that map.
        no_namespace: Leave the name of this robot out of its topics and frames, as in
            /odom and base_link.
        own_localization: Leave the transform from map to odom to a program of yours,
            such as AMCL or slam_toolbox; otherwise it is the truth.
        echoes: Publish the echoes and targets of all scanners as well.
        image_port: Publish pictures of the first robot's camera, which 'radarsim serve
            --image-port' draws on this port.
        image_rate: Pictures in a second.
    """

    option_group: ClassVar = "Topics"
    at_most_one: ClassVar[Sets] = (("map", "true_map"),)

    map: Annotated[str | None, Option(metavar="ROBOT")] = None
    draw: Annotated[str | None, Option(metavar="MAP", words="maps")] = None
    true_map: Annotated[bool, Option(needs=("draw",))] = False
    no_namespace: Annotated[str | None, Option(metavar="ROBOT")] = None
    own_localization: bool = False
    echoes: Annotated[bool, RARE] = False
    image_port: Annotated[Port | None, RARE] = None
    image_rate: Annotated[
        float, Interval(gt=0, le=5), Option(metavar="HZ", is_rare=True)
    ] = 2.0
