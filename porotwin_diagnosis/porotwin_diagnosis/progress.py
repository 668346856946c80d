"""How a diagnosis says how far it is."""

from collections.abc import Callable

Progress = Callable[[str, float], None]
"""Told the stage and the share that is done."""


def forward_only(progress: Progress) -> Progress:
    """Return `progress` with shares that never go back where a stage is gone through again."""
    reached = 0.0

    def told(stage: str, share: float) -> None:
        nonlocal reached
        reached = max(reached, share)
        progress(stage, reached)

    return told
