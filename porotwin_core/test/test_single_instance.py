"""One node of a name per domain."""

import pytest
import rclpy
from rclpy.node import Node

from porotwin_core.single_instance import another_lives, claim_name

pytestmark = pytest.mark.graph


def test_a_node_does_not_take_itself_for_another(domain: int) -> None:
    """The probe ends before the node is made, so the node has another participant."""
    rclpy.init(domain_id=domain)
    try:
        claim_name('lonely')
        node = Node('lonely')
        assert another_lives(node) == ''
        node.destroy_node()
    finally:
        rclpy.try_shutdown()
