"""Commands that are still made by typer, until they are converted."""

import click
from click.shell_completion import CompletionItem


class LegacyCommand(click.Command):
    """Passes its words on to typer."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Keep the words as they are."""
        ctx.args = args
        return args

    def invoke(self, ctx: click.Context) -> object:
        """Run the command of typer; it exits."""
        from radarsim.cli.legacy import app

        program = ctx.find_root().info_name
        return app([str(self.name), *ctx.args], prog_name=program)

    def shell_complete(
        self, ctx: click.Context, incomplete: str
    ) -> list[CompletionItem]:
        """Offer what typer does."""
        import typer
        from typer._completion_classes import BashComplete

        from radarsim.cli.legacy import app

        group = typer.main.get_command(app)
        words = [str(self.name), *ctx.args]
        complete = BashComplete(group, {}, "radarsim", "")
        found = complete.get_completions(words, incomplete)
        return [CompletionItem(each.value, each.type) for each in found]


def __getattr__(name: str) -> click.Command:
    return LegacyCommand(name, context_settings={"ignore_unknown_options": True})
