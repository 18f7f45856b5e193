"""What a shell completes: names of maps, sensors and robot classes, quickly.

Nothing heavy is imported: a shell asks whenever Tab is pressed.
"""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final, Literal

import click
import click.shell_completion

# Where shells look for what completes the words of a program.
_FILES: Final = {
    "bash": ".local/share/bash-completion/completions/radarsim",
    "fish": ".config/fish/completions/radarsim.fish",
    "zsh": ".zfunc/_radarsim",
}


def complete_map(incomplete: str) -> Iterator[str]:
    """Yield names of shipped maps, and map files."""
    package = Path(__file__).resolve().parents[1]
    for folder in (package / "maps", package.parent / "maps"):
        yield from _beginning(incomplete, (p.stem for p in folder.glob("*.yaml")))
    start = Path(incomplete)
    folder = start if incomplete.endswith("/") else start.parent
    for path in sorted(folder.glob("*")):
        if path.is_dir():
            yield from _beginning(incomplete, [f"{path}/"])
        elif path.suffix in (".yaml", ".yml"):
            yield from _beginning(incomplete, [str(path)])


def complete_words(
    kind: Literal["maps", "sensors", "robots"], incomplete: str
) -> Iterator[str]:
    """Return the words of a kind that begin so: maps, sensors or robots."""
    if kind == "maps":
        return complete_map(incomplete)
    from radarsim.presets import preset_names

    return _beginning(incomplete, preset_names(kind))


def _beginning(incomplete: str, names: Iterable[str]) -> Iterator[str]:
    return (name for name in sorted(names) if name.startswith(incomplete))


def completion_options() -> list[click.Parameter]:
    """Return the options that give completion to a shell."""
    install = "Let this shell complete commands, options and names."
    show = "Print what a shell has to read for that."
    return [
        click.Option(
            [name],
            type=click.Choice(list(_FILES)),
            is_eager=True,
            expose_value=False,
            callback=callback,
            help=text,
        )
        for name, callback, text in (
            ("--install-completion", _install, install),
            ("--show-completion", _show, show),
        )
    ]


def _script(shell: str) -> str:
    kind = click.shell_completion.get_completion_class(shell)
    assert kind is not None
    # Any group will do: the script asks the program itself whenever Tab is pressed.
    return kind(click.Group(), {}, "radarsim", "_RADARSIM_COMPLETE").source()


def _show(ctx: click.Context, _: click.Parameter, shell: str | None) -> None:
    if shell is not None and not ctx.resilient_parsing:
        click.echo(_script(shell))
        ctx.exit()


def _install(ctx: click.Context, _: click.Parameter, shell: str | None) -> None:
    if shell is None or ctx.resilient_parsing:
        return
    path = Path.home() / _FILES[shell]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(_script(shell), encoding="utf-8")
    how = "; add its folder to fpath in ~/.zshrc" if shell == "zsh" else ""
    click.echo(f"wrote {path}{how}; new shells complete")
    ctx.exit()
