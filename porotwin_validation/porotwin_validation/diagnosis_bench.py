"""The diagnosis beside its rival, sparse regression, on the same recordings of the virtual rig."""

import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from porotwin_diagnosis.examine import examine
from porotwin_recording.recording import open_recording
from porotwin_validation.blind_cases import draw_case
from porotwin_validation.blind_study import make_recording
from porotwin_validation.sparse_regression import sparse_regression

CASES = (0, 1, 3, 5, 7, 9)
"""Cases of the blind check: one without an effect, and five with one of the library."""


def run(cases: Sequence[int] = CASES, *, seed: int = 1) -> list[dict[str, object]]:
    """Return one row per case: the truth, what each of the two says, and how long it takes."""
    rows: list[dict[str, object]] = []
    with tempfile.TemporaryDirectory(prefix='porotwin_bench_') as folder:
        for number in cases:
            case = draw_case(number, seed)
            place = Path(folder) / case.name
            make_recording(case, place)
            recording = open_recording(place)
            begin = time.perf_counter()
            verdict = examine([recording], excluded=case.withheld).verdict
            middle = time.perf_counter()
            rival = sparse_regression(recording)
            end = time.perf_counter()
            rows.append(
                {
                    'case': case.name,
                    'truth': ' or '.join(case.right),
                    'diagnosis': verdict.name,
                    'confidence': round(verdict.confidence, 2),
                    'right': verdict.name in case.right,
                    'seconds': round(middle - begin, 1),
                    'pysindy': rival,
                    'pysindy right': rival in case.right,
                    'pysindy seconds': round(end - middle, 1),
                }
            )
    return rows
