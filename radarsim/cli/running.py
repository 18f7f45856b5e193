"""One run of a navigator: its server, its judge, and what is known of it."""

from radarsim.cli.progress import progress
from radarsim.client import Client
from radarsim.host import Host
from radarsim.navigation.mission import Mission, carry_out
from radarsim.navigation.pilot import Moment, Result
from radarsim.navigation.record import Record
from radarsim.scene.scene import Scene
from radarsim.study.lockstep import HostLink
from radarsim.study.trials import Referee


class Run:
    """One run: what was wished, what is known of it, and how it ended.

    Attributes:
        mission: What to do.
        host: The server, if it is in this process.
        referee: Watches the true robot, if that can be.
        record: What it was like.
        result: None while it lasts, and where it broke off.
        error: What went wrong; empty if nothing did.
    """

    def __init__(self, mission: Mission, host: Host | None) -> None:
        self.mission = mission
        self.host = host
        self.referee = None if host is None else Referee(host)
        self.record = Record()
        self.result: Result | None = None
        self.error = ""

    @property
    def scene(self) -> Scene | None:
        """The map, where the server is in this process."""
        return None if self.host is None else self.host.simulation.scene

    @property
    def outcome(self) -> str:
        """``reached``, ``no_path`` or ``failed``."""
        return "failed" if self.result is None else self.result.outcome

    def drive(self, address: tuple[str, int]) -> None:
        """Connect and drive, and tell on stderr how it goes.

        Args:
            address: Of the server, unless it is in this process.

        Raises:
            ClientError: If the server does not say what is needed.
            NavigationError: If the robot cannot do what is asked of it.
        """
        with self._connect(address) as client, progress(self.record) as teller:

            def observe(moment: Moment) -> None:
                teller.tell(self.record.add(moment))

            self.result = carry_out(client, self.mission, observe)
        if self.outcome == "failed":
            left = self.record.rows[-1].goal_distance
            limit = f"within {self.mission.time_limit:g} s"
            self.error = f"goal not reached {limit}, {left:.2f} m from it"

    def _connect(self, address: tuple[str, int]) -> Client:
        """Connect to the server, wherever it is."""
        if self.host is None or self.referee is None:
            return Client.connect(*address)
        return Client(HostLink(self.host, after_tick=self.referee.watch))
