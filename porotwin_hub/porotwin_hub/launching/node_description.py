"""One node of the graph as its launchers see it.

A node is a package, an executable (also a module of that package) and its parameters. Names of
topics and services are relative to the namespace, except `/clock` and `/diagnostics`.
"""

from dataclasses import dataclass, field

NAMESPACE = '/porotwin'
"""Namespace of all nodes, unless a rig has one of its own."""

Parameter = bool | int | float | str
"""A value of a node's parameter."""

Parameters = dict[str, Parameter]
"""The parameters of a node by name."""


@dataclass(frozen=True)
class NodeDescription:
    """One process of the graph: `executable` of `package`, started under `name` in `namespace`."""

    name: str
    package: str
    executable: str
    parameters: Parameters = field(default_factory=dict)
    remappings: dict[str, str] = field(default_factory=dict)
    namespace: str = NAMESPACE

    @property
    def finishes(self) -> bool:
        """Whether its work has an end: that of a stand-in for a rig; others run until asked."""
        return self.package == 'porotwin_rig'

    @property
    def module(self) -> str:
        """The module to run where executables are not installed."""
        return f'{self.package}.{self.executable}'
