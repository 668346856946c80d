"""Checks that one guard, and no other node, publishes setpoints."""

from collections.abc import Iterable

from porotwin_core.ros.senders import LEASE_S, UNKNOWN_NODE

LINGERING_S = LEASE_S + 5.0
"""A guard that died stays in the graph for so long beside the one that followed it [s]."""


class SetpointSource:
    """Judges the publishers of setpoints; times are on this machine's steady clock [s]."""

    def __init__(self, guard: str) -> None:
        """Expect setpoints from the node with the full name `guard`, such as /porotwin/guard."""
        self._guard = guard
        self._two_since: float | None = None

    def doubt(self, publishers: Iterable[str], steady: float) -> str:
        """Return a line if any node but one guard publishes setpoints, else an empty text.

        Args:
            publishers: full names of the publishing nodes, one for each publisher.
            steady: present time [s].
        """
        names = list(publishers)
        others = sorted(set(names) - {self._guard})
        if others:
            named = ', '.join(others).replace(UNKNOWN_NODE, 'a program without a name')
            return (
                f'Not an order: setpoints come from {named}. Follow only the guard ({self._guard}).'
            )
        if len(names) < 2:
            self._two_since = None
            return ''
        if self._two_since is None:
            self._two_since = steady
        if steady - self._two_since <= LINGERING_S:
            return ''
        return (
            f'Not an order: {len(names)} guards publish setpoints. Two graphs share one domain; '
            'end one of them.'
        )
