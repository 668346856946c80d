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
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.remark import Remark
from porotwin_core.geometry.grid import Grid
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import Rig
from porotwin_imaging.baseline.baseline import Baseline
from porotwin_imaging.baseline.covered_baseline import COMPARED
from porotwin_imaging.baseline.sand_edges import sand_edges
from porotwin_imaging.calibrating import sands
from porotwin_imaging.calibrating.calibration_evidence import (
    RATES_FILE,
    CalibrationEvidence,
    evidence_lines,
)
from porotwin_imaging.calibrating.calibration_findings import (
    core_levels,
    dilution_misfit,
    photograph_evidence,
    sand_evidence,
    worst_dilution,
)
from porotwin_imaging.calibrating.calibration_trust import judged
from porotwin_imaging.calibrating.compared_injection import (
    ComparedInjection,
    compare_injection,
    refusal_with,
)
from porotwin_imaging.calibrating.described_sands import (
    described_kinds,
    described_parts,
    sand_names,
)
from porotwin_imaging.calibrating.front_response import (
    FRONTS,
    FrontFit,
    FrontPhotographs,
    PlumeModel,
    fit_fronts,
)
from porotwin_imaging.calibrating.mass_balance_fit import MASS_BALANCE, MassLine, fit_line
from porotwin_imaging.calibrating.plume_evidence import plume_evidence
from porotwin_imaging.calibrating.response_fit import Dilution, ResponseFit, fit_response
from porotwin_imaging.calibrating.sands import SandFactors
from porotwin_imaging.calibrating.signal_choice import SIGNAL, SignalChoice, choose_signal
from porotwin_imaging.calibrating.stock_level import StockLevels, diluted_signals, stock_levels
from porotwin_imaging.calibrating.stock_signal import StockSignal, find_stock_signal
from porotwin_imaging.geometry.sampling import SAMPLING
from porotwin_imaging.numerics.robust_statistics import NOISE_SPREADS, SPREAD_PER_DEVIATION
from porotwin_imaging.photo_to_map import LogRatioMap, compare_with_baseline
from porotwin_imaging.photograph.photo_names import named
from porotwin_imaging.tracer.calibration import Calibration, Labels
from porotwin_imaging.tracer.tracer_signal import Contrast, TracerSignal

Array = NDArray[Any]

_TRACER_SIGMA, _TRACER_MARGIN = 3, (9, 9)
"""Cells with tracer: blur, and margin around them [cells]."""
_PLUME_SHARE = 0.1
"""Parts of the tracer whose smoothed signal stays below this share of the largest one are remaining
light [-]. It reaches 0.04 in rendered photographs."""
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
        remarks: the judgement; it is refused if one of them is.
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
    remarks: tuple[Remark, ...]
    lines: list[str]
    response: ResponseFit
    dilutions: list[Dilution]
    baseline: Baseline
    baseline_photo: bytes
    sands: Labels
    signals: list[Array]
    stock_signal: float
    depths: tuple[Array, ...]


@dataclass(frozen=True)
class InjectionSource:
    """Where an injection was recorded.

    Attributes:
        name: of the experiment, for the file.
        rates_file: name of the file with the injected rates, for messages.
    """

    name: str = ''
    rates_file: str = RATES_FILE


def fit_calibration(
    rig: Rig,
    baselines: Sequence[bytes],
    states: Iterable[tuple[float, bytes]],
    *,
    schedule: Schedule | None = None,
    dilutions: Sequence[DilutionPhoto] = (),
    contrast: Contrast | None = None,
    plumes: Callable[[Sequence[float], int], PlumeModel] | None = None,
    source: InjectionSource = InjectionSource(),
    storage: Callable[[Grid], Array] | None = None,
    progress: Callable[[str], None] = lambda _: None,
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
        source: where the injection was recorded.
        storage: returns the stock of each cell of a grid per unit of concentration [m^3], (nz, nx);
            None: its pores as described.
        progress: called with a line for each photograph.
        baseline_names: names of the files of the baselines, for messages.
        samples: functions that read photographs of the injection; a few of them are called, to find
            a baseline that something covers.

    Raises:
        CalibrationRefused: no photograph can be used, none shows tracer, or the level of stock
            cannot be found. It holds the remarks about the photographs until then.
        InputError: the rig has no camera, or the baseline cannot be used.
    """
    grid = calibration_grid(rig)
    seen = compare_injection(
        rig,
        grid,
        baselines,
        states,
        samples=samples,
        baseline_names=baseline_names,
        progress=progress,
    )
    lines = [*seen.lines]
    injection = _Injection(
        rig, grid, seen, schedule, source.rates_file, storage or rig.cell_pore_volume
    )
    with refusal_with(lines):
        plumes_seen = _photographed_plumes(injection, contrast)
    lines.append(plumes_seen.choice.line)
    diluted = _diluted(injection, plumes_seen, dilutions)
    with refusal_with(lines):
        stock = find_stock_signal(
            plumes_seen.stock,
            plumes_seen.factors,
            diluted,
            plumes_seen.signals,
            injection.integrals(plumes_seen.tracer),
            injection.injected,
            source.rates_file,
        )
    known = [Dilution(signal / stock.level, concentration) for concentration, signal in diluted]
    fitted = _response_fit(injection, plumes_seen, stock, known)
    response, fronts = fitted(None), None
    if plumes and injection.injected and _fronts_tell(plumes_seen.choice.signal, stock):
        progress('model of the plume')
        try:
            fronts = _front_fit(injection, plumes_seen, stock, response, plumes)
        except InputError as error:  # the model cannot run this pump log; the camera can
            lines.append(f'fronts were not compared with the model of the rig: {error}')
        response = fitted(fronts)
    labels, factors = plumes_seen.labels, plumes_seen.factors
    calibration = Calibration(
        plumes_seen.choice.signal,
        response.curve(stock.level),
        np.ascontiguousarray(labels[::-1]) if len(factors.values) > 1 else None,
        factors.values,
        scale_error=stock.scale_error,
        factor_deviations=factors.deviations,
        blur_px=fronts.blur_px if fronts else None,
    )
    systematic = calibration.mass_deviation(plumes_seen.tracer[-1], labels, injection.volume)
    evidence = _evidence(
        injection, plumes_seen, stock, response, fronts, known, dilutions, systematic
    )
    plume = plume_evidence(
        plumes_seen.signals, seen.times, rig, injection.volume, grid=grid, schedule=schedule
    )
    edges = sand_edges(seen.baseline.mask.unlit)
    remarks = judged(evidence, plume, edges, seen.cover)
    lines += [*evidence_lines(evidence), *(str(one) for one in remarks if not one.refused)]
    return CalibrationFit(
        calibration=replace(calibration, made=_origin(source.name, rig, evidence)),
        evidence=evidence,
        remarks=remarks,
        lines=lines,
        response=response,
        dilutions=known,
        baseline=seen.baseline,
        baseline_photo=baselines[0],
        sands=labels,
        signals=plumes_seen.signals,
        stock_signal=stock.level,
        depths=plumes_seen.stock.depths,
    )


@dataclass(frozen=True)
class _Injection:
    """An injection, photographed and logged.

    Attributes:
        rig: the rig with its camera.
        grid: the grid of the calibration.
        seen: the photographs.
        schedule: the pump log, None without one.
        rates_file: its name, for messages.
        storage: see `fit_calibration`.
    """

    rig: Rig
    grid: Grid
    seen: ComparedInjection
    schedule: Schedule | None
    rates_file: str
    storage: Callable[[Grid], Array]

    @cached_property
    def volume(self) -> Array:
        """Stock of the cells per unit of concentration [m^3], (nz, nx)."""
        return self.storage(self.grid)

    @cached_property
    def injected(self) -> list[float]:
        """Volume of stock injected before each photograph [m^3]; empty without a log.

        Raises:
            InputError: the pump log injects nothing before the photographs.
        """
        return _injected(self.schedule, self.seen.times, self.rates_file)

    @cached_property
    def concentrations(self) -> list[float]:
        """Concentration of the core in each photograph [-]."""
        return _core_concentrations(self.schedule, self.seen.times)

    def integrals(self, planes: Sequence[Array]) -> list[float]:
        """Return the integral of each plane over the pore volume of the cells [m^3]."""
        return [float((plane * self.volume).sum()) for plane in planes]

    def mass_line(self, imaged: Sequence[float]) -> MassLine | None:
        """Return the line of `imaged` over injected volumes, None without a log."""
        if not self.injected:
            return None
        return fit_line(imaged, self.injected)


@dataclass(frozen=True)
class _Plumes:
    """The plumes of all photographs, in the scale of the reference sand.

    Attributes:
        choice: the signal.
        labels: index of the sand in each cell, (nz, nx).
        stock: the cores of the plumes.
        factors: the factors of the sands.
        factor_map: the same by cell, (nz, nx).
        signals: signal times factor of each photograph, (nz, nx), NaN where hidden.
        tracer: the same, 0 away from tracer.
    """

    choice: SignalChoice
    labels: Labels
    stock: StockLevels
    factors: SandFactors
    factor_map: Array
    signals: list[Array]
    tracer: list[Array]


def _photographed_plumes(injection: _Injection, contrast: Contrast | None) -> _Plumes:
    """Return the plumes of `injection`; see `fit_calibration` for `contrast`.

    Raises:
        CalibrationRefused: no photograph shows tracer.
        InputError: the pump log injects nothing before the photographs.
    """
    seen = injection.seen
    visible = seen.compared[0].visible
    colours, texture = seen.baseline.sand_appearance()
    looks = sands.segment(colours, texture, visible)
    kinds = described_kinds(injection.rig, injection.grid)
    parts = described_parts(looks, kinds)
    lights = sands.sand_lights(colours, parts.labels, visible)
    choice = choose_signal(
        [one.log_ratio for one in seen.compared],
        [one.visible for one in seen.compared],
        parts.labels,
        contrast,
    )
    raw = [_signal(choice.signal, one) for one in seen.compared]
    stock = stock_levels(raw, parts.labels, injection.concentrations)
    factors = sands.fit_factors(
        raw,
        parts.labels,
        stock.levels,
        stock.strong,
        lights,
        parts.same,
    )
    factor_map = np.array(factors.values)[parts.labels]
    signals = [plane * factor_map for plane in raw]
    tracer = [_only_tracer(plane) for plane in signals]
    return _Plumes(choice, parts.labels, stock, factors, factor_map, signals, tracer)


def _diluted(
    injection: _Injection, plumes: _Plumes, dilutions: Sequence[DilutionPhoto]
) -> list[tuple[float, float]]:
    """Return concentration and signal [-] of each known dilution.

    Raises:
        InputError: a photograph of one cannot be used; its time is named.
    """
    seen = []
    for one in dilutions:
        with named(f'dilution {one.concentration:g} at {one.time:g} s'):
            compared = compare_with_baseline(one.read(), injection.seen.baseline)
        seen.append((one.concentration, _signal(plumes.choice.signal, compared)))
    return diluted_signals(seen, plumes.labels, plumes.factor_map)


def _response_fit(
    injection: _Injection, plumes: _Plumes, stock: StockSignal, known: Sequence[Dilution]
) -> Callable[[FrontFit | None], ResponseFit]:
    """Return the fit of the response as a function of the evidence of fronts."""
    relative, masses = [], []
    if stock.anchor != 'mass':
        held = injection.integrals(plumes.tracer)
        agreeing = _agreeing(held, injection.injected)
        relative = [plumes.tracer[number] / stock.level for number in agreeing]
        masses = [injection.injected[number] for number in agreeing if injection.injected]

    def fitted(fronts: FrontFit | None) -> ResponseFit:
        return fit_response(relative, injection.volume, masses, known, fronts)

    return fitted


def _front_fit(
    injection: _Injection,
    plumes: _Plumes,
    stock: StockSignal,
    rough: ResponseFit,
    models: Callable[[Sequence[float], int], PlumeModel],
) -> FrontFit | None:
    """Return the evidence of fronts beside the modelled injection, None if they tell nothing.

    See `fit_calibration` for `models`. `rough` is the response without this evidence.

    Raises:
        InputError: the model cannot run the pump log.
    """
    baseline = injection.seen.baseline
    line = injection.mass_line(
        injection.integrals([rough.concentration_of(one / stock.level) for one in plumes.tracer])
    )
    assert line is not None  # fronts are compared with a log only
    sure = _surely_scaled(plumes.factors, plumes.labels)
    photographed = FrontPhotographs(
        [plane / stock.level for plane in plumes.signals],
        np.where(sure, injection.volume, 0.0),
        _compared_fronts(line, injection.injected),
        plumes.choice.signal.contrast,
        stock.level,
        baseline.reduction * float(np.mean(baseline.sampling.pixels_per_cell)),
        baseline.sampling.samples_across,
    )
    cells = math.prod(baseline.photo_size) // _PIXELS_OF_A_MODEL_CELL
    return fit_fronts(photographed, models(injection.seen.times, cells), line.factor)


def _evidence(
    injection: _Injection,
    plumes: _Plumes,
    stock: StockSignal,
    response: ResponseFit,
    fronts: FrontFit | None,
    known: Sequence[Dilution],
    dilutions: Sequence[DilutionPhoto],
    systematic: float,
) -> CalibrationEvidence:
    """Return the findings of all steps.

    `systematic` is the relative deviation of the imaged mass by the calibration [-].
    """
    curve = response.curve(stock.level)
    imaged = injection.integrals([curve.concentration_of(plane) for plane in plumes.tracer])
    line = injection.mass_line(imaged)
    cores = core_levels(plumes.stock, plumes.factors, stock.level, injection.concentrations)
    names = sand_names(injection.rig, injection.grid, plumes.labels)
    times = [(one.concentration, one.time) for one in dilutions]
    return CalibrationEvidence(
        anchor=stock.anchor,
        photographs=photograph_evidence(
            injection.seen.times, injection.injected, imaged, cores, line
        ),
        sands=sand_evidence(plumes.stock, plumes.factors, names),
        bend=response.bend,
        bend_deviation=response.deviation,
        colour_bend=plumes.choice.colour_bend,
        mass_factor=line.factor if line else float('nan'),
        mass_factor_deviation=float(np.hypot(line.deviation, systematic * line.factor))
        if line
        else float('nan'),
        mass_offset=line.offset / max(injection.injected) if line else float('nan'),
        mass_misfit=line.misfit if line else float('nan'),
        fronts=fronts,
        dilution_misfit=dilution_misfit(known, response),
        worst_dilution=worst_dilution(known, response, times),
        rates_file=injection.rates_file,
    )


def calibration_grid(rig: Rig) -> Grid:
    """Return a grid of nearly square cells."""
    columns = SAMPLING.judged_columns
    return rig.grid(columns, max(1, round(columns * rig.height_m / rig.width_m)))


def _fronts_tell(signal: TracerSignal, stock: StockSignal) -> bool:
    """Return whether fronts tell the response.

    Their model was proven for absorbance. In the difference of light, fronts of rendered
    photographs read the bend too high by 0.12.
    """
    return stock.is_measured and signal.contrast == 'absorbance'


def _signal(signal: TracerSignal, compared: LogRatioMap) -> Array:
    """Return the signal (nz, nx) of a photograph, NaN where it is hidden."""
    return np.where(compared.visible, signal.of(compared.log_ratio), np.nan)


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


def _agreeing(integrals: Sequence[float], injected: Sequence[float]) -> list[int]:
    """Return the numbers of the photographs whose signals grow with the injection.

    One hand in a photograph would bend the response. With too few of them, or without a pump log,
    all count.
    """
    everyone = list(range(len(integrals)))
    if not injected:
        return everyone
    # in units of the injection, because the errors of the line are relative to it
    scale = max(injected) / max(*integrals, 1e-12)
    line = fit_line([scale * value for value in integrals], injected)
    found = [number for number in everyone if line.agree[number]]
    return found if len(found) >= MASS_BALANCE.fewest_photographs else everyone


def _surely_scaled(factors: SandFactors, labels: Labels) -> Array:
    """Return the cells (nz, nx) in sands with a known factor, away from other sands."""
    sure = np.array(factors.deviations) < FRONTS.surest_factor
    return cv2.erode(sure[labels].astype(np.uint8), _OWN_SAND) > 0


def _compared_fronts(line: MassLine, injected: Sequence[float]) -> list[int]:
    """Return the numbers of photographs whose fronts are compared: agreeing and spread evenly."""
    useful = [
        number
        for number, volume in enumerate(injected)
        if line.agree[number] and volume > FRONTS.least_share * max(injected)
    ]
    places = np.linspace(0, len(useful) - 1, min(len(useful), COMPARED))
    return [useful[place] for place in np.round(places).astype(int)]


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
            'bend': round(evidence.bend, 4),
            'deviation': round(evidence.bend_deviation, 4),
        },
        'sands_from': [one.source for one in evidence.sands],
    }
    if np.isfinite(evidence.mass_factor):
        made['mass_factor'] = round(evidence.mass_factor, 4)
        made['mass_misfit'] = round(evidence.mass_misfit, 4)
    return made


def _only_tracer(signal: Array) -> Array:
    """Return the signal (nz, nx), 0 away from plumes, and continued behind hidden sand.

    The pump log counts the tracer there too. The many cells without tracer would add the
    small error of the light to the mass. Lamps drift, so that this error comes and goes over the
    photographs, and would bend the response.
    """
    hidden = np.isnan(signal).astype(np.uint8)
    known = np.nan_to_num(signal).astype(np.float32)
    filled = cv2.inpaint(known, hidden, _TRACER_SIGMA, cv2.INPAINT_NS)
    smooth = cv2.GaussianBlur(filled, (0, 0), _TRACER_SIGMA)
    spread = SPREAD_PER_DEVIATION * float(np.median(np.abs(smooth - np.median(smooth))))
    tracer = (smooth > NOISE_SPREADS * spread + SIGNAL.least_signal).astype(np.uint8)
    around = cv2.dilate(tracer, np.ones(_TRACER_MARGIN, np.uint8)) > 0
    _, parts = cv2.connectedComponents(around.astype(np.uint8))
    plumes = np.unique(parts[smooth > _PLUME_SHARE * float(smooth.max())])
    return np.where(around & np.isin(parts, plumes), filled, 0.0)
