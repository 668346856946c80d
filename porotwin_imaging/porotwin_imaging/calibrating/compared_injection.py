"""The photographs of an injection beside its baseline: the first step of a calibration."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.remark import Remark
from porotwin_core.geometry.grid import Grid
from porotwin_core.rig import Rig
from porotwin_imaging.baseline.baseline import Baseline, make_baseline
from porotwin_imaging.baseline.covered_baseline import uncovered
from porotwin_imaging.calibrating.calibration_trust import CalibrationRefused
from porotwin_imaging.numerics.repeated_remarks import lines_of_remarks
from porotwin_imaging.photo_to_map import LogRatioMap, compare_with_baseline


@dataclass(frozen=True)
class ComparedInjection:
    """The usable photographs of an injection, in the order of time.

    Attributes:
        baseline: the baseline, without its covered sand.
        cover: the remark about this sand; None if all is seen.
        compared: the photographs relative to the baseline.
        times: exposure times [s].
        lines: remarks about all photographs.
    """

    baseline: Baseline
    cover: Remark | None
    compared: list[LogRatioMap]
    times: list[float]
    lines: list[str]


def compare_injection(
    rig: Rig,
    grid: Grid,
    baselines: Sequence[bytes],
    states: Iterable[tuple[float, bytes]],
    *,
    samples: Sequence[Callable[[], bytes]],
    baseline_names: Sequence[str],
    progress: Callable[[str], None],
) -> ComparedInjection:
    """Return the photographs of an injection relative to the baseline.

    The arguments have the meaning of `calibration_fit.fit_calibration`.

    Raises:
        CalibrationRefused: no photograph can be used.
        InputError: the rig has no camera, or the baseline cannot be used.
    """
    baseline = make_baseline(rig, grid, baselines, names=baseline_names)
    baseline, cover = uncovered(baseline, samples, baseline_names)
    lines = [*baseline.remarks, *((str(cover),) if cover else ())]
    compared, times = _compare_all(baseline, states, lines, progress)
    return ComparedInjection(baseline, cover, compared, times, lines)


@contextmanager
def refusal_with(lines: Sequence[str]) -> Iterator[None]:
    """Give a refusal in the block the remarks `lines`; they may tell its reason."""
    try:
        yield
    except CalibrationRefused as refusal:
        raise CalibrationRefused(str(refusal), lines) from None


def _compare_all(
    baseline: Baseline,
    states: Iterable[tuple[float, bytes]],
    lines: list[str],
    progress: Callable[[str], None],
) -> tuple[list[LogRatioMap], list[float]]:
    """Return the usable photographs relative to the baseline, in the order of time, and times.

    Remarks are appended to `lines`.

    Raises:
        CalibrationRefused: none is usable.
    """
    compared = []
    left_out = []
    remarks = []
    for time, data in states:
        progress(f'photograph at {time:g} s')
        try:
            found = compare_with_baseline(data, baseline)
        except InputError as error:
            left_out.append(f'at {time:g} s: {error}')
            lines.append(f'photograph at {time:g} s left out: {error}')
            continue
        remarks += [(time, remark) for remark in found.remarks]
        compared.append((time, found))
    lines += lines_of_remarks(remarks, len(compared) + len(left_out))
    if not compared:
        first = f' (the first one, {left_out[0]})' if left_out else ''
        raise CalibrationRefused(
            f'calibration: none of {len(left_out)} photographs of the injection can be used{first}'
            '; copy them from the camera again, or photograph the injection again',
            lines,
        )
    compared.sort(key=lambda one: one[0])
    return [found for _, found in compared], [time for time, _ in compared]
