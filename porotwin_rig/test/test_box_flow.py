"""The box method: water is conserved, and fluxes converge to the exact ones of image wells."""

import numpy as np
import pytest
from rig_examples import SMALL

from porotwin_core.basis.errors import InputError
from porotwin_core.rig import Boundaries, rig_from_maps
from porotwin_rig.box_flow import BoxFlow, Fluxes, no_flux, radial_fluxes
from porotwin_rig.mesh import Mesh
from porotwin_rig.water_places import WaterPlaces

TRANSMISSIVITY = 6.4e-5
WIDTH, HEIGHT = 0.9, 0.6
SOURCE, SINK = (0.2371, 0.2213), (0.6611, 0.3507)


def held_vertices(mesh: Mesh, sides: Boundaries) -> np.ndarray:
    return WaterPlaces.on(mesh, sides.bodies).held


def uniform_flow(mesh: Mesh, top: str) -> BoxFlow:
    sand = np.full((mesh.nz, mesh.nx), TRANSMISSIVITY)
    sides = Boundaries(top=top)
    return BoxFlow(mesh, sand, sand, held=held_vertices(mesh, sides))


def image_fluxes(mesh: Mesh, x: float, z: float, *, open_top: bool, reach: int = 8) -> Fluxes:
    """Return the fluxes of a unit well in a box by its mirror images (Bear 1972, sec. 7.8)."""
    total = no_flux(mesh)
    for n in range(-reach, reach + 1):
        for m in range(-reach, reach + 1):
            sign = (-1.0) ** (m % 2) if open_top else 1.0
            for image_x in (2 * n * mesh.width + x, 2 * n * mesh.width - x):
                # an open top mirrors with the opposite sign; the image below it likewise
                for image_z in (2 * m * mesh.height + z, 2 * m * mesh.height - z):
                    total = total + radial_fluxes(mesh, image_x, image_z) * sign
    return total


def relative_difference(found: Fluxes, exact: Fluxes) -> float:
    difference = np.concatenate([(found.x - exact.x).ravel(), (found.z - exact.z).ravel()])
    size = np.concatenate([exact.x.ravel(), exact.z.ravel()])
    return float(np.linalg.norm(difference) / np.linalg.norm(size))


def test_radial_fluxes_are_free_of_sources_outside_the_box_of_the_well() -> None:
    mesh = Mesh(21, 13, WIDTH, HEIGHT)
    outflow = radial_fluxes(mesh, *SOURCE).outflow
    row, column = np.unravel_index(outflow.argmax(), outflow.shape)
    assert outflow[row, column] == pytest.approx(1.0, abs=1e-12)
    outflow[row, column] = 0.0
    assert np.abs(outflow).max() < 1e-12
    assert mesh.x[column] == pytest.approx(SOURCE[0], abs=mesh.hx / 2)
    assert mesh.z[row] == pytest.approx(SOURCE[1], abs=mesh.hz / 2)


@pytest.mark.parametrize('top', ['open', 'closed'])
def test_every_box_conserves_water_in_layered_sand(top: str) -> None:
    mesh = Mesh(41, 27, WIDTH, HEIGHT)
    generator = np.random.default_rng(11)
    sand = TRANSMISSIVITY * 10 ** generator.uniform(-2, 0, (mesh.nz, mesh.nx))
    flow = BoxFlow(mesh, sand, 0.5 * sand, held=held_vertices(mesh, Boundaries(top=top)))
    fluxes = flow.combined([(*SOURCE, 2.0), (*SINK, -2.0)])
    outflow = fluxes.outflow
    assert outflow.max() == pytest.approx(2.0, abs=1e-9)
    assert outflow.min() == pytest.approx(-2.0, abs=1e-9)
    assert np.sort(np.abs(outflow.ravel()))[-3] < 1e-9
    assert np.abs(fluxes.x[:, [0, -1]]).max() == 0.0
    assert np.abs(fluxes.z[0]).max() == 0.0


def test_fluxes_converge_to_image_wells_at_second_order() -> None:
    errors, sizes = [], []
    for nx, nz in ((19, 13), (37, 25), (75, 49)):
        mesh = Mesh(nx, nz, WIDTH, HEIGHT)
        found = uniform_flow(mesh, 'open').combined([(*SOURCE, 1.0), (*SINK, -1.0)])
        exact = image_fluxes(mesh, *SOURCE, open_top=True) - image_fluxes(
            mesh, *SINK, open_top=True
        )
        errors.append(relative_difference(found, exact))
        sizes.append(mesh.hx)
    rate = np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    assert errors[-1] < 1e-4, errors
    assert rate > 1.6, f'rate {rate:.2f} of {errors}'


def test_fluxes_in_a_closed_box_agree_with_image_wells() -> None:
    mesh = Mesh(37, 25, WIDTH, HEIGHT)
    found = uniform_flow(mesh, 'closed').combined([(*SOURCE, 1.0), (*SINK, -1.0)])
    exact = image_fluxes(mesh, *SOURCE, open_top=False) - image_fluxes(mesh, *SINK, open_top=False)
    # the sum of images of one sign converges slowly: the difference comes from the truncation
    assert relative_difference(found, exact) < 3e-4


@pytest.mark.parametrize(('columns', 'at_most'), [(30, 0.01), (280, 0.0034), (2800, 0.0031)])
def test_elements_are_small_beside_the_cells_of_a_permeability_map(
    columns: int, at_most: float
) -> None:
    sand = np.full((columns // 2, columns), 1e-9)
    numbers = {'depth_m': 0.02, 'porosity': 0.4}
    data = {**SMALL, 'width_m': 2.8, 'height_m': 1.5}
    mesh = Mesh.over(rig_from_maps(data, {**numbers, 'permeability_m2': sand}))
    assert mesh.hx < at_most
    assert mesh.nx * mesh.nz < 500_000


def test_forced_through_flow_is_uniform_in_uniform_sand() -> None:
    mesh = Mesh(31, 21, WIDTH, HEIGHT)
    sand = np.full((mesh.nz, mesh.nx), TRANSMISSIVITY)
    flow = BoxFlow(mesh, sand, sand, held=np.zeros(mesh.shape, dtype=bool))
    forced = no_flux(mesh)
    forced.x[:, [0, -1]] = 3e-9 * mesh.box_height[:, None]
    forced.z[[0, -1]] = -1e-9 * mesh.box_width
    fluxes = flow.through_walls(forced)
    np.testing.assert_allclose(fluxes.x / mesh.box_height[:, None], 3e-9, rtol=1e-9)
    np.testing.assert_allclose(fluxes.z / mesh.box_width, -1e-9, rtol=1e-9)


def test_changed_transmissivity_by_conjugate_gradients_agrees_with_a_factorisation() -> None:
    mesh = Mesh(31, 21, WIDTH, HEIGHT)
    sand = np.full((mesh.nz, mesh.nx), TRANSMISSIVITY)
    changed = sand * np.linspace(0.5, 1.5, mesh.nx)
    held = held_vertices(mesh, Boundaries())
    wells = [(*SOURCE, 1.0), (*SINK, -0.7)]
    iterated = BoxFlow(mesh, sand, sand, held=held).combined(wells, along=(changed, changed))
    direct = BoxFlow(mesh, changed, changed, held=held).combined(wells)
    assert relative_difference(iterated, direct) < 1e-6


@pytest.mark.parametrize('size', [(0.9, 0.6), (0.934, 0.562), (2.8, 1.5), (0.7, 0.3)])
@pytest.mark.parametrize('elements', [(31, 21), (45, 31), (61, 33)])
@pytest.mark.parametrize('aside', [(0.0, 0.0), (0.0, 0.013), (0.017, 0.0)])
def test_a_well_on_a_face_flows_as_one_beside_it(size, elements, aside) -> None:
    mesh = Mesh(*elements, *size)
    flow = uniform_flow(mesh, 'open')
    middle = (mesh.width / 2 + aside[0], mesh.height / 2 + aside[1])
    near = (middle[0] + 2e-4 * mesh.hx, middle[1] + 2e-4 * mesh.hz)
    assert relative_difference(flow.well(*middle), flow.well(*near)) < 1e-3


def test_a_place_is_moved_off_a_face_once_and_other_places_not_at_all() -> None:
    mesh = Mesh(21, 13, WIDTH, HEIGHT)
    x, z = mesh.off_faces(WIDTH / 2, HEIGHT / 2)
    assert 0.0 < x - WIDTH / 2 < 2e-4 * mesh.hx
    assert 0.0 < z - HEIGHT / 2 < 2e-4 * mesh.hz
    assert mesh.off_faces(x, z) == (x, z)
    assert mesh.off_faces(*SOURCE) == SOURCE
    outflow = radial_fluxes(mesh, x, z).outflow
    supply = np.zeros(mesh.shape)
    supply[outflow.argmax() // mesh.shape[1], outflow.argmax() % mesh.shape[1]] = 1.0
    np.testing.assert_allclose(outflow, supply, atol=1e-12)


def test_transmissivities_too_far_apart_are_refused() -> None:
    mesh = Mesh(31, 21, WIDTH, HEIGHT)
    sand = np.full((mesh.nz, mesh.nx), TRANSMISSIVITY)
    changed = sand * 10 ** np.random.default_rng(2).uniform(-3, 0, sand.shape)
    held = held_vertices(mesh, Boundaries())
    boxes = BoxFlow(mesh, sand, sand, held=held, most_iterations=3)
    with pytest.raises(InputError, match='flow: not found in 3 iterations'):
        boxes.combined([(*SOURCE, 1.0)], along=(changed, changed))


def test_more_injected_than_produced_leaves_through_the_open_top() -> None:
    mesh = Mesh(31, 21, WIDTH, HEIGHT)
    fluxes = uniform_flow(mesh, 'open').combined([(*SOURCE, 1.0), (*SINK, -0.4)])
    assert fluxes.z[-1].sum() == pytest.approx(0.6, abs=1e-10)
