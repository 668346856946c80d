"""Random messages of a stranger."""

import random
from typing import Any

import pytest
from rcl_interfaces.srv import SetParameters
from rclpy.serialization import deserialize_message, serialize_message

from lab.faults.graph_fuzzing import Stranger
from porotwin_msgs.msg import CycleReport, RigDescription, Setpoint, TracerField, WellRate
from porotwin_msgs.srv import Correct, Rollout

KINDS = (
    CycleReport, RigDescription, Setpoint, TracerField, Correct.Request, Rollout.Request,
    SetParameters.Request,
)  # fmt: skip


@pytest.mark.parametrize('kind', KINDS)
def test_every_message_of_a_stranger_can_be_sent(kind: Any) -> None:
    stranger = Stranger(random.Random(1))
    sent = [serialize_message(stranger.message(kind)) for _ in range(30)]
    assert len(set(sent)) > 20
    assert all(isinstance(deserialize_message(data, kind), kind) for data in sent)


def test_a_message_that_was_seen_is_damaged_in_few_places() -> None:
    stranger = Stranger(random.Random(2))
    seen = Setpoint(reason='seen', wells=[WellRate(well=f'well {n}') for n in range(5)])
    stranger.seen[Setpoint] = seen
    alike = [
        sum(given.well == well.well for given, well in zip(message.wells, seen.wells, strict=True))
        for message in (stranger.message(Setpoint) for _ in range(40))
        if len(message.wells) == len(seen.wells)
    ]
    assert sum(count >= 3 for count in alike) > 15
    assert seen == Setpoint(reason='seen', wells=[WellRate(well=f'well {n}') for n in range(5)])
