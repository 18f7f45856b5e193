"""A run of ``radarsim map`` that explores, from its start to its files."""

from radarsim.cli.film import filmed
from radarsim.cli.map_files import MapOutput, save_map
from radarsim.cli.map_report import map_progress, print_result
from radarsim.cli.map_view import MapCamera
from radarsim.evaluation.mapping_run import MappingRun
from radarsim.evaluation.multi_robot_run import MultiRobotRun
from radarsim.exploration.exploration import ExplorationStep
from radarsim.signal_handlers import raise_on_signals


def explore(run: MappingRun, output: MapOutput, address: tuple[str, int]) -> None:
    """Let a run explore; write, judge and describe its map however it ends.

    Args:
        run: The run.
        output: What is made of it.
        address: Host and port of the server, unless it is in this process.
    """
    recording, camera = output.recording, MapCamera(run.result, run.exploration)
    with (
        raise_on_signals(),
        recording,
        filmed(output.film, camera.draw, output.film_speed) as update_film,
    ):
        try:
            with map_progress(run.exploration) as update:

                def observe(step: ExplorationStep) -> None:
                    update(step.activity)
                    update_film(step.observation.time)
                    recording.add_map(run.exploration.mapper)

                run.run(address, observe)
        finally:
            recording.add_map(run.exploration.mapper, last=True)
            try:
                run.judge()
            finally:
                save_map(run.result, output.files)
            print_result(run.result, as_json=output.as_json)


def explore_together(
    run: MultiRobotRun, output: MapOutput, address: tuple[str, int]
) -> None:
    """Let several robots explore; write, judge and describe their map.

    Args:
        run: The run.
        output: What is made of it.
        address: Host and port of the server, unless it is in this process.
    """
    with raise_on_signals():
        try:
            with map_progress(run.exploration) as update:

                def observe(number: int, step: ExplorationStep) -> None:
                    update(f"{number + 1} {step.activity}", number)

                run.run(address, observe)
        finally:
            try:
                run.judge()
            finally:
                save_map(run.result, output.files)
            print_result(run.result, as_json=output.as_json)
