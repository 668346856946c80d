"""The option --seed of the commands that draw random numbers."""

from typing import Any

import typer

LARGEST_SEED = 2**32 - 1
"""Largest seed that all generators of random numbers take; none takes a negative one."""


def seed_option(help_text: str) -> Any:
    """Return the option of a seed.

    Args:
        help_text: the purpose of the seed.
    """
    return typer.Option(help=help_text, min=0, max=LARGEST_SEED)
