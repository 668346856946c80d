"""The cost of a map is told before work begins, and too much of it is refused in one line."""

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_imaging.baseline.baseline import make_baseline
from porotwin_imaging.geometry.imaging_cost import map_cost, refuse_costly

CAMERA_PX = (7952, 4472)


@pytest.fixture
def rig(laboratory):
    """The rig of the laboratory, photographed with 36 megapixels."""
    plain = laboratory.rig
    factor = CAMERA_PX[0] / laboratory.size[0]
    corners = [[factor * value for value in corner] for corner in plain.camera.corners_px]
    camera = plain.camera.model_copy(update={'corners_px': corners})
    return plain.model_copy(update={'camera': camera})


def test_the_cost_grows_with_the_cells(rig) -> None:
    costs = [map_cost(rig, rig.grid(nx, nx // 2), CAMERA_PX) for nx in (280, 2800, 7000)]
    assert costs[0].memory_bytes < 0.4e9 < costs[1].memory_bytes < 1e9 < costs[2].memory_bytes
    assert costs[2].memory_bytes < 4e9


def test_a_map_as_fine_as_the_photograph_is_made(rig) -> None:
    grid = rig.grid(7000, 3900)
    refuse_costly(map_cost(rig, grid, CAMERA_PX), grid, memory_bytes=16e9)


def test_a_grid_finer_than_the_photograph_is_refused_with_its_cost(rig) -> None:
    grid = rig.grid(30000, 16000)
    with pytest.raises(InputError, match=r'480,000,000 cells and .* shows all') as refused:
        refuse_costly(map_cost(rig, grid, CAMERA_PX), grid)
    assert '\n' not in str(refused.value)


def test_the_grid_that_is_offered_is_accepted(rig) -> None:
    grid, memory = rig.grid(7000, 3900), 4e9
    with pytest.raises(InputError, match='too much for a computer with 4 GB') as refused:
        refuse_costly(map_cost(rig, grid, CAMERA_PX), grid, memory)
    nx, nz = (int(count) for count in str(refused.value).rsplit(' ', 1)[1].split('x'))
    offered = rig.grid(nx, nz)
    refuse_costly(map_cost(rig, offered, CAMERA_PX), offered, memory)


def test_no_work_begins_on_an_absurd_grid(laboratory, empty_photograph) -> None:
    rig = laboratory.rig
    with pytest.raises(InputError, match='shows all that is in the photograph'):
        make_baseline(rig, rig.grid(20_000, 10_000), [empty_photograph])
