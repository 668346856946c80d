"""The diagnosis finds the missing physics for COSTA."""

from collections.abc import Callable, Sequence

from porotwin_core.basis.blas_threads import one_blas_thread
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.parallel import Crew
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.data.false_cells import without_false_cells
from porotwin_diagnosis.data.fewer_cells import with_fewer_cells
from porotwin_diagnosis.examine import DiagnosisSettings, judge
from porotwin_diagnosis.progress import Progress
from porotwin_recording.experiment.recording import Recording
from porotwin_solver.effects import EFFECTS, described_changes
from porotwin_solver.service.effects_in_force import in_words

MOST_CELLS = 10_000
"""Most cells of a map in the search. The fluxes of COSTA correct finer errors. Whole cells are
averaged, so that a fourth of them remains at least: on 47 x 28 cells a leak was not found."""


@one_blas_thread()
def missing_physics(
    recordings: Sequence[Recording], *, crew: Crew, say: Callable[[str], None], progress: Progress
) -> tuple[EffectDescription, ...]:
    """Return the learnable effects in `recordings` as changes of the rig.

    They are the verdict of the diagnosis, or its nearest explanation where the gap is unexplained.

    Args:
        recordings: at least one recording of one rig.
        crew: runs the simulations.
        say: told the effects, or the reason for none. It hears no confidence: a pump that delivers
            less may look like sorption to a search that must not name it.
        progress: as in `DiagnosisSettings`.
    """
    settings = DiagnosisSettings(
        excluded=[one.name for one in EFFECTS.values() if not one.is_learnable],
        crew=crew,
        progress=progress,
    )
    try:
        judged = judge(
            [
                with_fewer_cells(without_false_cells(one), most_cells=MOST_CELLS)
                for one in recordings
            ],
            settings,
        )
    except InputError as error:
        say(f'no physics is learnt: {error}')
        return ()
    effects = judged.verdict.model.effects
    found = in_words(effects) if effects else 'none'
    say(
        f'physics that COSTA may learn: {found}; ./porotwin diagnose also tries what it may not '
        'learn, such as pumps and the camera'
    )
    rig = recordings[0].rig
    return described_changes(rig, rig.default_grid(), effects)
