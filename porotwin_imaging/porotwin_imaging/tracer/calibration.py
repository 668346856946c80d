"""The calibration record and its file: the conversion of signal to concentration.

    schema: 2
    made: {from: experiment folder, photographs: 12, anchor: core, ...}
    signal: {contrast: absorbance, weights: [1.0, 0.0, 0.0]}
    scale_error: 0.02
    response: {signal: [0.0, 0.6, 1.9], concentration: [0.0, 0.35, 1.0], deviation: [0, 0.02, 0]}
    sands: {file: sands.png, factors: [1.0, 1.52], deviations: [0.01, 0.3]}
    hidden: {file: hidden.png}
    blur_px: 1.3

`made` describes the origin of the calibration, with the name and size of its rig. `scale_error` is
the relative standard deviation of the scale. `response` is a monotone, piecewise linear curve;
`deviation` is the standard deviation of its concentrations for a known scale. `sands` names a
picture of the whole rig with one grey level per sand (0, 1, 2, ...), row 0 at the top; the signal
of each sand is multiplied by its factor before the response. `deviations` are the relative standard
deviations of the factors. `hidden` names a picture that is white where photographs do not show
sand. Both pictures can be corrected by hand with any paint program. `blur_px` is the standard
deviation of the blur of tracer in a photograph, in pixels of the file; without it the default of
`front_sharpening.py` holds. Files of schema 1 have no deviations; they are read with zeros there.
"""

import hashlib
import shutil
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, get_args

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.regular_file import read_regular
from porotwin_core.basis.remark import QUOTED, Remark
from porotwin_core.geometry.grid import Grid
from porotwin_core.rig import Rig
from porotwin_core.rig.yaml_reader import yaml_text
from porotwin_imaging.photograph.photo_file import photo_size
from porotwin_imaging.tracer.calibration_keys import read_content
from porotwin_imaging.tracer.tracer_signal import Contrast, TracerSignal

Array = NDArray[Any]
Labels = NDArray[np.uint8]

SCHEMA = 2
"""Version of the file format that is written."""
CLEAN = 0.01
"""Sand with a lower concentration counts as clean [-]."""
STOCK = 0.999
"""Fluids and dilutions from this concentration on are tracer stock [-]."""
DEFAULT_FULL_SIGNAL = 0.8
"""Signal of tracer stock without a calibration: the share of red light that the green tracer of the
large FluidFlower absorbs, 0.87 in coarse sand and 0.71 in fine sand."""
UNCALIBRATED_ERROR = 0.2
"""Relative standard deviation of a scale that was not measured."""
RELATIVE = 'relative'
"""The `scale` in `made`, if the core of the plume counts as 1."""
_CHANNELS = ('red', 'green', 'blue')
CONCENTRATION_RANGE = (-0.5, 3.0)
"""Concentrations of a response [-]: 1 is tracer stock, and curves reach a little beyond it."""
_LEAST_TOP = 0.1
"""Least concentration at the end of a response [-]; a calibration reaches stock."""
_MOST = 100.0
"""Largest signal, weight, factor and deviation of a file [-], inverse of its smallest factor, and
largest blur [px]; real ones are below 5."""
_SAME_SIZE = 0.01
"""Relative difference of width or height up to which a rig fits a calibration [-]: a rig
is measured to some millimetres, and another rig differs by much more."""
_HIDDEN_LEVEL = 128
"""Lighter grey levels of the picture `hidden` are white."""


@dataclass(frozen=True)
class Response:
    """A monotone, piecewise linear curve from signal to concentration.

    Attributes:
        signal: increasing signals of its points [-], (n,).
        concentration: their concentrations [-], (n,), not decreasing, 1 = tracer stock.
        deviation: standard deviations of `concentration` for a known scale [-], (n,), or ().

    Raises:
        InputError: there are fewer than 2 points, or the curve does not increase.
    """

    signal: tuple[float, ...] = (0.0, DEFAULT_FULL_SIGNAL)
    concentration: tuple[float, ...] = (0.0, 1.0)
    deviation: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        signal, concentration = np.array(self.signal), np.array(self.concentration)
        if len(signal) != len(concentration) or len(signal) < 2:
            raise InputError(
                'calibration: response needs as many signals as concentrations, at least 2'
            )
        if (np.diff(signal) <= 0).any() or (np.diff(concentration) < 0).any():
            raise InputError('calibration: response must increase; calibrate again')
        if self.deviation and len(self.deviation) != len(signal):
            raise InputError('calibration: response needs one deviation for each of its signals')

    def concentration_of(self, signal: Array) -> Array:
        """Return the concentration of `signal`, of the same shape; linear beyond both ends."""
        x, y = np.array(self.signal), np.array(self.concentration)
        inside = np.interp(signal, x, y)
        first, last = (y[1] - y[0]) / (x[1] - x[0]), (y[-1] - y[-2]) / (x[-1] - x[-2])
        below, above = np.minimum(signal - x[0], 0.0), np.maximum(signal - x[-1], 0.0)
        return inside + first * below + last * above

    def slope_at(self, signal: Array) -> Array:
        """Return d concentration / d signal at `signal`, of the same shape."""
        x, y = np.array(self.signal), np.array(self.concentration)
        slopes = np.diff(y) / np.diff(x)
        piece = np.clip(np.searchsorted(x, signal, side='right') - 1, 0, len(slopes) - 1)
        return slopes[piece]

    def deviation_of(self, signal: Array) -> Array:
        """Return the standard deviation of the curve at `signal`, of the same shape."""
        if not self.deviation:
            return np.zeros_like(signal, float)
        return np.interp(signal, self.signal, self.deviation)


@dataclass(frozen=True)
class Calibration:
    """Signal, sands and response of a camera and rig; the module describes the file.

    Attributes:
        signal: definition of the tracer signal.
        response: curve from scaled signal to concentration.
        sands: index of the sand, uint8, shape (rows, columns), row 0 at the top; None for one sand.
        factors: factor on the signal of each sand.
        hidden: picture that is white where no sand is visible, same orientation, or None.
        made: origin of the calibration, for the reader of the file; `rig` is checked.
        scale_error: relative standard deviation of the scale [-].
        factor_deviations: relative standard deviation of each factor [-]; () if they are not known.
        blur_px: standard deviation of the blur of tracer in a photograph [px of the file]; None if
            it was not measured.
    """

    signal: TracerSignal = field(default_factory=TracerSignal)
    response: Response = field(default_factory=Response)
    sands: Labels | None = None
    factors: tuple[float, ...] = (1.0,)
    hidden: Labels | None = None
    made: dict[str, Any] = field(default_factory=dict)
    scale_error: float = UNCALIBRATED_ERROR
    factor_deviations: tuple[float, ...] = ()
    blur_px: float | None = None

    @property
    def is_relative(self) -> bool:
        """Whether the core of the plume counts as 1 and nothing tells its concentration."""
        return self.made.get('scale') == RELATIVE

    @property
    def picture_fingerprint(self) -> str:
        """A short hash of the pictures `sands` and `hidden`, which its file only names."""
        whole = hashlib.sha256()
        for picture in (self.sands, self.hidden):
            shape = None if picture is None else picture.shape
            whole.update(repr(shape).encode())
            whole.update(b'' if picture is None else np.ascontiguousarray(picture).tobytes())
        return whole.hexdigest()[:16]

    def check_rig(self, rig: Rig) -> None:
        """Check that the calibration was made on a rig of the size of `rig`, if it tells its rig.

        Raises:
            InputError: it was made on a rig of another width or height.
        """
        made_on = self.made.get('rig')
        if made_on is None:
            return
        ratios = rig.width_m / made_on['width_m'], rig.height_m / made_on['height_m']
        if all(abs(ratio - 1.0) <= _SAME_SIZE for ratio in ratios):
            return
        raise InputError(
            f"calibration was made on the rig '{made_on['name']}' of {made_on['width_m']:g} m x "
            f"{made_on['height_m']:g} m, but the rig '{rig.name}' has {rig.width_m:g} m x "
            f'{rig.height_m:g} m; use a calibration of this rig, or correct its size in rig.yaml'
        )

    def doubt_about(self, rig: Rig) -> Remark | None:
        """Return a remark if nothing shows that the calibration is of `rig`; None if its name does.

        `check_rig` refuses another size before.
        """
        made_on = self.made.get('rig')
        if made_on is None:
            origin = f' (of {self.made["from"]})' if 'from' in self.made else ''
            return Remark.of(
                'calibration',
                'unknown_rig',
                "it{origin} does not tell its rig, so it cannot be checked for '{rig}'; renew it "
                'with ./porotwin calibrate, which writes the rig into it',
                origin=origin,
                rig=rig.name,
            )
        if made_on['name'] != rig.name:
            return Remark.of(
                'calibration',
                'other_rig',
                "it was made on the rig '{made_on}', which is as large as '{rig}'; calibrate this "
                'one, unless both are the same rig',
                made_on=made_on['name'],
                rig=rig.name,
            )
        return None

    def factor_map(self, grid: Grid) -> Array:
        """Return the factor of each cell, shape (nz, nx): the mean over the sands in it."""
        return self._map_of(self.factors, grid)

    def factor_deviation_map(self, grid: Grid) -> Array:
        """Return the relative standard deviation of the factor of each cell, shape (nz, nx)."""
        return self._map_of(self.factor_deviations or (0.0,) * len(self.factors), grid)

    def systematic_deviation(self, signal: Array, factor_deviation: Array) -> Array:
        """Return the standard deviation [-] of concentrations that the calibration causes.

        It is the same in all photographs. Three independent parts are added in squares: the scale,
        the shape of the response, and the factor of the sand.

        Args:
            signal: signal times factor of the sand [-], any shape.
            factor_deviation: relative standard deviation of the factor, the same shape; for a map
                it is `factor_deviation_map`.
        """
        concentration = self.response.concentration_of(signal)
        factor_part = self.response.slope_at(signal) * signal * factor_deviation
        shape_part = self.response.deviation_of(signal)
        scale_part = self.scale_error * concentration
        return np.sqrt(scale_part**2 + shape_part**2 + factor_part**2)

    def mass_deviation(self, signal: Array, sands: Labels, volume: Array) -> float:
        """Return the relative standard deviation of the tracer in a map that the calibration makes.

        The parts are those of `systematic_deviation`. Scale and shape are one error everywhere, and
        the factor is one in each sand, so that they do not average out over the cells.

        Args:
            signal: signal times factor of the sand [-], (nz, nx), 0 away from tracer.
            sands: index of the sand in each cell, (nz, nx).
            volume: pore volume of the cells [m^3], (nz, nx).
        """
        held = float(np.sum(self.response.concentration_of(signal) * volume))
        if held <= 0.0:
            return 0.0
        shape = float(np.sum(self.response.deviation_of(signal) * volume))
        change = self.response.slope_at(signal) * signal * volume
        parts = [
            deviation * float(change[sands == number].sum())
            for number, deviation in enumerate(self.factor_deviations)
        ]
        return float(np.hypot(self.scale_error, np.linalg.norm([shape, *parts]) / held))

    def _map_of(self, values: tuple[float, ...], grid: Grid) -> Array:
        """Return one value per sand as a map (nz, nx): the mean over the sands in each cell."""
        if self.sands is None:
            return np.full(grid.shape, values[0])
        picture = np.array(values)[np.minimum(self.sands, len(values) - 1)]
        size = (grid.nx, grid.nz)
        return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA))[::-1]

    def shown(self, shape: tuple[int, int]) -> NDArray[np.bool_]:
        """Return where the picture `hidden` does not hide the sand, at `shape` (rows, columns)."""
        if self.hidden is None:
            return np.ones(shape, bool)
        hidden = cv2.resize(self.hidden, shape[::-1], interpolation=cv2.INTER_NEAREST)
        return np.asarray(hidden < _HIDDEN_LEVEL)


def load_calibration(path: Path | str) -> Calibration:
    """Return the calibration in the file `path`.

    Raises:
        InputError: the file is missing or wrong; one line names the file, the key and the remedy.
    """
    path = Path(path)
    data = read_content(path)
    try:
        sands, hidden = data.get('sands', {}), data.get('hidden', {})
        blur = data.get('blur_px')
        calibration = Calibration(
            _signal(data['signal']),
            _response(data['response']),
            _picture(path, 'sands.file', sands.get('file')),
            _numbers('sands.factors', sands.get('factors', [1.0]), 1.0 / _MOST, _MOST),
            _picture(path, 'hidden.file', hidden.get('file')),
            data.get('made', {}),
            _number('scale_error', data['scale_error'], 0.0, _MOST),
            _numbers('sands.deviations', sands.get('deviations', ()), 0.0, _MOST),
            None if blur is None else _number('blur_px', blur, 0.0, _MOST),
        )
        _check_sands(calibration)
    except InputError as error:
        raise InputError(f'{path}: {error}') from None
    return calibration


def copy_calibration(path: Path, folder: Path) -> None:
    """Copy the file of a calibration, and its pictures, into the new `folder`.

    Raises:
        InputError: the file is missing or wrong.
        OSError: a file cannot be copied.
    """
    data = read_content(path)
    named = [data.get(key, {}).get('file') for key in ('sands', 'hidden')]
    folder.mkdir(parents=True)
    for file in (path, *(path.parent / name for name in named if name)):
        shutil.copyfile(file, folder / file.name)


def save_calibration(calibration: Calibration, path: Path | str) -> None:
    """Write the calibration as YAML to `path`, and its pictures to the same folder.

    Raises:
        OSError: one of the files cannot be written.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    data: dict[str, Any] = {
        'schema': SCHEMA,
        'made': calibration.made,
        'scale_error': calibration.scale_error,
        'signal': {
            'contrast': calibration.signal.contrast,
            'weights': [round(value, 5) for value in calibration.signal.weights],
        },
        'response': {
            'signal': [round(value, 5) for value in calibration.response.signal],
            'concentration': [round(value, 5) for value in calibration.response.concentration],
            'deviation': [round(value, 5) for value in calibration.response.deviation],
        },
    }
    if calibration.signal.absorbance is not None:
        data['signal']['absorbance'] = [round(value, 4) for value in calibration.signal.absorbance]
    if calibration.sands is not None:
        _write_picture(path.with_name('sands.png'), calibration.sands)
        data['sands'] = {
            'file': 'sands.png',
            'factors': [round(value, 4) for value in calibration.factors],
            'deviations': [round(value, 4) for value in calibration.factor_deviations],
        }
    if calibration.hidden is not None:
        _write_picture(path.with_name('hidden.png'), calibration.hidden)
        data['hidden'] = {'file': 'hidden.png'}
    if calibration.blur_px is not None:
        data['blur_px'] = round(calibration.blur_px, 3)
    path.write_text(yaml_text(data), encoding='utf-8')


def _write_picture(file: Path, picture: Labels) -> None:
    """Write a grey picture as PNG; OpenCV itself tells no fault of writing."""
    file.write_bytes(cv2.imencode('.png', picture)[1].tobytes())


def _check_sands(calibration: Calibration) -> None:
    """Raise InputError unless each sand of the picture has one factor, and maybe one deviation."""
    sands = 1 if calibration.sands is None else int(calibration.sands.max()) + 1
    factors, deviations = len(calibration.factors), len(calibration.factor_deviations)
    # a sand of the picture may be painted over by hand: then a factor remains
    if factors < sands or (calibration.sands is None and factors > 1):
        raise InputError(
            f'sands.factors: {factors} numbers for {sands} sands in the picture (grey levels 0 to '
            f'{sands - 1}); correct the picture or calibrate again'
        )
    if deviations not in (0, factors):
        raise InputError(
            f'sands.deviations: {deviations} numbers for {factors} factors; calibrate again'
        )


def _number(key: str, value: Any, low: float, high: float) -> float:
    """Return `value` of the entry `key`.

    Raises:
        InputError: it is no number, or not between `low` and `high`.
    """
    if type(value) not in (int, float) or not low <= value <= high:
        said = f'{value!r}'[:QUOTED]
        raise InputError(f'{key}: {said} is no number from {low:g} to {high:g}; calibrate again')
    return float(value)


def _numbers(key: str, values: Any, low: float, high: float) -> tuple[float, ...]:
    """Return `values` of the entry `key`, each as `_number`."""
    if not isinstance(values, list | tuple):
        raise InputError(f'{key}: {values!r} is no list of numbers; calibrate again')
    return tuple(_number(key, value, low, high) for value in values)


def _response(entry: dict[str, Any]) -> Response:
    """Return the response from its entry in the file."""
    response = Response(
        _numbers('response.signal', entry['signal'], -_MOST, _MOST),
        _numbers('response.concentration', entry['concentration'], *CONCENTRATION_RANGE),
        _numbers('response.deviation', entry.get('deviation', ()), 0.0, _MOST),
    )
    top = response.concentration[-1]
    if top < _LEAST_TOP:
        raise InputError(
            f'response.concentration: ends at {top:g}, far below tracer stock, which is 1; '
            'calibrate again'
        )
    return response


def _signal(entry: dict[str, Any]) -> TracerSignal:
    """Return the signal from its entry in the file; older files have no absorbance."""
    contrast, absorbance = entry['contrast'], entry.get('absorbance')
    if contrast not in get_args(Contrast):
        kinds = ' or '.join(get_args(Contrast))
        raise InputError(f'signal.contrast: {contrast!r} is not {kinds}; calibrate again')
    return TracerSignal(
        contrast,
        _weights('signal.weights', entry['weights']),
        None if absorbance is None else _weights('signal.absorbance', absorbance),
    )


def _weights(key: str, values: Any) -> tuple[float, float, float]:
    """Return the three numbers of the entry `key` for red, green and blue."""
    weights = _numbers(key, values, -_MOST, _MOST)
    if len(weights) != len(_CHANNELS) or not any(weights):
        raise InputError(
            f'{key}: {values!r} are not numbers for {", ".join(_CHANNELS)} that see the tracer; '
            'calibrate again'
        )
    red, green, blue = weights
    return red, green, blue


def _picture(path: Path, key: str, name: Any) -> Labels | None:
    """Return the grey picture `name` in the folder of `path`, None without a name.

    Raises:
        InputError: the value of `key` is no name of a file, or there is no such picture.
    """
    if name is None:
        return None
    if not isinstance(name, str) or not name or Path(name).name != name:
        raise InputError(
            f'{key}: {name!r} is no name of a picture beside this file; name one, such as '
            f'{key.partition(".")[0]}.png'
        )
    file = path.with_name(name)
    picture = None
    if file.is_file():
        data = read_regular(file)
        photo_size(data)
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE)
    if picture is None:
        fault = 'cannot be read' if file.is_file() else 'is not beside it'
        raise InputError(
            f"{key}: picture '{name}' {fault}; put a copy of the picture there, or calibrate again"
        )
    return np.asarray(picture, np.uint8)
