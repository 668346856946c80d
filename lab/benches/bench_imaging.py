"""The time from photograph to map on this machine, per stage, at the resolution of the camera.

Peers (`lab.benches.peers`) make a map of the first grid from the same files.
"""

import resource
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import active_children, get_context
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from lab.benches.peers.peer_process import IMAGERS, Peer, run_peer
from porotwin_core.geometry.grid import conservative_resample
from porotwin_core.rig import Rig
from porotwin_imaging.baseline.baseline import Baseline, make_baseline
from porotwin_imaging.light.colour_checker import REFERENCE
from porotwin_imaging.photo_to_map import concentration_map
from porotwin_imaging.tracer.calibration import Calibration

CAMERA = (7952, 4472)
"""Columns and rows of the camera of the FluidFlower rigs [px]."""
SMALL_RIG, LARGE_RIG = (0.934, 0.562), (2.8, 1.5)
"""Width and height of the FluidFlower rigs [m]."""
Maps = tuple[int, int, tuple[float, float]]
"""Columns and rows of maps, and width and height of their rig [m]."""
GRIDS: Mapping[str, Maps] = {
    '280x150': (280, 150, SMALL_RIG),
    '1 mm': (934, 562, SMALL_RIG),
    '1 mm, large rig': (2800, 1500, LARGE_RIG),
}
"""Maps by name."""
COLUMNS = ('median_s', 'longest_s', 'processor_s', 'memory_mb', 'error', 'times_ours')
"""Figures of a row; the last four are known for whole photographs."""
ROUNDS = 9
"""Photographs whose median time is reported."""
PEER_ROUNDS = 3
"""The same for a peer, which takes seconds for each."""
_MARGIN, _UPPER_MARGIN = 200, 400
"""Distance of the rig from the edges of the photograph [px]; the chart is above the rig."""
_CHART = (300, 40, 70)
"""Column and row of the colour chart, and the distance of its patches [px]."""
_SEED = 11
"""Seed of the grains."""


def run(
    camera: tuple[int, int] = CAMERA,
    rounds: int = ROUNDS,
    grids: Mapping[str, Maps] = GRIDS,
) -> list[dict[str, Any]]:
    """Return one row per stage and grid: median and longest time [s] of `rounds` photographs.

    `grids` are the maps by name. `processor_s` is the time that all
    cores together worked on a photograph.

    The time is from the bytes of the file to the map. The photograph of `camera` (columns, rows)
    [px] is synthetic. `memory_mb` is the peak memory of a process that does nothing else.
    """
    baseline, state = _in_a_process(_photographs, camera)
    rows = _in_a_process(_measure, camera, rounds, dict(grids), baseline, state)
    name, maps = next(iter(grids.items()))
    ours = next(row for row in rows if row['stage'] == 'whole')
    peers = [_peer_row(peer, name, maps, camera, (baseline, state)) for peer in IMAGERS]
    for row in (ours, *peers):
        seconds = row['processor_s']
        row['times_ours'] = seconds and round(seconds / ours['processor_s'], 1)
    return rows + peers


def _peer_row(
    peer: Peer,
    name: str,
    maps: Maps,
    camera: tuple[int, int],
    photographs: tuple[bytes, bytes],
) -> dict[str, Any]:
    """Return the row of a peer: the mean time of a photograph, and the error of its map."""
    nx, nz, size = maps
    picture = _rig(camera, size).camera
    assert picture is not None
    baseline, state = (np.frombuffer(data, np.uint8) for data in photographs)
    problem = {
        'baseline': baseline,
        'state': state,
        'corners': np.array(picture.corners_px),
        'chart': np.array(picture.colour_checker_px),
        'size': np.array(size),
        'shape': np.array([nz, nx]),
        'rounds': np.array(PEER_ROUNDS),
    }
    title, found, processor, wall, memory = run_peer(peer, problem)
    row = {'grid': name, 'stage': title} | dict.fromkeys(COLUMNS, '')
    if found is None or processor is None or wall is None or memory is None:
        return row
    return row | {
        'median_s': round(wall / PEER_ROUNDS, 4),
        'processor_s': round(processor / PEER_ROUNDS, 4),
        'memory_mb': round(1000.0 * memory),
        'error': _error(found, camera),
    }


def _error(signal: NDArray[Any], camera: tuple[int, int]) -> float:
    """Return the relative L2 error of a map (nz, nx), after the cubic that suits it best.

    The photograph obeys no law of absorption, and none was calibrated.
    """
    left, top = _MARGIN, _UPPER_MARGIN
    plume = _plume(camera)[top : camera[1] - _MARGIN, left : camera[0] - _MARGIN]
    truth = conservative_resample(plume[::-1].astype(np.float64), signal.shape).ravel()
    powers = np.nan_to_num(signal.ravel())[:, None] ** np.arange(1, 4)
    factors = np.linalg.lstsq(powers, truth, rcond=None)[0]
    return round(float(np.linalg.norm(powers @ factors - truth) / np.linalg.norm(truth)), 4)


def _in_a_process(work: Callable[..., Any], *arguments: Any) -> Any:
    """Return `work(*arguments)`, called in a new process, so that memory is measured separately."""
    with ProcessPoolExecutor(1, mp_context=get_context('spawn')) as pool:
        try:
            return pool.submit(work, *arguments).result()
        except KeyboardInterrupt:
            for child in active_children():  # the pool would wait for its work
                child.terminate()
            raise


def _measure(
    camera: tuple[int, int],
    rounds: int,
    grids: dict[str, Maps],
    baseline: bytes,
    state: bytes,
) -> list[dict[str, Any]]:
    """Return the rows of `run`."""
    rows: list[dict[str, Any]] = []
    for name, (nx, nz, size) in grids.items():
        rig = _rig(camera, size)
        reference = make_baseline(rig, rig.grid(nx, nz), [baseline], calibration=Calibration())
        last = concentration_map(state, reference)  # compiles the kernels
        before = time.process_time()
        runs = [_timed(reference, state) for _ in range(rounds)]
        processor = (time.process_time() - before) / rounds
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        for stage in runs[0]:
            times = [timings[stage] for timings in runs]
            row: dict[str, Any] = {'grid': name, 'stage': stage} | dict.fromkeys(COLUMNS, '')
            row['median_s'] = round(float(np.median(times)), 4)
            row['longest_s'] = round(max(times), 4)
            rows.append(row)
        row['processor_s'] = round(processor, 4)
        row['memory_mb'] = round(memory)
        row['error'] = _error(last.values, camera)
    return rows


def _timed(baseline: Baseline, state: bytes) -> dict[str, float]:
    """Return the duration of each stage and of the whole [s]."""
    start = time.perf_counter()
    timings = concentration_map(state, baseline).timings
    return {**timings, 'whole': time.perf_counter() - start}


def _rig(camera: tuple[int, int], size: tuple[float, float]) -> Rig:
    """Return a rig of `size` (width, height) [m] that fills photographs of `camera` [px]."""
    left_edge, upper_edge = _MARGIN, _UPPER_MARGIN
    right_edge, lower_edge = camera[0] - _MARGIN, camera[1] - _MARGIN
    corners = [
        [left_edge, upper_edge],
        [left_edge, lower_edge],
        [right_edge, lower_edge],
        [right_edge, upper_edge],
    ]
    x, y, pitch = _CHART
    chart_right, chart_lower = x + 5.8 * pitch, y + 3.8 * pitch
    chart = [[x, y], [x, chart_lower], [chart_right, chart_lower], [chart_right, y]]
    return Rig.model_validate(
        {
            'name': 'bench',
            'width_m': size[0],
            'height_m': size[1],
            'depth_m': 0.01,
            'porosity': 0.375,
            'permeability_m2': 6.57e-10,
            'viscosity_pa_s': 1e-3,
            'density_kg_m3': 998.0,
            'wells': {},
            'camera': {'corners_px': corners, 'colour_checker_px': chart},
        }
    )


def _photographs(camera: tuple[int, int]) -> tuple[bytes, bytes]:
    """Return JPEG files without and with tracer."""
    return _photograph(camera, tracer=False), _photograph(camera, tracer=True)


def _photograph(camera: tuple[int, int], tracer: bool) -> bytes:
    """Return a JPEG file with a picture of mottled sand, and with a green plume if `tracer`."""
    generator = np.random.default_rng(_SEED)
    columns, rows = camera
    grains = generator.normal(0.0, 1.0, (rows // 8, columns // 8)).astype(np.float32)
    mottled = cv2.resize(grains, camera, interpolation=cv2.INTER_CUBIC)
    shade = np.clip(110.0 + 28.0 * mottled, 0, 255)
    plume = _plume(camera) if tracer else np.zeros((rows, columns), np.float32)
    bands = (0.6, 0.8, 1.0), (0.5, 0.35, 0.6)
    pixels = np.stack(
        [shade * tone * (1 - takes * plume) for tone, takes in zip(*bands, strict=True)], axis=-1
    )
    x, y, pitch = _CHART
    pixels[y - 20 : y + 4 * pitch, x - 20 : x + 6 * pitch] = 25
    for index, colour in enumerate(REFERENCE):
        row_of, column_of = divmod(index, 6)
        first_row, first_column = y + pitch * row_of, x + pitch * column_of
        side = int(0.8 * pitch)
        levels = 255 * np.clip(colour[::-1], 0, 1) ** (1 / 2.2)
        pixels[first_row : first_row + side, first_column : first_column + side] = levels
    _, data = cv2.imencode('.jpg', pixels.astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, 92])
    return data.tobytes()


def _plume(camera: tuple[int, int]) -> NDArray[np.float32]:
    """Return the tracer of the photograph, 0 to 1, row 0 at the top."""
    columns, rows = camera
    row, column = np.ogrid[:rows, :columns]
    distance = np.hypot(column - 0.4 * columns, row - 0.5 * rows) / (0.12 * columns)
    return np.clip(4.0 * (1.1 - distance), 0, 1).astype(np.float32)


if __name__ == '__main__':
    for row in run():
        print(row)
