"""The option --seed of the commands that draw random numbers."""

from typing import Any

import typer

from porotwin_core.ros.parameter_rule import LARGEST_WHOLE


def seed_option(help_text: str) -> Any:
    """Return the option of a seed, whose range is that of the nodes.

    Args:
        help_text: the purpose of the seed.
    """
    return typer.Option(help=help_text, min=0, max=LARGEST_WHOLE)
