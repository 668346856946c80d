"""The answer of a person to an offer to mend the model, as a browser sends it."""

from typing import Any, NamedTuple

from porotwin_core.basis.errors import InputError

LONGEST_ANSWER_S = 60.0
"""Longest wait until an accepted effect acts [s]; a large model takes ten to change."""

LARGEST_NUMBER = 2**64 - 1
"""Largest number that a message can carry (uint64)."""


class MendAnswer(NamedTuple):
    """Whether the offer `sequence` is accepted."""

    sequence: int
    accept: bool


def parse_mend_answer(data: Any) -> MendAnswer:
    """Return the answer in a decoded JSON text.

    Raises:
        InputError: it is of another form.
    """
    given = data if isinstance(data, dict) else {}
    sequence, accept = given.get('sequence'), given.get('accept')
    if (
        type(sequence) is not int
        or not 1 <= sequence <= LARGEST_NUMBER
        or not isinstance(accept, bool)
    ):
        raise InputError('answer: send {"sequence": number of the offer, "accept": true or false}')
    return MendAnswer(sequence, accept)
