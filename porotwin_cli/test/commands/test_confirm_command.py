"""./porotwin confirm."""

from collections.abc import Iterator

import pytest
from cli_examples import porotwin

rclpy = pytest.importorskip('rclpy', reason='needs ROS 2; set it up with ./porotwin')

from porotwin_core.basis.errors import InputError  # noqa: E402
from porotwin_core.ros import conversions  # noqa: E402
from porotwin_core.ros.node_thread import NodeThread  # noqa: E402
from porotwin_core.ros.vouching import OnlyCaller  # noqa: E402
from porotwin_msgs.srv import ConfirmRates  # noqa: E402

pytestmark = pytest.mark.graph


@pytest.fixture
def confirmed(domain: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[list[int]]:
    """The setpoints that an operator node has taken; it takes number 7."""
    monkeypatch.setenv('ROS_DOMAIN_ID', str(domain))
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    operator = rclpy.create_node('operator', namespace='/porotwin', context=context)
    callers, taken = OnlyCaller(operator, 'operator/confirm'), []

    def confirm(
        request: ConfirmRates.Request, response: ConfirmRates.Response
    ) -> ConfirmRates.Response:
        callers.check(request)
        response.outcome = conversions.ok()
        if request.sequence != 7:
            response.outcome = conversions.refusal(InputError('set and confirm setpoint 7'))
        elif not request.wells:
            taken.append(request.sequence)
        return response

    operator.create_service(ConfirmRates, 'operator/confirm', confirm)
    thread = NodeThread(operator, threads=2)
    yield taken
    thread.end()


def test_a_setpoint_is_confirmed_without_a_page(confirmed: list[int]) -> None:
    wrong = porotwin('confirm', '8')
    assert (wrong.returncode, 'confirm setpoint 7' in wrong.stderr) == (2, True)
    assert confirmed == []
    assert porotwin('confirm', '7').stdout == 'setpoint 7: confirmed\n'
    assert confirmed == [7]
