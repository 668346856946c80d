"""Confirms a setpoint to the operator node of a running graph."""

from porotwin_cli.running.live_diagnosis import SEARCH_S
from porotwin_cli.running.live_node import listening, live_node, silent
from porotwin_core.basis.errors import InputError
from porotwin_core.ros.senders import TERMINAL
from porotwin_core.ros.vouching import Voucher
from porotwin_msgs.msg import Outcome
from porotwin_msgs.srv import ConfirmRates

CONFIRM = 'operator/confirm'
"""Service of the operator node."""


def confirm(setpoint: int, *, namespace: str) -> None:
    """Confirm that the pumps are set as ordered.

    Raises:
        InputError: the operator node refuses, or another node offers the service too.
        WorkFailed: there is none, or it is silent.
    """
    node = live_node(TERMINAL, namespace=namespace)
    with listening(node):
        client, voucher = node.create_client(ConfirmRates, CONFIRM), Voucher(node)
        response = None
        if client.wait_for_service(SEARCH_S):
            request = ConfirmRates.Request(sequence=setpoint)
            response = voucher.ask(client, CONFIRM, request, SEARCH_S)
    if response is None:
        raise silent('operator')
    if response.outcome.code != Outcome.OK:
        raise InputError(response.outcome.message)
