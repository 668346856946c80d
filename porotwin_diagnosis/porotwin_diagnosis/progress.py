"""Functions that report the progress of a diagnosis."""

from collections.abc import Callable

Progress = Callable[[str, float], None]
"""Called with the name of the stage and the fraction of the work that is done, 0 to 1."""


def forward_only(progress: Progress) -> Progress:
    """Return `progress` with fractions that never decrease.

    Some stages run more than once; the second run keeps the fraction that was reached.
    """
    reached = 0.0

    def report(stage: str, fraction: float) -> None:
        nonlocal reached
        reached = max(reached, fraction)
        progress(stage, reached)

    return report


def no_progress(_stage: str, _fraction: float) -> None:
    """Ignore the progress."""
