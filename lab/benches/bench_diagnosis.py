"""The diagnosis compared with sparse regression on the same recordings of the virtual rig."""

import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from lab.benches.sparse_regression import sparse_regression
from lab.blind.blind_cases import BlindCase, draw_case
from lab.blind.blind_study import make_recording
from porotwin_diagnosis.examine import DiagnosisSettings, examine
from porotwin_recording.experiment.recording import open_recording

CASES = (0, 1, 3, 5, 7, 9)
"""Cases of the blind check: one without an effect, and five with one of the library."""


def run(cases: Sequence[int] = CASES, *, seed: int = 1) -> list[dict[str, object]]:
    """Return one row per case: the truth, both answers, and the time that each takes [s]."""
    with tempfile.TemporaryDirectory(prefix='porotwin_bench_') as folder:
        return [_compare(draw_case(number, seed), Path(folder)) for number in cases]


def _compare(case: BlindCase, folder: Path) -> dict[str, object]:
    make_recording(case, folder / case.name)
    recording = open_recording(folder / case.name)
    begin = time.perf_counter()
    verdict = examine([recording], DiagnosisSettings(excluded=case.withheld)).verdict
    middle = time.perf_counter()
    baseline = sparse_regression(recording)
    end = time.perf_counter()
    return {
        'case': case.name,
        'truth': ' or '.join(case.right),
        'diagnosis': verdict.name,
        'confidence': round(verdict.confidence, 2),
        'right': verdict.name in case.right,
        'seconds': round(middle - begin, 1),
        'pysindy': baseline,
        'pysindy right': baseline in case.right,
        'pysindy seconds': round(end - middle, 1),
    }
