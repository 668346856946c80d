"""A fault: its injection, its signs, the reaction of the twin, and the remedy.

A fault is one function with the decorator `fault`. It injects the fault into a running twin. If it
is a generator, everything after its `yield` mends the fault. The decorator holds the documented
state, which the suite checks and docs/faults.md shows.
"""

import importlib
import inspect
import pkgutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol

from diagnostic_msgs.msg import DiagnosticStatus

LEVELS = {
    b'\x00': 'OK',
    b'\x01': 'WARN',
    b'\x02': 'ERROR',
    b'\x03': 'STALE',
}
"""Words for the levels of `DiagnosticStatus`."""


class Seen(Protocol):
    """All that a twin said since a moment."""

    statuses: list[DiagnosticStatus]
    remarks: list[str]
    supervisor: list[str]

    def log(self, node: str) -> str:
        """Return the log of a node."""
        ...


@dataclass(frozen=True)
class Status:
    """A status of `node` on /diagnostics with this text in its message."""

    node: str
    level: str
    text: str

    def __str__(self) -> str:
        return f'/diagnostics: {self.node} {self.level} "{self.text}"'

    def shows(self, seen: Seen) -> bool:
        """Return whether the twin said so."""
        return any(
            status.name == self.node
            and LEVELS[bytes(status.level)] == self.level
            and self.text in status.message
            for status in seen.statuses
        )


@dataclass(frozen=True)
class Remark:
    """A remark of the hub's report of a cycle (topic hub/cycle)."""

    text: str

    def __str__(self) -> str:
        return f'hub/cycle: "{self.text}"'

    def shows(self, seen: Seen) -> bool:
        """Return whether the twin said so."""
        return any(self.text in remark for remark in seen.remarks)


@dataclass(frozen=True)
class LogLine:
    """A line in the log of a node."""

    node: str
    text: str

    def __str__(self) -> str:
        return f'log of {self.node}: "{self.text}"'

    def shows(self, seen: Seen) -> bool:
        """Return whether the twin said so."""
        return self.text in seen.log(self.node)


@dataclass(frozen=True)
class SupervisorLine:
    """A line that `./porotwin up` prints."""

    text: str

    def __str__(self) -> str:
        return f'`up` prints: "{self.text}"'

    def shows(self, seen: Seen) -> bool:
        """Return whether the twin said so."""
        return any(self.text in line for line in seen.supervisor)


@dataclass(frozen=True)
class Answer:
    """The refusal of a request; the function that injects the fault checks it itself."""

    text: str

    def __str__(self) -> str:
        return f'the request is refused: "{self.text}"'

    def shows(self, seen: Seen) -> bool:
        """Return True: the fault's function has checked the answer."""
        return True


Sign = Status | Remark | LogLine | SupervisorLine | Answer
"""A sign of a fault."""


@dataclass(frozen=True)
class Fault:
    """A fault and its documented state.

    Attributes:
        name: name of its function.
        group: title of its module, for the table.
        injected: the fault, as a user would say it.
        signs: how it shows; all of them within two cycles.
        does: the reaction of the twin.
        mends: the remedy.
        inject: injects it; the code after a `yield` mends it.
        restarts: nodes that start again because of it.
    """

    name: str
    group: str
    injected: str
    signs: tuple[Sign, ...]
    does: str
    mends: str
    inject: Callable[[Any], Iterator[None] | None]

    def __str__(self) -> str:
        return self.name

    @contextmanager
    def injected_into(self, stage: Any) -> Iterator[None]:
        """Inject the fault, and mend it at the end of the block."""
        if inspect.isgeneratorfunction(self.inject):
            with contextmanager(self.inject)(stage):
                yield
        else:
            self.inject(stage)
            yield


FAULTS: list[Fault] = []
"""All faults, in the order of their definition; `all_faults` fills it."""


def fault(
    injected: str, *signs: Sign, does: str, mends: str
) -> Callable[[Callable[[Any], Any]], Callable[[Any], Any]]:
    """Make a fault of the decorated function, which receives the running twin."""

    def make(inject: Callable[[Any], Any]) -> Callable[[Any], Any]:
        group = (inspect.getdoc(inspect.getmodule(inject)) or '').split('.')[0]
        FAULTS.append(Fault(inject.__name__, group, injected, signs, does, mends, inject))
        return inject

    return make


def all_faults() -> list[Fault]:
    """Return the faults of all modules `faults.of_*`."""
    package = importlib.import_module('faults')
    for module in sorted(item.name for item in pkgutil.iter_modules(package.__path__)):
        if module.startswith('of_'):
            importlib.import_module(f'faults.{module}')
    names = [item.name for item in FAULTS]
    assert len(set(names)) == len(names), 'two faults have the same name'
    return FAULTS
