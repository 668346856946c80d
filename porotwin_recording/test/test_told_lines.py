"""Tests of the search in what runs said."""

from pathlib import Path

from builtin_interfaces.msg import Time
from rcl_interfaces.msg import Log
from recording_examples import bench_rig, write_live_bag
from std_msgs.msg import Header

from porotwin_core.ros.conversions import rig_to_msg
from porotwin_msgs.msg import CycleReport
from porotwin_recording.experiment.told_lines import lines_about

DEAD = 'control2 seems to deliver nothing, by the photographs: check its pump and tube'


def cycle(second: int, *remarks: str) -> tuple[str, CycleReport]:
    report = CycleReport(header=Header(stamp=Time(sec=1000 + second)), remarks=list(remarks))
    return '/rig2/hub/cycle', report


def test_the_run_in_which_a_pump_failed_is_found_with_its_time(tmp_path: Path) -> None:
    warning = Log(stamp=Time(sec=1100), level=30, name='pumps', msg='the pump of Control2 stalled')
    quiet = Log(stamp=Time(sec=1100), level=20, name='pumps', msg='control2 runs')
    write_live_bag(
        tmp_path / 'bag',
        [
            ('/rig2/rig/description', rig_to_msg(bench_rig())),
            cycle(0, 'not optimised: no answer'),
            cycle(30),
            cycle(60, DEAD),
            cycle(90, DEAD, 'not optimised: no answer'),
            ('/rosout', warning),
            ('/rosout', quiet),
        ],
    )
    found = lines_about(tmp_path / 'bag', 'CONTROL2')
    assert [(line.time_s, line.text, line.times) for line in found] == [
        (60.0, DEAD, 2),
        (100.0, 'pumps: the pump of Control2 stalled', 1),
    ]
    assert lines_about(tmp_path / 'bag', 'control3') == []
