"""Questions that an input leaves open: an answer is proposed only after it was tried on the input.

A reader raises a `QuestionError` with possible answers. `settled` reads the input with each. It
proposes the answers that work for the whole input, and tells the result of each.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Protocol, TypeVar

from porotwin_core.basis.errors import InputError


class Read(Protocol):
    """The result of a reading."""

    @property
    def in_words(self) -> str:
        """The reading in a few words: its times, above all."""

    @property
    def is_apart(self) -> bool:
        """Whether its parts do not meet, such as photographs and rates of different days."""


Answers = TypeVar('Answers')
R = TypeVar('R', bound=Read)


class QuestionError(InputError):
    """A fault that other answers may mend.

    Args:
        fault: the thing and its value.
        answers: changes of the answers, by their names; options have the same names.
        otherwise: another remedy.
    """

    def __init__(self, fault: str, answers: Sequence[Mapping[str, Any]], otherwise: str) -> None:
        mark = '' if fault.endswith('?') else ';'
        super().__init__(f'{fault}{mark} {otherwise}')
        self.fault, self.answers, self.otherwise = f'{fault}{mark}', answers, otherwise


def settled(read: Callable[[Answers], R], answers: Answers) -> R:
    """Return the result of `read` for the `answers` of a person.

    Raises:
        InputError: a question is open; the line proposes the answers that work.
    """
    try:
        return read(answers)
    except QuestionError as question:
        found = list(_that_work(read, answers, question, frozenset()))
        if not found:
            raise InputError(str(question)) from None
        met = [each for each in found if not each[1].is_apart] or found
        ways = [f'{_options(change)} ({read_so.in_words})' for change, read_so in met]
        told = ', or '.join([*ways, question.otherwise])
        raise InputError(f'{question.fault} give {told}') from None


def _that_work(
    read: Callable[[Answers], R], answers: Answers, question: QuestionError, tried: frozenset[str]
) -> Iterator[tuple[Mapping[str, Any], R]]:
    """Yield the changes of the answers that work, and their results."""
    for change in question.answers:
        if tried & change.keys():
            continue
        changed = replace(answers, **change)  # type: ignore[type-var]
        try:
            yield change, read(changed)
        except QuestionError as further:  # asked next; here it matters that an answer works
            found = [result for _, result in _that_work(read, changed, further, tried | {*change})]
            yield from ((change, result) for result in sorted(found, key=_is_apart)[:1])
        except InputError:
            continue


def _is_apart(result: Read) -> bool:
    return result.is_apart


def _options(change: Mapping[str, Any]) -> str:
    return ' '.join(
        f'--{name.replace("_", "-")} {value:g}'
        if isinstance(value, float)
        else f'--{name.replace("_", "-")} {value}'
        for name, value in change.items()
    )
