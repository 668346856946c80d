"""The twin beside a rig: its arguments checked, its graph run until stopped."""

import signal
import threading
from pathlib import Path

from porotwin_cli.running.page_told import tell_page
from porotwin_cli.terminal import say
from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import Grid
from porotwin_core.rig import Rig
from porotwin_hub.launching.graph import GraphSettings, live_graph
from porotwin_hub.launching.node_processes import POLL_S
from porotwin_hub.launching.processes import GraphProcesses
from porotwin_hub.objectives.objective_registry import make_objective
from porotwin_imaging.tracer.calibration import load_calibration
from porotwin_page.address import listen
from porotwin_solver.model.model import preset_named

OPTIONAL = ('costa', 'trainer', 'diagnosis', 'mend', 'page', 'supervisor')
"""Nodes without which the twin goes on: it predicts, controls and records all the same."""

SHOWN = ('operator', 'supervisor', 'mend')
"""Nodes whose output is for the person at the rig."""

FIRST_PHOTOGRAPH = (
    'the first photograph becomes the baseline: take it before there is tracer, or give roles in '
    'imaging.csv'
)
"""A person has to know this before the first photograph."""


def check_early(settings: GraphSettings, rig: Rig, grid: Grid) -> None:
    """Check the `settings` of `./porotwin up` as its nodes will, before any node starts.

    Raises:
        InputError: a node would refuse an argument.
    """
    preset_named(settings.preset)
    if rig.control is not None:
        make_objective(rig, grid)
    if settings.architecture:
        from porotwin_costa.networks import architecture as architecture_called  # loads torch

        architecture_called(settings.architecture)
    if settings.calibration is not None:
        load_calibration(settings.calibration).check_rig(rig)
    if settings.model is not None:
        from porotwin_costa.correction.corrective_model import CorrectiveModel  # loads torch

        learned = CorrectiveModel.load(settings.model)
        learned = learned.for_physics(rig, grid, settings.preset)
        if learned.doubt:
            say(f'{settings.model}: {learned.doubt}')
    if settings.page:
        listen(settings.page).close()


def run_until_stopped(settings: GraphSettings, folder: Path) -> None:
    """Run the graph until Ctrl-C; logs go into `folder`.

    Raises:
        InputError: a node that the twin needs cannot run.
    """
    stop = threading.Event()
    signal.signal(signal.SIGINT, lambda *_: stop.set())  # the graph uses it for SIGTERM as well
    elsewhere = 'another machine' if settings.nodes else './porotwin replay'
    source = settings.photos or settings.camera or elsewhere
    say(f'twin of {settings.rig}, photographs from {source}')
    if settings.calibration is None:
        say('no --calibration: the concentrations are on a default scale')
    if settings.photos or settings.camera:
        say(FIRST_PHOTOGRAPH)
    tell_page(settings.page, settings.page_token)
    recording = f'recording into {settings.record}, ' if settings.record else ''
    say(f'{recording}logs in {folder / "log"}; stop with Ctrl-C')
    with GraphProcesses(live_graph(settings), folder, say=say, show=SHOWN) as graph:
        while not stop.wait(POLL_S):
            refusal = graph.refusal(OPTIONAL)
            if refusal is not None:
                raise InputError(refusal)
    say('stopped')
