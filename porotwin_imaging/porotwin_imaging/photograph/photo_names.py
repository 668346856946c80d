"""Names of photographs in messages: a user must know which file to mend."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from porotwin_core.basis.errors import InputError


def baseline_names(names: Sequence[str], count: int) -> list[str]:
    """Return how messages call `count` baselines: the `names` of their files, or their numbers.

    A single baseline without a name needs none, so that its name is empty.

    Raises:
        InputError: there are names, but not one for each baseline.
    """
    if names and len(names) != count:
        raise InputError(f'{count} baselines have {len(names)} names; give one for each, or none')
    if names or count == 1:
        return list(names) or ['']
    return [f'baseline {number}' for number in range(1, count + 1)]


@contextmanager
def named(name: str) -> Iterator[None]:
    """Put `name` before the message of an `InputError` that is raised inside; '' changes nothing.

    Raises:
        InputError: with the name.
    """
    try:
        yield
    except InputError as error:
        if not name:
            raise
        raise InputError(f'{name}: {error}') from None
