"""The calibration of a camera and rig from a baseline and photographs of an injection.

The steps, each with its evidence:

1. The contrast: red, green and blue of the dye keep their ratio from pale to stock in it.
2. The weights of red, green and blue that separate tracer best from noise.
3. The level of tracer stock in each sand: the core of the injected plume is stock.
4. The bend of the response: known dilutions, the mass over the photographs, and their fronts
   beside the fronts of a model of the flow.
5. The mass of the pump log against the imaged one, as a check of all of them.

Without a core the mass gives the level of stock; without a pump log too, the strongest signal does.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.errors import InputError
from porotwin_core.grid import Grid
from porotwin_core.rig import Rig
from porotwin_core.wells import Schedule
from porotwin_imaging import sands
from porotwin_imaging.baseline import Baseline, make_baseline
from porotwin_imaging.calibration import Calibration, Labels
from porotwin_imaging.calibration_evidence import (
    RATES_FILE,
    Anchor,
    CalibrationEvidence,
    PhotographEvidence,
    SandEvidence,
    evidence_lines,
)
from porotwin_imaging.calibration_trust import CalibrationRefused, Trust, judged
from porotwin_imaging.covered_baseline import uncovered
from porotwin_imaging.described_sands import described_kinds, described_parts, sand_names
from porotwin_imaging.front_response import FrontPhotographs, PlumeModel, fit_fronts
from porotwin_imaging.mass_balance_fit import MassLine, fit_line
from porotwin_imaging.photo_to_map import LogRatioMap, compare_with_baseline
from porotwin_imaging.plume_evidence import plume_evidence
from porotwin_imaging.repeated_remarks import lines_of_remarks
from porotwin_imaging.response_fit import Dilution, ResponseFit, fit_response
from porotwin_imaging.robust_statistics import SPREAD_PER_DEVIATION
from porotwin_imaging.sand_edges import sand_edges
from porotwin_imaging.sands import SandFactors
from porotwin_imaging.settings import DEFAULTS, CalibrationSettings, FrontSettings, ImagingSettings
from porotwin_imaging.signal_choice import choose_signal
from porotwin_imaging.stock_level import StockLevels, diluted_signals, stock_levels
from porotwin_imaging.tracer_signal import Contrast, TracerSignal

Array = NDArray[Any]

_TRACER_SPREADS, _TRACER_SIGMA, _TRACER_MARGIN = 4, 3, (9, 9)
"""Cells with tracer: spreads above the background, blur and margin around them [cells]."""
_TOP_SHARE = 0.3
"""Without core and log, stock is a percentile of the signals above this share of the largest."""
_STOCK = 0.999
"""Dilutions above this concentration are stock and show its level [-]."""
_MEASURED = ('dilutions', 'core')
"""Anchors that measure the level of stock; the others take it from the mass."""
_PIXELS_OF_A_MODEL_CELL = 8
"""Pixels of the photograph that a cell of the model covers: fronts finer than this are blurred."""
_OWN_SAND = np.ones((3, 3), np.uint8)
"""Cells with another sand next to them are mixed."""


@dataclass(frozen=True)
class DilutionPhoto:
    """A photograph of a plume, or of the whole rig, with a known concentration.

    Attributes:
        time: exposure time [s].
        read: returns the bytes of the file.
        concentration: concentration of its core [-], 1 = tracer stock.
    """

    time: float
    read: Callable[[], bytes]
    concentration: float


@dataclass(frozen=True)
class CalibrationFit:
    """A calibration and the data that it was fitted to.

    Attributes:
        calibration: the result.
        evidence: findings in the photographs, for the judgement of the calibration.
        trust: the judgement; its objections refuse the calibration.
        lines: a summary for the operator, one line per step.
        response: the fit of the response.
        dilutions: known dilutions with their relative signals.
        baseline: the baseline on the grid of the calibration.
        baseline_photo: the first baseline photograph (bytes of the file).
        sands: index of the sand in each cell, shape (nz, nx).
        signals: signal times sand factor of each photograph, shape (nz, nx).
        stock_signal: signal of tracer stock in the reference sand [-].
        depths: depth inside the plumes of each photograph [cells], shape (nz, nx).
    """

    calibration: Calibration
    evidence: CalibrationEvidence
    trust: Trust
    lines: list[str]
    response: ResponseFit
    dilutions: list[Dilution]
    baseline: Baseline
    baseline_photo: bytes
    sands: Labels
    signals: list[Array]
    stock_signal: float
    depths: tuple[Array, ...]


def fit_calibration(
    rig: Rig,
    baselines: Sequence[bytes],
    states: Iterable[tuple[float, bytes]],
    *,
    schedule: Schedule | None = None,
    dilutions: Sequence[DilutionPhoto] = (),
    contrast: Contrast | None = None,
    plumes: Callable[[Sequence[float], int], PlumeModel] | None = None,
    source: str = '',
    rates_file: str = RATES_FILE,
    progress: Callable[[str], None] = lambda _: None,
    settings: ImagingSettings = DEFAULTS,
    baseline_names: Sequence[str] = (),
    samples: Sequence[Callable[[], bytes]] = (),
) -> CalibrationFit:
    """Return the calibration of a camera and rig.

    `calibration_pictures.write_fit` writes the file and a picture of every step.

    Args:
        rig: the rig with its camera.
        baselines: photographs without tracer (bytes of the files).
        states: exposure time [s] and bytes of the photographs of the injection, in any order. They
            are taken one by one, and none is kept.
        schedule: injected rates in the time of the photographs, None if they are unknown.
        dilutions: photographs of known dilutions.
        contrast: 'absorbance' or 'difference'; None: the one that the colours prefer.
        plumes: returns the modelled injection at times [s] with at most a number of cells; None:
            fronts are not compared.
        source: name of the experiment, for the file.
        rates_file: name of the file with the injected rates, for messages.
        progress: called with a line for each photograph.
        settings: settings of all steps.
        baseline_names: names of the files of the baselines, for messages.
        samples: functions that read photographs of the injection; a few of them are called, to find
            a baseline that something covers.

    Raises:
        CalibrationRefused: no photograph can be used, none shows tracer, or the level of stock
            cannot be found. It holds the remarks about the photographs until then.
        InputError: the rig has no camera, or the baseline cannot be used.
    """
    grid = calibration_grid(rig, settings.calibration)
    baseline = make_baseline(rig, grid, baselines, settings=settings, names=baseline_names)
    baseline, cover = uncovered(baseline, samples, baseline_names)
    lines = [*baseline.remarks, *((str(cover),) if cover else ())]
    compared, times = _compare_all(baseline, states, lines, progress)
    colours, texture = baseline.sand_appearance()
    looks = sands.segment(colours, texture, compared[0].visible, settings.sands)
    parts = described_parts(looks, described_kinds(rig, grid, settings.sands), settings.sands)
    labels = parts.labels
    lights = sands.sand_lights(colours, labels, compared[0].visible)
    with _refusal_with(lines):
        choice = choose_signal(
            [one.log_ratio for one in compared],
            [one.visible for one in compared],
            labels,
            contrast,
            settings.calibration,
        )
    lines.append(choice.line)
    raw = [_signal(choice.signal, one) for one in compared]
    injected = _injected(schedule, times, rates_file)
    concentrations = _core_concentrations(schedule, times)
    stock = stock_levels(raw, labels, concentrations, settings.core)
    factors = sands.fit_factors(
        raw, labels, stock.levels, stock.strong, lights, parts.same, settings.sands
    )
    factor_map = np.array(factors.values)[labels]
    signals = [plane * factor_map for plane in raw]
    volume = rig.cell_pore_volume(grid)
    tracer = [_only_tracer(plane, settings.calibration) for plane in signals]
    diluted = [
        (one.concentration, _signal(choice.signal, compare_with_baseline(one.read(), baseline)))
        for one in dilutions
    ]
    seen = diluted_signals(diluted, labels, factor_map, settings.core)
    with _refusal_with(lines):
        anchor, level, scale_error = _level_of_stock(
            stock,
            factors,
            seen,
            signals,
            _integrals(tracer, volume),
            injected,
            settings,
            rates_file,
        )
    known = [Dilution(signal / level, concentration) for concentration, signal in seen]
    agreeing = _agreeing(_integrals(tracer, volume), injected, settings)
    relative = [tracer[number] / level for number in agreeing] if anchor != 'mass' else []
    masses = [injected[number] for number in agreeing] if injected and anchor != 'mass' else []
    response = fit_response(relative, volume, masses, known, settings=settings.mass_balance)
    fronts = None
    if plumes and _fronts_tell(choice.signal, anchor) and len(injected):
        progress('model of the plume')
        held = _integrals([response.concentration_of(one / level) for one in tracer], volume)
        rough = fit_line(held, injected, settings.mass_balance)
        photographed = FrontPhotographs(
            [plane / level for plane in signals],
            np.where(_surely_scaled(factors, labels, settings.fronts), volume, 0.0),
            _compared_fronts(rough, injected, settings.fronts),
            choice.signal.contrast,
            level,
            baseline.reduction * float(np.mean(baseline.sampling.pixels_per_cell)),
            baseline.sampling.samples_across,
        )
        cells = math.prod(baseline.photo_size) // _PIXELS_OF_A_MODEL_CELL
        try:
            fronts = fit_fronts(photographed, plumes(times, cells), rough.factor, settings.fronts)
        except InputError as error:  # the model cannot run this pump log; the camera can
            lines.append(f'fronts were not compared with the model of the rig: {error}')
        response = fit_response(relative, volume, masses, known, fronts, settings.mass_balance)
    curve = response.curve(level)
    imaged = _integrals([curve.concentration_of(plane) for plane in tracer], volume)
    line = fit_line(imaged, injected, settings.mass_balance) if len(injected) else None
    cores = _core_levels(stock, factors, level, concentrations)
    evidence = CalibrationEvidence(
        anchor=anchor,
        photographs=_photographs(times, injected, imaged, cores, line, settings),
        sands=_sand_evidence(stock, factors, sand_names(rig, grid, labels)),
        family=response.family,
        bend=response.bend,
        bend_deviation=response.deviation,
        colour_bend=choice.colour_bend,
        core_flatness=_flatness(stock, factors.reference),
        mass_factor=line.factor if line else float('nan'),
        mass_factor_deviation=line.deviation if line else float('nan'),
        mass_offset=line.offset / max(injected) if line else float('nan'),
        mass_misfit=line.misfit if line else float('nan'),
        fronts=fronts,
        dilution_misfit=_dilution_misfit(known, response),
        worst_dilution=_worst_dilution(known, response, dilutions),
        rates_file=rates_file,
    )
    plume = plume_evidence(signals, times, rig=rig, grid=grid, schedule=schedule)
    edges = sand_edges(baseline.mask.unlit)
    trust = judged(evidence, plume, edges, settings.trust, cover)
    lines += [*evidence_lines(evidence), *trust.remarks]
    calibration = Calibration(
        choice.signal,
        curve,
        np.ascontiguousarray(labels[::-1]) if len(factors.values) > 1 else None,
        factors.values,
        made=_origin(source, rig, evidence),
        scale_error=scale_error,
        factor_deviations=factors.deviations,
        blur_px=fronts.blur_px if fronts else None,
    )
    return CalibrationFit(
        calibration=calibration,
        evidence=evidence,
        trust=trust,
        lines=lines,
        response=response,
        dilutions=known,
        baseline=baseline,
        baseline_photo=baselines[0],
        sands=labels,
        signals=signals,
        stock_signal=level,
        depths=stock.depths,
    )


def calibration_grid(rig: Rig, settings: CalibrationSettings) -> Grid:
    """Return a grid of nearly square cells."""
    columns = settings.columns
    return rig.grid(columns, max(1, round(columns * rig.height_m / rig.width_m)))


def _fronts_tell(signal: TracerSignal, anchor: Anchor) -> bool:
    """Return whether fronts tell the response.

    Their model was proven for absorbance. In the difference of light, fronts of rendered
    photographs read the bend too high by 0.12.
    """
    return anchor in _MEASURED and signal.contrast == 'absorbance'


def _signal(signal: TracerSignal, compared: LogRatioMap) -> Array:
    """Return the signal (nz, nx) of a photograph, NaN where it is hidden."""
    return np.where(compared.visible, signal.of(compared.log_ratio), np.nan)


def _integrals(planes: Sequence[Array], volume: Array) -> list[float]:
    """Return the integral of each plane over the pore volume of the cells [m^3]."""
    return [float((plane * volume).sum()) for plane in planes]


def _injected(schedule: Schedule | None, times: Sequence[float], rates_file: str) -> list[float]:
    """Return the volume of stock injected before each photograph [m^3]; empty without a log.

    Raises:
        InputError: the pump log injects nothing before the photographs.
    """
    if schedule is None or not schedule.rows:
        return []
    start = min(row.time for row in schedule.rows)
    volumes = [schedule.injected_stock(min(start, time), time) for time in times]
    if max(volumes) <= 0:
        raise InputError(
            f'calibration: the pump log injects no tracer until the last photograph ({times[-1]:g} '
            f's); check {rates_file} and the times in imaging.csv'
        )
    return volumes


def _core_concentrations(schedule: Schedule | None, times: Sequence[float]) -> list[float]:
    """Return the concentration of the core in each photograph: the highest injected until then."""
    if schedule is None:
        return [1.0] * len(times)
    injections = [row for row in schedule.rows if row.rate.rate > 0 and row.rate.concentration > 0]
    return [
        max((row.rate.concentration for row in injections if row.time < time), default=1.0)
        for time in times
    ]


def _level_of_stock(
    stock: StockLevels,
    factors: SandFactors,
    diluted: Sequence[tuple[float, float]],
    signals: Sequence[Array],
    integrals: Sequence[float],
    injected: Sequence[float],
    settings: ImagingSettings,
    rates_file: str,
) -> tuple[Anchor, float, float]:
    """Return the anchor, the signal of stock in the reference sand, and its relative deviation.

    Raises:
        InputError: there is neither a core nor a dilution, and the signal does not grow with the
            injected mass.
    """
    full = [signal for concentration, signal in diluted if concentration > _STOCK]
    if full:
        return 'dilutions', float(np.median(full)), settings.core.level_error
    if stock.levels:
        one = stock.levels[factors.reference]
        return 'core', one.level, one.deviation
    if diluted:
        concentration, signal = max(diluted)
        return 'dilutions', signal / concentration, settings.calibration.scale_error
    if injected:
        return 'mass', *_level_by_mass(integrals, injected, settings, rates_file)
    strong = np.concatenate([s[s > _TOP_SHARE * np.nanmax(s)] for s in signals])
    top = float(np.nanpercentile(strong, settings.calibration.stock_percentile))
    return 'strongest signal', top, settings.calibration.scale_error_without_log


def _level_by_mass(
    integrals: Sequence[float],
    injected: Sequence[float],
    settings: ImagingSettings,
    rates_file: str,
) -> tuple[float, float]:
    """Return the signal of stock that balances the injected mass, and its relative deviation.

    Raises:
        InputError: there are too few photographs, or the signal does not grow.
    """
    fewest = settings.mass_balance.fewest_photographs
    if len(injected) < fewest:
        raise CalibrationRefused(
            f'calibration: {len(injected)} photographs during the injection; take at least {fewest}'
        )
    line = fit_line(integrals, injected, settings.mass_balance)
    if line.factor <= 0 or line.agree.sum() < fewest:
        raise CalibrationRefused(
            'calibration: the signal does not grow with the injected volume; check '
            f'{rates_file}, the times of the photographs and the baseline'
        )
    return line.factor, max(settings.calibration.scale_error, line.misfit / line.factor)


def _agreeing(
    integrals: Sequence[float], injected: Sequence[float], settings: ImagingSettings
) -> list[int]:
    """Return the numbers of the photographs whose signals grow with the injection.

    One hand in a photograph would bend the response. With too few of them, or without a pump log,
    all count.
    """
    everyone = list(range(len(integrals)))
    if not injected:
        return everyone
    # in units of the injection, because the errors of the line are relative to it
    scale = max(injected) / max(*integrals, 1e-12)
    line = fit_line([scale * value for value in integrals], injected, settings.mass_balance)
    found = [number for number in everyone if line.agree[number]]
    return found if len(found) >= settings.mass_balance.fewest_photographs else everyone


def _surely_scaled(factors: SandFactors, labels: Labels, settings: FrontSettings) -> Array:
    """Return the cells (nz, nx) in sands with a known factor, away from other sands."""
    sure = np.array(factors.deviations) < settings.surest_factor
    return cv2.erode(sure[labels].astype(np.uint8), _OWN_SAND) > 0


def _compared_fronts(
    line: MassLine, injected: Sequence[float], settings: FrontSettings
) -> list[int]:
    """Return the numbers of photographs whose fronts are compared: agreeing and spread evenly."""
    useful = [
        number
        for number, volume in enumerate(injected)
        if line.agree[number] and volume > settings.least_share * max(injected)
    ]
    places = np.linspace(0, len(useful) - 1, min(len(useful), settings.most_photographs))
    return [useful[place] for place in np.round(places).astype(int)]


def _photographs(
    times: Sequence[float],
    injected: Sequence[float],
    imaged: Sequence[float],
    cores: Sequence[tuple[float, int]],
    line: MassLine | None,
    settings: ImagingSettings,
) -> tuple[PhotographEvidence, ...]:
    """Return the evidence of each photograph.

    `cores`: concentration relative to the injected one, NaN without a core, and cells.
    """
    found = []
    for index, (level, cells) in enumerate(cores):
        reasons = []
        if abs(level - 1.0) > settings.core.outlier:
            reasons.append(f'its core is {level:.2f} times the others')
        if line is not None and not line.agree[index]:
            reasons.append(
                f'its mass is {100 * line.distances[index]:+.0f} % of the injection off the line'
            )
        log = injected[index] if injected else float('nan')
        found.append(
            PhotographEvidence(
                times[index], log, imaged[index], level, cells, ' and '.join(reasons)
            )
        )
    return tuple(found)


def _core_levels(
    stock: StockLevels, factors: SandFactors, level: float, concentrations: Sequence[float]
) -> list[tuple[float, int]]:
    """Return the level of the reference core of each photograph, 1 if as usual, and its cells."""
    found = []
    for cores, concentration in zip(stock.cores, concentrations, strict=True):
        core = cores.get(factors.reference)
        cells = sum(int(one.cells.sum()) for one in cores.values())
        share = float('nan') if core is None else core.level / (level * concentration)
        found.append((share, cells))
    return found


def _flatness(stock: StockLevels, reference: int) -> float:
    """Return the median flatness of the reference cores; NaN without one."""
    values = [cores[reference].flatness for cores in stock.cores if reference in cores]
    return float(np.median(values)) if values else float('nan')


def _sand_evidence(
    stock: StockLevels, factors: SandFactors, names: Sequence[str]
) -> tuple[SandEvidence, ...]:
    """Return how the factor of each sand was found; `names` are those of rig.yaml, by sand."""
    return tuple(
        SandEvidence(
            value,
            deviation,
            source,
            stock.levels[sand].cells if sand in stock.levels else 0,
            pairs,
            at_bound,
            names[sand],
        )
        for sand, (value, deviation, source, pairs, at_bound) in enumerate(
            zip(
                factors.values,
                factors.deviations,
                factors.sources,
                factors.pairs,
                factors.at_bound,
                strict=True,
            )
        )
    )


def _dilution_misfit(known: Sequence[Dilution], response: ResponseFit) -> float:
    """Return the largest distance of known dilutions from the curve; NaN without dilutions."""
    if not known:
        return float('nan')
    seen = response.concentration_of(np.array([one.signal for one in known]))
    return float(np.abs(seen - [one.concentration for one in known]).max())


def _worst_dilution(
    known: Sequence[Dilution], response: ResponseFit, photographs: Sequence[DilutionPhoto]
) -> str:
    """Return the dilution farthest from the curve in words, with the times of its photographs."""
    if not known:
        return ''
    seen = response.concentration_of(np.array([one.signal for one in known]))
    worst = int(np.abs(seen - [one.concentration for one in known]).argmax())
    value = known[worst].concentration
    times = ', '.join(f'{one.time:g} s' for one in photographs if one.concentration == value)
    return f'{value:g} at {times} is read as {seen[worst]:.2f}'


def _origin(source: str, rig: Rig, evidence: CalibrationEvidence) -> dict[str, Any]:
    """Return the entry `made` of the calibration file."""
    made: dict[str, Any] = {
        'by': 'porotwin calibrate',
        'from': source,
        'rig': {'name': rig.name, 'width_m': rig.width_m, 'height_m': rig.height_m},
        'photographs': len(evidence.photographs),
        'disagreeing': [one.time for one in evidence.disagreeing],
        'anchor': evidence.anchor,
        'response': {
            'family': evidence.family,
            'bend': round(evidence.bend, 4),
            'deviation': round(evidence.bend_deviation, 4),
        },
        'sands_from': [one.source for one in evidence.sands],
    }
    if np.isfinite(evidence.mass_factor):
        made['mass_factor'] = round(evidence.mass_factor, 4)
        made['mass_misfit'] = round(evidence.mass_misfit, 4)
    return made


@contextmanager
def _refusal_with(lines: Sequence[str]) -> Iterator[None]:
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


def _only_tracer(signal: Array, settings: CalibrationSettings) -> Array:
    """Return the signal (nz, nx), 0 away from tracer and where nothing is visible.

    The many cells without tracer would add the small error of the light to the mass.
    """
    filled = np.nan_to_num(signal).astype(np.float32)
    smooth = cv2.GaussianBlur(filled, (0, 0), _TRACER_SIGMA)
    spread = SPREAD_PER_DEVIATION * float(np.median(np.abs(smooth - np.median(smooth))))
    tracer = (smooth > _TRACER_SPREADS * spread + settings.least_signal).astype(np.uint8)
    return np.where(cv2.dilate(tracer, np.ones(_TRACER_MARGIN, np.uint8)) > 0, filled, 0.0)
