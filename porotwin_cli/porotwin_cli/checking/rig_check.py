"""Checks a rig or a recording: odd and impossible values, and the cost of a prediction."""

import io
import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from porotwin_checks.all_checks import OF_MAPS, OF_PHOTOGRAPHS, OF_RIG, OF_TABLES
from porotwin_checks.all_checks import remarks_about as remarks_about_known
from porotwin_checks.checks.injected_volume import injected
from porotwin_checks.checks.planned_stock import pumped_plan
from porotwin_checks.known import Known
from porotwin_cli.checking.control_words import control_words
from porotwin_cli.checking.density_words import density_words
from porotwin_cli.checking.plan_words import place_words, plan_words
from porotwin_cli.options.planned_rig import holds_plan, plan_in_words
from porotwin_cli.photographs.seen_photos import SeenPhotos
from porotwin_cli.terminal import gathered_warnings
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.plausibility import PERMEABILITY, WATER_WEIGHT
from porotwin_core.basis.remark import Remark
from porotwin_core.basis.units import DARCY, MINUTE_S, ML, percent, to_ml_h
from porotwin_core.clock.photo_interval import USUAL_PHOTO_INTERVAL_S
from porotwin_core.clock.stamps import SAME_STAMP_S
from porotwin_core.geometry.grid import Grid
from porotwin_core.rates.announced_rates import uncontrolled_rates, with_plan
from porotwin_core.rates.bottle import bottle_at
from porotwin_core.rates.fixed_pauses import FixedPauses
from porotwin_core.rates.water_levels import WaterLevels
from porotwin_core.rates.wells import Schedule, WellRates, quoted, with_rises
from porotwin_core.rig import EffectDescription, Rig, read_rig
from porotwin_core.rig.grid_oddities import remarks_about_grid
from porotwin_core.rig.oddities import remarks_about
from porotwin_core.rig.rig_file import FILE_NAME
from porotwin_diagnosis.data.sample import FEWEST_CELLS, FEWEST_FRAMES
from porotwin_diagnosis.thresholds import OPEN_CONFIDENCE, SCANT_CELLS
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.objectives.objective_registry import make_objective
from porotwin_imaging.baseline.baseline import refuse_corners_outside
from porotwin_imaging.baseline.corner_check import KEY, odd_corners
from porotwin_imaging.geometry.corners_and_lens import Geometry
from porotwin_recording.experiment.bag import read_bag
from porotwin_recording.experiment.experiment_folder import (
    COMMANDED_FILE,
    FILES,
    folder_data,
    is_experiment,
)
from porotwin_recording.mcap.bag_folder import is_bag
from porotwin_recording.tables.photos import Photo
from porotwin_recording.tables.recorded_data import RecordedData
from porotwin_solver.coefficients.water_contact import entering
from porotwin_solver.effects import EFFECTS, described_physics, observation_operator, rig_at
from porotwin_solver.effects.water_level import with_true_levels
from porotwin_solver.flow.background_flux import background_flux
from porotwin_solver.flow.water_table import TableFlow
from porotwin_solver.model.prediction_cost import (
    PredictionCost,
    prediction_cost,
    slowness_of_this_machine,
)
from porotwin_solver.model.water_balance import WaterBalance, water_balance

Kind = Literal['rig', 'experiment folder', 'bag']


class PhotoInterval(NamedTuple):
    """The time from one photograph to the next [s], and its origin in words."""

    seconds: float
    origin: str = ''


NO_PREDICTION = 'unbalanced_rates'
"""Code of a remark about rates with which no model predicts, while photographs can be evaluated.
`check` answers for a prediction, so that it refuses them."""

NO_MAPS = ('no_baseline', 'damaged_baseline')
"""Codes of remarks about photographs without which `image` makes no maps. A recording with maps
needs none of them."""

OTHER_FILE = (
    'check reads a rig.yaml, an experiment folder or an MCAP bag, and this is another file; '
    './porotwin import makes a folder of files of other programs, ./porotwin measure reads maps '
    '(.nc)'
)

EFFECTS_KEY = 'effects'
"""Key of a remark about effects that the model refuses."""


@dataclass(frozen=True)
class CheckedRig:
    """The result of a check.

    path, kind: the checked thing.
    rig: its description.
    grid: the grid for the cost.
    remarks: all remarks, the impossible values first.
    interval: from one photograph to the next.
    cost: of a prediction to the next photograph; None where none can be made.
    data: the recording, if there is one.
    photograph: the pixels (rows, columns, 3) of the first baseline photograph, if there is one.
    planned: the rig that demo and up run by the plan of its pumps, if it has one.
    """

    path: Path
    kind: Kind
    rig: Rig
    grid: Grid
    remarks: tuple[Remark, ...]
    interval: PhotoInterval
    cost: PredictionCost | None
    data: RecordedData | None = None
    photograph: np.ndarray | None = field(default=None, repr=False)
    planned: Rig | None = None

    @property
    def runs(self) -> bool:
        """Whether work with it makes sense."""
        return not any(remark.refused for remark in self.remarks)

    @property
    def effects(self) -> Sequence[EffectDescription]:
        """The effects of the description; none if the model refuses them."""
        refused = any(remark.refused and remark.key == EFFECTS_KEY for remark in self.remarks)
        return () if refused else self.rig.effects


def check(
    path: Path, *, grid: str = '', preset: str = 'fast', interval: float | None = None
) -> CheckedRig:
    """Check a `rig.yaml`, a folder with one, an experiment folder, or a bag.

    Args:
        path: the thing to check.
        grid: columns x rows, such as 187x112; by default square cells of 5 mm.
        preset: preset of the prediction.
        interval: time to predict, from one photograph to the next [s]; None: the usual one of the
            recording, and 30 s without one.

    Raises:
        InputError: it cannot be read at all.
    """
    if path.name == FILE_NAME and holds_plan(path.parent):  # as demo and up read it
        path = path.parent
    rig, found, data, kind = _read(path)
    remarks = list(found)
    if data is not None:
        with gathered_warnings() as unread:
            known = replace(data.known(), rig=_modelled(rig))
            remarks += _judged(remarks_about_known(known, OF_TABLES | OF_MAPS), data)
        remarks += [_told(text, kind) for text in unread]
        remarks += [_told(text, kind) for text in data.remarks]
    cells = Grid.parse(grid, rig.width_m, rig.height_m) if grid else rig.default_grid()
    photograph = None
    if not any(remark.refused for remark in remarks):
        remarks += remarks_about_grid(cells, rig)
    if not any(remark.refused for remark in remarks):
        known = replace(_known(rig, data), chosen_cells=cells)
        remarks += _uses(rig, cells, _known_rates(rig, data).busiest)
        remarks += _judged(remarks_about_known(known, OF_RIG), data)
        if data is not None and data.photos:
            seen = SeenPhotos().of(data.photos)
            remarks += remarks_about_known(replace(known, seen_photos=seen), OF_PHOTOGRAPHS)
            whole = {file.name for file in seen if file.size is not None and not file.is_cut}
            first = next((one for one in data.photos if one.role == 'baseline'), data.photos[0])
            if rig.camera is not None and first.name in whole:
                photograph, of_baseline = _seen_baseline(rig, first)
                remarks += _judged(of_baseline, data)
    planned = None
    if rig.control is not None and data is not None and data.commanded and holds_plan(path):
        try:
            planned = with_plan(rig, data.commanded, COMMANDED_FILE)
        except InputError as error:  # demo and up say so themselves; nobody else runs a plan
            remarks.append(
                replace(_as_remark('demo and up refuse this plan', error), refused=False)
            )
    levelled = _with_true_levels(rig)
    runs = not any(remark.refused for remark in remarks)
    chosen = recorded_interval(data) if interval is None else PhotoInterval(interval)
    cost = _cost(levelled, cells, preset, chosen.seconds) if runs else None
    ordered = tuple(sorted(remarks, key=lambda remark: not remark.refused))
    return CheckedRig(path, kind, rig, cells, ordered, chosen, cost, data, photograph, planned)


def _judged(found: Iterable[Remark], data: RecordedData | None) -> list[Remark]:
    """Return remarks; `image` or a prediction would refuse some of them, and so does `check`."""
    codes = (NO_PREDICTION, *(NO_MAPS if data is not None and data.maps is None else ()))
    return [replace(one, refused=one.refused or one.code in codes) for one in found]


def _modelled(rig: Rig) -> Rig:
    """Return `rig`; without its effects if the model refuses one, which `_uses` tells."""
    try:
        described_physics(rig, rig.default_grid())
    except InputError:
        return rig.model_copy(update={'effects': ()})
    return rig


def _with_true_levels(rig: Rig) -> Rig:
    """Return `rig` with the heads that its effects make; as it is if one of them is refused."""
    try:
        return with_true_levels(rig)
    except InputError:
        return rig


def resting_water(rig: Rig) -> bool:
    """Return whether no water at the sand drives a flow through `rig`, its effects included."""
    return not _with_true_levels(rig).is_driven


def recorded_interval(data: RecordedData | None) -> PhotoInterval:
    """Return the usual time between the photographs of a recording, or between its maps."""
    if data is None:
        return PhotoInterval(USUAL_PHOTO_INTERVAL_S)
    maps = [] if data.maps is None else data.maps.times.tolist()
    states = [photo.time for photo in data.photos if photo.role == 'state']
    for times, origin in ((states, 'photographs'), (maps, 'maps')):
        if len(times) > 1 and (step := float(np.median(np.diff(times)))) > 0.0:
            return PhotoInterval(step, f', as between the recorded {origin},')
    return PhotoInterval(USUAL_PHOTO_INTERVAL_S)


def _read(path: Path) -> tuple[Rig, tuple[Remark, ...], RecordedData | None, Kind]:
    if is_bag(path) and not is_experiment(path):
        data = read_bag(path, None)
        return data.rig, remarks_about(data.rig), data, 'bag'
    try:
        rig, remarks = read_rig(path)
    except InputError:
        if path.is_file() and path.suffix.lower() not in ('.yaml', '.yml'):
            raise InputError(f'{path}: {OTHER_FILE}') from None
        raise
    others = [name for name in FILES if name != 'rig.yaml' and (path / name).is_file()]
    if not path.is_dir() or not others:
        return rig, remarks, None, 'rig'
    try:
        return rig, remarks, folder_data(path, rig), 'experiment folder'
    except InputError as error:
        return rig, (*remarks, _as_remark('recording', error)), None, 'experiment folder'


def _as_remark(key: str, error: InputError) -> Remark:
    """Return the message of a refusal as a remark."""
    why, _, remedy = str(error).rpartition('; ')
    return Remark(key, '', why or remedy, remedy if why else 'correct it', refused=True)


def _told(text: str, kind: Kind) -> Remark:
    """Return the remark for a line of a reader; the remedy of a bag is the log of its run."""
    why, _, remedy = text.partition('; ')
    if kind == 'bag' or not remedy:
        why, remedy = text, 'see the log of the run'
    return Remark('recording', '', why, remedy)


def _uses(rig: Rig, grid: Grid, rates: WellRates) -> Iterator[Remark]:
    """Yield the refusals of those who use the rig: controller, model, imaging.

    They are no checks of their own: each refuses at its start, and here it is asked ahead of it.
    """
    uses: dict[str, Callable[[], object]] = {
        EFFECTS_KEY: lambda: (described_physics(rig, grid), observation_operator(rig.effects))
    }
    if rig.control is not None:
        uses['control'] = lambda: (Limits.of(rig).safe(), make_objective(rig, grid))
    if rig.camera is not None:
        uses['camera'] = lambda: Geometry.of(rig)
    if rig.water_table is not None:
        uses['water'] = lambda: (heads_in_words(rig, grid), water_balance(rig, grid, rates))
    for key, use in uses.items():
        try:
            use()
        except InputError as error:
            yield _as_remark(key, error)
            if key == EFFECTS_KEY:  # the others would complain of them too
                return


def _acting(rig: Rig, data: RecordedData | None) -> Rig:
    """Return `rig` with the effects that begin before the end of the experiment, if one is told."""
    return rig_at(rig, last_time(rig, data) or math.inf)


def _known(rig: Rig, data: RecordedData | None) -> Known:
    return Known(rig=rig, commanded=uncontrolled_rates(rig)) if data is None else data.known()


def _known_rates(rig: Rig, data: RecordedData | None) -> Schedule:
    return (data and data.known_rates) or uncontrolled_rates(rig)


def in_words(checked: CheckedRig) -> list[str]:
    """Return the lines of a check beside its remarks."""
    lines = effects_in_words(checked.effects) + barriers_in_words(checked.rig)
    if checked.cost is not None:
        seconds, origin = checked.interval
        lines.append(f'one prediction over {seconds:g} s{origin} on {checked.grid}: {checked.cost}')
    if checked.rig.wells:
        lines.append(place_words(checked.rig))
    if checked.data is not None and (checked.data.commanded or checked.data.measured):
        pumped = injected(checked.data.known())
        share = pumped.volume / checked.rig.pore_volume
        lines.append(
            f'injected: {pumped.volume * ML:.4g} ml of fluid, {pumped.stock * ML:.4g} ml of stock, '
            f'until {pumped.end:g} s; the fluid is {share:.2g} pore volumes'
        )
        if checked.runs and pumped.stock > 0.0 and resting_water(checked.rig):
            lines.append(density_words(checked.rig, checked.grid, pumped.stock, pumped.end))
    elif checked.data is None:
        lines += fixed_wells_in_words(checked.rig)
    rates = announced_rates(checked)
    if rates.rows and (end := last_time(checked.rig, checked.data)):
        lines.append(plan_words(rates, _into_sand(checked.rig, rates), end))
    if (words := stock_words(checked)) is not None:
        lines.append(words)
    if checked.data is not None and checked.data.maps is not None:
        lines.append(maps_in_words(checked.data.maps.times, checked.data.maps.grid))
    if checked.data is not None and checked.data.readings:
        kinds = Counter(str(one.kind) for one in checked.data.readings)
        lines.append(f'readings: {", ".join(f"{count} {kind}" for kind, count in kinds.items())}')
    if checked.planned is not None:
        lines.append(f'demo and up: {plan_in_words(checked.planned)}')
    lines += control_words(checked.planned or checked.rig)
    if checked.runs and (checked.rig.is_driven or not resting_water(checked.rig)):
        now = _acting(checked.rig, checked.data)
        lines += [heads_in_words(now, checked.grid), *levels_in_words(now, checked.grid)]
    if (balance := balance_of(checked)) is not None:
        when = ' while the wells pump most' * bool(balance.wells)
        lines.append(f'water{when}, {balance}')
    if checked.rig.camera is None:
        lines.append('no camera section: up, image and calibrate need one (docs/rig.md, camera)')
    return lines


def announced_rates(checked: CheckedRig) -> Schedule:
    """Return the recorded rates, or a plan with the announced pauses."""
    rig = checked.planned or checked.rig
    known = None if checked.data is None else checked.data.known_rates
    if known is None:
        return uncontrolled_rates(rig)
    return known if checked.planned is None else FixedPauses.of(rig).in_schedule(known)


def stock_words(checked: CheckedRig) -> str | None:
    """Return how much stock the plan leaves in the bottle; None if its volume is not told."""
    known = _known(checked.rig, checked.data)
    bottle = bottle_at(known.rig, pumped_plan(known), end := known.end)
    if bottle is None:
        return None
    return f'stock: {bottle.left * ML:.4g} ml are left in the bottle at {end:g} s'


def last_time(rig: Rig, data: RecordedData | None) -> float:
    """Return the end of a recording or, without one, of the experiment of `rig` [s]."""
    return _known(rig, data).end


def balance_of(checked: CheckedRig) -> WaterBalance | None:
    """Return the water balance while the wells pump most; None without moving water."""
    if not checked.runs:
        return None
    rig, rates = _acting(checked.rig, checked.data), _known_rates(checked.rig, checked.data)
    if not (rates.busiest or not resting_water(rig)):
        return None
    balance = water_balance(rig, checked.grid, rates.busiest)
    if balance is None:  # an effect that begins later stops a pump that rests by then
        then = rig_at(rig, rates.busiest_time)
        balance = water_balance(then, checked.grid, rates.busiest)
    return balance


def _into_sand(rig: Rig, rates: Schedule) -> Schedule:
    """Return the `rates` that reach the sand by the effects of `rig`."""
    return Known(rig=rig, pumped=rates).rates or rates


def fixed_wells_in_words(rig: Rig) -> list[str]:
    """Return the injection of the fixed wells by `rig.yaml` alone; none without an end."""
    if rig.control is None or rig.control.end_min is None:
        return []
    end = MINUTE_S * rig.control.end_min
    stock = _into_sand(rig, uncontrolled_rates(rig)).injected_stock(0.0, end)
    return [f'injected by the fixed wells: {stock * ML:.4g} ml of stock, until {end:g} s']


def heads_in_words(rig: Rig, grid: Grid) -> str:
    """Return how much water heads and rain drive through the rig without the wells.

    The effects of the rig count.
    """
    physics = described_physics(rig, grid)
    if physics.boundaries.corners_with_a_jump:
        return 'heads: the rate between sides that meet in a corner is not determined'
    flux, pores = background_flux(physics), physics.mobile_water
    if physics.fringe is not None:
        table = TableFlow(physics, np.zeros(grid.shape))
        flux, pores = table.flux, table.surface * pores
    if flux is None:
        return 'heads: with its effects the rig has equal water levels, which drive no water'
    through = np.concatenate([*entering(flux), flux.divergence().ravel()])
    rate = float(through[through > 0.0].sum())
    if rate <= 0.0:
        return 'heads: no water flows through the rig; compare them with the levels of water bodies'
    seconds = float(physics.contact.where_canal(pores, 0.0 * pores).sum()) / rate
    start = ' at the start' if rig.levels else ''
    balance = water_balance(rig, grid, {})
    places = {} if balance is None else balance.places
    sources, drains = ([n for n, one in places.items() if sign * one > 0.0] for sign in (1, -1))
    way = f'from {quoted(sources)} to {quoted(drains)}, ' * bool(sources and drains)
    return (
        f'heads{start}: {to_ml_h(rate):.4g} ml/h flow through the rig without the wells, '
        f'{way}the water of its pores in {seconds / 60.0:.3g} min'
    )


def levels_in_words(rig: Rig, grid: Grid) -> list[str]:
    """Return one line for each level that changes: its range, and the flow at its extremes.

    The other levels belong to the same moment.
    """
    levels, lines = WaterLevels.of(rig), []
    for name, course in levels.courses.items():
        head = rig.water_bodies[name].head_m
        assert head is not None
        times = [time + late for time in course.times for late in (-SAME_STAMP_S, SAME_STAMP_S)]
        rises = {course.at(time): time for time in times}
        told = []
        for rise in (min(rises), max(rises)):
            balance = water_balance(rig, grid, with_rises({}, levels.at(rises[rise])))
            assert balance is not None
            into = balance.in_ml_h['places'].get(name, 0.0)
            told.append(f'{head + rise:g} m ({into:+z.1f} ml/h into the sand)')
        again = (
            f', anew every {course.period / MINUTE_S:g} min' if np.isfinite(course.period) else ''
        )
        lines.append(f'level of {name}: from {" to ".join(told)}{again}, without the wells')
    return lines


def effects_in_words(effects: Sequence[EffectDescription]) -> list[str]:
    """Return one line with the `effects` of a description; empty without any."""
    told = [
        f'{one.name}: {EFFECTS[one.name].in_words(one.parameters)}'
        for one in effects
        if one.name in EFFECTS
    ]
    return [f'the model has these effects: {"; ".join(told)}'] if told else []


def barriers_in_words(rig: Rig) -> list[str]:
    """Return one line about the sands that conduct less than any sand; empty without any.

    Beside other sand they are no mistake if they are clay, so that they are no remarks.
    """
    least = PERMEABILITY.usual[0]
    known = {name: rig.permeability_of_sand(name) for name in rig.sands}
    tight = [f'{name} ({one:.2g} m2)' for name, one in known.items() if one < least]
    told = (
        f'barriers: {", ".join(tight)}; this is right for clay. Sand has at least {least:g} m2: '
        f'for sand correct the unit; 1 darcy is {DARCY:.3g} m2, and 1 cm/s of water is '
        f'{1e-2 / WATER_WEIGHT:.3g} m2'
    )
    return [told] if tight else []


def maps_in_words(times: NDArray[np.float64], grid: Grid) -> str:
    """Return number, times and cells of the maps, and their use for a diagnosis."""
    words = f'maps: {len(times)}, from {times[0]:g} to {times[-1]:g} s, on {grid}'
    if len(times) < FEWEST_FRAMES:
        words += f'; a diagnosis needs {FEWEST_FRAMES} maps'
    elif min(grid.shape) < FEWEST_CELLS:
        words += f'; a diagnosis needs {FEWEST_CELLS} columns and rows'
    elif max(grid.shape) < SCANT_CELLS:
        words += (
            f'; below {SCANT_CELLS} cells along the longer side of the rig a diagnosis states at '
            f'most {percent(OPEN_CONFIDENCE)}'
        )
    return words


def _cost(rig: Rig, grid: Grid, preset: str, interval: float) -> PredictionCost | None:
    if not rig.wells:
        return None
    slowness = slowness_of_this_machine(rig, preset)
    return prediction_cost(rig, grid, preset=preset, duration=interval, slowness=slowness)


def _seen_baseline(rig: Rig, baseline: Photo) -> tuple[NDArray[np.uint8] | None, list[Remark]]:
    """Return the pixels of a `baseline`, None if it is damaged, and the remarks about it.

    They are no checks of their own: imaging decodes it and asks the same about the corners, so that
    whoever makes a baseline is told.
    """
    assert rig.camera is not None
    try:
        with Image.open(io.BytesIO(baseline.read())) as picture:
            pixels = np.asarray(picture.convert('RGB'))
    except (OSError, ValueError, SyntaxError) as damage:
        why = f'it is damaged: {damage}'
        remedy = 'copy it from the camera again'
        return None, [Remark('photographs', baseline.name, why, remedy, code='damaged_baseline')]
    rows, columns = pixels.shape[:2]
    try:
        refuse_corners_outside(rig.camera, (columns, rows))
        off = odd_corners(
            rig, np.ascontiguousarray(pixels[..., ::-1]), (columns, rows), reduction=1
        )
    except InputError as error:
        return pixels, [_as_remark(KEY, error)]
    return pixels, [off] if off else []
