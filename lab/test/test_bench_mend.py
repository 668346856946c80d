"""The bench of mended twins: a short run on a coarse grid, and the summary of its cases."""

from pathlib import Path
from typing import Any

import pytest

from lab.loop.bench_mend import jobs_of, run_mended, summary
from porotwin_cli.running.loop_rig import LoopSettings
from porotwin_cli.running.mended_loop import scenario_of
from porotwin_cli.workspace import small_rig
from porotwin_core.rig import EffectDescription, load_rig

WEAK = EffectDescription(name='rate', parameters={'well': 'injector', 'factor': 0.7})


def test_a_short_run_ends_without_a_diagnosis() -> None:
    scenario = scenario_of(load_rig(small_rig()), (WEAK,), 2400.0, 2640.0, 60.0)
    settings = LoopSettings(cell_m=0.03, rig_cell_m=0.02)
    found = run_mended(scenario, settings)
    assert found.dose_ml_min > 0.0
    assert found.found == []


def test_another_seed_has_other_files(tmp_path: Path) -> None:
    first, second = (jobs_of(tmp_path, scenarios=1, seed=seed) for seed in (1, 2))
    assert len({job.file for job in (*first, *second)}) == len(first) + len(second)


def row(forecast: float, dose: float) -> dict[str, Any]:
    """Return the figures of a case beside a twin that knew (1) and one that was never told (2)."""
    return {
        'forecast, mended': forecast,
        'forecast, knew': 1.0,
        'forecast, described': 2.0,
        'dose, mended': dose,
        'dose, knew': 1.0,
        'dose, never told': 2.0,
    }


@pytest.mark.parametrize(
    ('forecast', 'dose', 'counts'),
    [(1.1, 1.05, [1, 1, 1]), (1.3, 1.3, [0, 0, 1]), (1.1, 2.2, [1, 0, 0]), (2.2, 1.0, [0, 1, 0])],
)
def test_the_summary_counts_the_cases_that_reach_an_aim(
    forecast: float, dose: float, counts: list[int]
) -> None:
    assert list(summary([row(forecast, dose)]).values()) == counts
