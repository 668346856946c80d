"""Parameters. Every parameter of every node is set to its extremes while the nodes run."""

import math
import re
from collections.abc import Iterator
from typing import Any

from rcl_interfaces.msg import Parameter, ParameterDescriptor, ParameterType, ParameterValue
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters
from rclpy.parameter import Parameter as PythonParameter

from faults.fault import Answer, LogLine, fault
from faults.stage import Stage

HELD = ('photo_interval_s', 'trust', 'rig', 'grid', 'control')
"""Parameters that decide which photographs count, and what pumps may do: none changes in a run."""

STRANGE: tuple[Any, ...] = (
    math.nan, math.inf, -math.inf, 1e308, -1e308, 5e-324, 0.0, 0, -1, 2**63 - 1, -(2**63), True,
    False, '', 5000 * 'x', '\x1b[2J', [1.0, math.nan], ['x'], [], b'x',
)  # fmt: skip
"""Values of every type; most are of the wrong one for each parameter."""


def value_of(value: Any) -> ParameterValue:
    """Return a value as ROS sends it."""
    of_python = [value] if isinstance(value, bytes) else value
    return PythonParameter('any', value=of_python).get_parameter_value()


def ends_of(descriptor: ParameterDescriptor) -> list[Any]:
    """Return the least and the greatest allowed value of a parameter, or its first and last."""
    words = descriptor.additional_constraints
    if words.startswith('one of: '):
        choices = words.removeprefix('one of: ').split(', ')
        return [choices[0], choices[-1]]
    kind = {ParameterType.PARAMETER_INTEGER: int, ParameterType.PARAMETER_DOUBLE: float}
    found = re.fullmatch(r'from (\S+) to (\S+)', words)
    if found is None or descriptor.type not in kind:
        return []
    return [kind[descriptor.type](float(one)) for one in found.groups()]


class Parameters:
    """The parameters of all nodes of a twin."""

    def __init__(self, stage: Stage) -> None:
        """Ask the nodes for them."""
        self._stage = stage
        self.described: dict[str, list[ParameterDescriptor]] = {}
        self._first: dict[str, list[Parameter]] = {}
        for node in stage.graph.nodes:
            listed = stage.call(ListParameters, f'{node}/list_parameters', ListParameters.Request())
            names = listed.result.names
            asked = DescribeParameters.Request(names=names)
            answer = stage.call(DescribeParameters, f'{node}/describe_parameters', asked)
            self.described[node] = answer.descriptors
            values = stage.call(
                GetParameters, f'{node}/get_parameters', GetParameters.Request(names=names)
            ).values
            self._first[node] = [
                Parameter(name=name, value=value) for name, value in zip(names, values, strict=True)
            ]

    def set_to(self, node: str, wanted: list[Parameter]) -> list[str]:
        """Set parameters of a node one after the other; return those that it took.

        A refusal is one line.
        """
        request = SetParameters.Request(parameters=wanted)
        results = self._stage.call(SetParameters, f'{node}/set_parameters', request).results
        assert all('\n' not in one.reason for one in results), results
        return [one.name for one, result in zip(wanted, results, strict=True) if result.successful]

    def set_all(self, value: Any) -> set[str]:
        """Set every parameter of every node to `value`; return the names of those that took it."""
        taken = set[str]()
        for node, descriptors in self.described.items():
            wanted = [Parameter(name=one.name, value=value_of(value)) for one in descriptors]
            taken |= set(self.set_to(node, wanted))
        return taken

    def set_ends(self, end: int) -> set[str]:
        """Set every parameter to its least (0) or greatest (-1) value; return those taken."""
        taken = set[str]()
        for node, descriptors in self.described.items():
            ends = [(one.name, ends_of(one)) for one in descriptors]
            wanted = [Parameter(name=n, value=value_of(found[end])) for n, found in ends if found]
            taken |= set(self.set_to(node, wanted))
        return taken

    def set_back(self) -> None:
        """Give every parameter its first value again."""
        for node, wanted in self._first.items():
            self.set_to(node, wanted)


def run_cycle(stage: Stage) -> None:
    """Take a photograph, and wait until the hub has done a cycle."""
    reports = stage.graph.messages['hub/cycle']
    before = len(reports)
    stage.good_photograph()
    stage.wait_for('a cycle', lambda: len(reports) > before)


@fault(
    'Every parameter of every node is set to its extremes while the nodes run: the least and the '
    'greatest value, NaN, infinity, 5000 characters, another type.',
    Answer('it must be'),
    LogLine('supervisor', 'the parameter confirm_timeout_s was set to 60.0'),
    does='Refuses values out of range, and parameters that hold in a run, such as the interval and '
    'the trusted time of photographs. No node ends. Every setpoint keeps the limits.',
    mends='set the parameters back',
)
def parameters_at_extremes(stage: Stage) -> Iterator[None]:
    pids = {node: stage.pid(node) for node in stage.graph.nodes}
    parameters = Parameters(stage)
    taken = set[str]()
    for value in STRANGE:
        taken |= parameters.set_all(value)
    for end in (0, -1):
        taken |= parameters.set_ends(end)
        run_cycle(stage)
    assert taken.isdisjoint(HELD), taken
    assert {'evaluations', 'horizon_s', 'optimiser'} <= taken
    yield
    parameters.set_back()
    assert {node: stage.pid(node) for node in stage.graph.nodes} == pids
