"""What a server imports before it listens, and with its simulation."""

import subprocess
import sys

LOADED = """
import sys
from radarsim.cli.serve import make_own_server
from radarsim.cli.server_options import load_host
from radarsim.server.tcp_server import Server
from radarsim.simulation.config import SimulationConfig
host = load_host(sys.argv[1], SimulationConfig(), seed=0, begins=False)
Server(host), make_own_server("image", host, 0), host.connect()
print(*{"scipy", "shapely", "matplotlib", "embreex"} & set(sys.modules))
host.begin(host.make_simulation())
print(*{"scipy.signal", "matplotlib"} & set(sys.modules))
"""


def test_server_imports_nothing_slow_that_it_does_not_use() -> None:
    command = (sys.executable, "-c", LOADED, "smoke_room")
    assert subprocess.check_output(command, text=True) == "\n\n"
