"""Whether what a run folder brings may be executed: an option, or a yes at the terminal."""

import contextlib
import sys
from pathlib import Path

import click

import evocity
from evocity.cli.common import echo
from evocity.errors import EvocityError

trust_option = click.option(
    "--trust",
    is_flag=True,
    help="Execute the measures and commands that the run brings, although it was not begun on this "
    "machine. Asked for at a terminal.",
)


def confirmed(run: Path, trust: bool) -> bool:
    """Whether to ``trust`` the ``run``: as the option says, or as is answered, where there is a
    terminal and something to ask for."""
    if trust or not _at_terminal():
        return trust
    from evocity.search.trust import untrusted

    found = []
    with contextlib.suppress(EvocityError, LookupError, TypeError, AttributeError):  # told later
        found = untrusted(evocity.open_run(run))
    if not found:
        return False
    echo(f"{run} was not begun on this machine, and would execute what it brings:", err=True)
    for one in found:
        echo(f"  {one}", err=True)
    return click.confirm("Do you know these, and trust them?", err=True)


def _at_terminal() -> bool:
    return sys.stdin.isatty() and sys.stderr.isatty()
