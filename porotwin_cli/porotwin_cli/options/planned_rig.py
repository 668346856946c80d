"""The rig of a live experiment, with the plan of its pumps that lies beside it."""

import logging
from pathlib import Path

from porotwin_checks.all_checks import OF_RIG, remarks_about
from porotwin_checks.checks import announced_pauses
from porotwin_checks.known import Known
from porotwin_cli.terminal import say
from porotwin_core.basis.errors import InputError
from porotwin_core.rates.announced_rates import with_plan
from porotwin_core.rig import Rig, load_rig
from porotwin_recording.experiment.experiment_folder import (
    COMMANDED_FILE,
    IMAGING_FILE,
    MAPS_FILE,
    MEASURED_FILE,
)
from porotwin_recording.tables.rates import read_rates

LOG = logging.getLogger('porotwin')


def planned_rig(path: Path) -> Rig:
    """Return the rig at `path`, a `rig.yaml` or a folder, with the pauses of a rates.csv beside it.

    A rates.csv beside maps, photographs or measured rates is the past of a recording, and no plan.
    One line tells what the plan changes, others what is odd in what will run.

    Raises:
        InputError: a file is wrong, the plan contradicts the control section, or no model predicts
            the rig.
    """
    rig = load_rig(path)
    folder = path if path.is_dir() else path.parent
    file = folder / COMMANDED_FILE
    plan = read_rates(file, rig.wells) if rig.control and holds_plan(folder) else None
    planned = rig if plan is None else with_plan(rig, plan, str(file))
    found = remarks_about(Known(rig=planned), OF_RIG)  # the twin balances what a plan leaves out
    pauses = {'announced_pauses': announced_pauses.CHECK}
    for remark in (*found, *remarks_about(Known(rig=rig, commanded=plan), pauses)):
        if remark.refused:
            raise InputError(f'{path}: {remark}')
        LOG.warning('%s', remark)
    if plan is None:
        return rig
    say(f'{file}: {plan_in_words(planned)}')
    return planned


def holds_plan(folder: Path) -> bool:
    """Return whether the rates.csv in `folder` is a plan, and not the past of a recording."""
    recorded = any((folder / name).exists() for name in (MEASURED_FILE, MAPS_FILE, IMAGING_FILE))
    return (folder / COMMANDED_FILE).is_file() and not recorded


def plan_in_words(rig: Rig) -> str:
    """Return in words when the fixed wells of a plan pump, and who chooses all other rates."""
    assert rig.control is not None
    pauses = {
        name: ', '.join(f'{low:g} to {high:g} min' for low, high in well.pauses_min)
        for name, well in rig.control.fixed.items()
    }
    resting = [f'{name} rests from {told}' for name, told in pauses.items() if told]
    told = '; '.join(resting) or f'{", ".join(rig.control.fixed) or "no well"} pumps throughout'
    return f'{told}; the twin chooses the rates of all other wells'
