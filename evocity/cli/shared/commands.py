"""Groups of commands; exit codes and messages of errors, in the words of the command line."""

import errno
import os
import sys
import warnings
from collections.abc import Callable

import click

from evocity.cli.shared.options import MAP_OPTIONS
from evocity.cli.shared.terminal import echo
from evocity.errors import EvocityError, RecipeError, reason_of, replace_parameters

# A recipe's faults are printed all at once, up to so many bytes.
_LONGEST_LIST = 20_000


class InputFault(click.ClickException):
    """The user's input is at fault: a message, no traceback, exit code 2."""

    exit_code = 2


class RunFailed(click.ClickException):
    """The run failed: a message, no traceback, exit code 1."""

    exit_code = 1


class Commands(click.Group):
    """Commands in the order of use; input at fault ends any of them with exit code 2."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(self.commands)

    def main(self, *args, **kwargs):
        warnings.formatwarning = lambda message, *_, **__: f"Warning: {message}\n"
        for stream in (sys.stdout, sys.stderr):  # a console of cp1252 has no ×: it shows ?
            if hasattr(stream, "reconfigure"):
                stream.reconfigure(errors="replace")
        return super().main(*args, **kwargs)

    def invoke(self, ctx: click.Context):
        # OpenBLAS's threads look for work, on all cores, long after a product of a few numbers
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        try:
            return super().invoke(ctx)
        except EvocityError as error:
            command = self.commands[ctx.invoked_subcommand]
            raise InputFault(message_of(error, command)) from error
        except OSError as error:  # for a file that no command has checked
            if error.errno == errno.EPIPE:
                raise
            place = "the operating system refused" if error.filename is None else error.filename
            fault = EvocityError(
                f"{place}: {reason_of(error)}",
                "files and folders that this user may use",
                "check the names, the permissions and the free space",
            )
            raise InputFault(str(fault)) from error
        except KeyboardInterrupt as error:  # or another signal, which knows its exit code
            echo("\nStopped.", err=True)
            ctx.exit(getattr(error, "exit_code", 130))


class _Command(click.Command):
    """A command with options whose word may be left out, such as ``--settle``."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        words = {name: p.words for p in self.params for name in getattr(p, "words", ()) and p.opts}
        return super().parse_args(ctx, _join_words(args, words) if words else args)


def _join_words(args: list[str], words: dict[str, tuple[str, ...]]) -> list[str]:
    """Join each option of ``words`` with its word; an option without a word has the first."""
    joined: list[str] = []
    for number, arg in enumerate(args):
        if arg == "--":
            return joined + args[number:]
        if joined and joined[-1] in words:
            if arg in words[joined[-1]]:
                joined[-1] += f"={arg}"
                continue
            joined[-1] += f"={words[joined[-1]][0]}"
        joined.append(arg)
    if joined and joined[-1] in words:
        joined[-1] += f"={words[joined[-1]][0]}"
    return joined


def command(examples: str) -> Callable[[Callable], click.Command]:
    """Declare a command whose help ends with ``examples``, and with any text below them."""
    return click.command(cls=_Command, epilog=f"\b\nExamples:{examples}")


def message_of(error: EvocityError, command: click.Command) -> str:
    """The message of an ``error`` with the options of a ``command`` in place of parameters."""
    parts = [_name_options(str(part), command) for part in error.args]
    if isinstance(error, RecipeError):
        return RecipeError(*parts).list_faults(_LONGEST_LIST)
    return str(EvocityError(*(" ".join(part.split()) for part in parts)))


def _name_options(text: str, command: click.Command) -> str:
    """``text`` with the parameters marked in it as a user of the ``command`` types them."""
    options = {p.name: p for p in command.params if isinstance(p, click.Option)}
    by_recipe = any(p.name == "recipe" for p in command.params)  # its keys say how maps are read

    def type_parameter(name: str, joint: str, value: str) -> str:
        if name in options:
            if not joint:  # Python's None
                return "all" if name == "reach" else "nothing"
            return _type_option(options[name], value)
        if by_recipe and name in MAP_OPTIONS:
            section = "[map]" if name in ("pixels", "metres_per_pixel") else "[[parents]]"
            value = value.replace("(", "[").replace(")", "]")
            return f"{name} = {value} in {section}" if value else f"{name} in {section}"
        return f"{name if joint else ''}{joint}{value}"

    return replace_parameters(text, type_parameter)


def _type_option(option: click.Option, value: str) -> str:
    """``option`` with a ``value`` of Python's, as a user types them: 4.8 45.7, or 16,20."""
    name = max(option.opts, key=len)
    values = [part.strip() for part in value.strip("()[]").split(",") if part.strip()]
    if option.is_flag or not values:
        return name
    joint = " " if option.nargs > 1 else "-" if option.type.name == "sides" else ","
    return f"{name} {joint.join(values)}"
