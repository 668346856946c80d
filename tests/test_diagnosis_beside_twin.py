"""The diagnosis beside the live twin: it names the withheld effect from the run so far."""

from pathlib import Path

import pytest
import rclpy
from graph import RunningGraph, running_graph
from rclpy.action import ActionClient

from porotwin_cli.running.live_diagnosis import diagnose_run_so_far
from porotwin_cli.running.rehearsal import calibration_fit
from porotwin_core.basis.errors import InputError
from porotwin_core.rig import load_rig, write_rig
from porotwin_core.ros.senders import goals_of
from porotwin_core.ros.vouching import Voucher
from porotwin_diagnosis.progress import no_progress
from porotwin_hub.launching.graph import (
    NAMESPACE,
    GraphSettings,
    NodeDescription,
    operator_node,
    twin_nodes,
)
from porotwin_imaging.tracer.calibration import save_calibration
from porotwin_msgs.action import Diagnose
from porotwin_msgs.msg import Outcome
from porotwin_recording.experiment.recording import open_recording
from porotwin_rig.camera import camera_before

pytestmark = [pytest.mark.graph, pytest.mark.slow]

ROOT = Path(__file__).resolve().parents[1]
PHOTO_WIDTH = 640
WITHHELD = 'rate:well=injector,factor=0.7'
STATES, PHOTOGRAPHS = 14, 30
"""Photographs before the diagnosis is requested, twenty minutes of the experiment, and of all."""


def rig_nodes(folder: Path) -> list[NodeDescription]:
    """Return the nodes of the twin with a diagnosis, and a virtual rig whose pump delivers 70 %."""
    rig = load_rig(ROOT / 'porotwin_hub' / 'config' / 'small_rig.yaml')
    camera = camera_before(rig, PHOTO_WIDTH).description()
    rig = rig.model_copy(update={'camera': camera})
    write_rig(rig, folder / 'rig.yaml')
    fit = calibration_fit(rig, folder, seed=5, photo_width=PHOTO_WIDTH, done=lambda _: None)
    assert not any(one.refused for one in fit.remarks)
    save_calibration(fit.calibration, folder / 'calibration.yaml')
    settings = GraphSettings(
        rig=folder / 'rig.yaml',
        calibration=folder / 'calibration.yaml',
        grid='31x19',
        evaluations=4,
        photo_interval_s=90.0,
        diagnoses=folder / 'diagnoses',
        use_sim_time=True,
    )
    asset = NodeDescription(
        'virtual_rig',
        'porotwin_rig',
        'virtual_rig_node',
        {
            'rig': str(settings.rig),
            'photo_interval_s': 90.0,
            'duration_s': 90.0 * PHOTOGRAPHS,
            'seed': 5,
            'speed': '90',
            'photo_width_px': PHOTO_WIDTH,
            'effects': WITHHELD,
        },
    )
    return [*twin_nodes(settings), operator_node(settings, asset=False), asset]


def diagnosed(
    graph: RunningGraph, client: ActionClient, voucher: Voucher, stages: list[str]
) -> Diagnose.Result:
    """Return the diagnosis of the run so far; its stages are appended to `stages`."""
    goal = Diagnose.Goal()
    voucher.vouch(goals_of('diagnosis/diagnose'), goal)
    sent = client.send_goal_async(goal, lambda message: stages.append(message.feedback.stage))
    graph.listener.wait_for('an answer to the goal', sent.done)
    finished = sent.result().get_result_async()
    graph.listener.wait_for('a diagnosis', finished.done, timeout=300.0)
    return finished.result().result


@pytest.mark.timeout(600)
def test_the_withheld_effect_is_named_while_the_twin_goes_on(
    tmp_path: Path, domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    with running_graph(rig_nodes(tmp_path), tmp_path, domain) as graph:
        context = graph.listener.node.context
        mend = rclpy.create_node('mend', namespace=NAMESPACE, context=context)
        graph.listener.spin(mend)
        client, voucher = ActionClient(mend, Diagnose, 'diagnosis/diagnose'), Voucher(mend)
        graph.wait_for_messages('hub/cycle', 1, timeout=120.0)
        monkeypatch.setenv('ROS_DOMAIN_ID', str(domain))
        # the command line calls this function
        with pytest.raises(InputError, match=r'^the run so far: \d maps are too few'):
            diagnose_run_so_far(tmp_path / 'early', no_progress)

        graph.wait_for_messages('hub/cycle', STATES, timeout=180.0)
        stages: list[str] = []
        cycles = len(graph.messages['hub/cycle'])
        result = diagnosed(graph, client, voucher, stages)
        assert result.outcome.code == Outcome.OK, result.outcome.message
        assert result.verdict == 'rate'
        assert result.error_after < 0.6 * result.error_before
        assert Path(result.report).is_file()
        assert Path(result.report).parent.parent == tmp_path / 'diagnoses'
        # a node that starts last may miss the photograph at 0 s
        assert open_recording(Path(result.report).parent / 'run').times[0] in {0.0, 90.0}
        assert len(set(stages)) > 5
        meanwhile = graph.messages['hub/cycle'][cycles:]
        assert len(meanwhile) > 1
        # the hub sees the weak pump too; nothing else disturbs it
        remarks = [remark for report in meanwhile for remark in report.remarks]
        assert all('by the pumps it would be' in remark for remark in remarks)
