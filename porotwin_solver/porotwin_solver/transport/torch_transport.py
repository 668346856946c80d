"""Transport on a graphics processor, through PyTorch: whole arrays instead of compiled loops.

The scheme is the one of `transport` and `diffusion`, with the same local time steps. The sums have
the same order, so the results agree to round-off. The cells lie in the order of their levels, the
highest level first: all cells that take a substep are the first ones, and no list of them is
needed. Sides of a cell are two axes, (x, z) and (low, high), so arrays of sides are (2, 2, cells).

This module is loaded where a model asks for a device, because PyTorch takes seconds to load.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import torch
from numpy.typing import NDArray
from torch import Tensor

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray
from porotwin_solver.coefficients.compiled import NEGLIGIBLE
from porotwin_solver.coefficients.face_field import FaceField
from porotwin_solver.transport.diffusion import Exchanges, diffuse
from porotwin_solver.transport.local_time_steps import TimeStepLevels, lowest_starting_level
from porotwin_solver.transport.scheme import Scheme
from porotwin_solver.transport.transport import Sources


class TorchTransport:
    """Advances concentrations on a device.

    The tensors of the latest coefficients are kept, and on a CUDA device the recorded step: rates
    seldom change. One object serves one thread at a time.
    """

    def __init__(self, device: str, scheme: Scheme) -> None:
        """Compute on `device`: 'cuda', 'cuda:1' and so on, or 'cpu'.

        Raises:
            InputError: this machine has no such device.
        """
        self._device = usable_device(device)
        self._scheme = scheme
        self._latest: tuple[TimeStepLevels, Exchanges, _Step] | None = None

    def advance(
        self,
        concentration: FloatArray,
        storage: FloatArray,
        flux: FaceField,
        sources: Sources,
        levels: TimeStepLevels,
        exchanges: Exchanges,
        tracer_lost: FloatArray,
    ) -> None:
        """Advance `concentration` (nz, nx) in place: diffusion, advection, diffusion.

        The arguments are as in `advect` and `diffuse`. Exchange with other cells than the
        neighbours, and in several substeps, is done on the processor.
        """
        if (
            self._latest is None
            or self._latest[0] is not levels
            or self._latest[1] is not exchanges
        ):
            self._latest = None  # frees memory before the new tensors need it
            step = _Step(self._device, storage, flux, sources, levels, exchanges, self._scheme)
            self._latest = (levels, exchanges, step)
        if not exchanges.to_neighbours:
            diffuse(concentration, storage, exchanges)
        self._latest[2].advance(concentration, tracer_lost)
        if not exchanges.to_neighbours:
            diffuse(concentration, storage, exchanges)


def usable_device(name: str) -> torch.device:
    """Return the device `name` of PyTorch.

    Raises:
        InputError: there is no such device.
    """
    try:
        device = torch.device(name)
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError) as error:
        count = torch.cuda.device_count()
        raise InputError(
            f"device '{name}': PyTorch, which finds {count} graphics processors here, cannot use "
            "it; take 'cpu', where threads share the cells"
        ) from error
    return device


class _Step:
    """One splitting step for fixed coefficients: its tensors, and on CUDA its recorded kernels."""

    def __init__(
        self,
        device: torch.device,
        storage: FloatArray,
        flux: FaceField,
        sources: Sources,
        levels: TimeStepLevels,
        exchanges: Exchanges,
        scheme: Scheme,
    ) -> None:
        def sent(values: NDArray[Any]) -> Tensor:
            return torch.from_numpy(values).to(device)

        self._c = torch.zeros(storage.shape, dtype=torch.float64, device=device)
        self._lost = torch.zeros(2, dtype=torch.float64, device=device)
        self._advection = _Advection(sent, storage, flux, sources, levels, scheme)
        self._diffusion = _Diffusion(sent, storage, exchanges) if exchanges.to_neighbours else None
        self._recorded = _recorded(self._run) if device.type == 'cuda' else self._run

    def advance(self, concentration: FloatArray, tracer_lost: FloatArray) -> None:
        """Advance `concentration` (nz, nx) in place; `tracer_lost` (2,) grows [m^3]."""
        self._c.copy_(torch.from_numpy(concentration))
        self._recorded()
        concentration[:] = self._c.cpu().numpy()
        tracer_lost += self._lost.cpu().numpy()

    def _run(self) -> None:
        self._lost.zero_()
        if self._diffusion is not None:
            self._diffusion.advance(self._c)
        self._advection.advance(self._c.view(-1), self._lost)
        if self._diffusion is not None:
            self._diffusion.advance(self._c)


def _recorded(work: Callable[[], None]) -> Callable[[], None]:
    """Return a function that repeats the kernels of `work` by one call.

    A step has thousands of short kernels, whose calls one by one would take longer than they do.
    """
    stream = torch.cuda.Stream()
    stream.wait_stream(torch.cuda.current_stream())
    with torch.cuda.stream(stream):
        work()  # libraries are loaded before the recording
    torch.cuda.current_stream().wait_stream(stream)
    graph = torch.cuda.CUDAGraph()
    with torch.cuda.graph(graph):
        work()
    replay: Callable[[], None] = graph.replay
    return replay


class _Diffusion:
    """Diffusion between neighbours over one step, as `diffusion_kernels.gains_from_neighbours`."""

    def __init__(
        self, sent: Callable[..., Tensor], storage: FloatArray, exchanges: Exchanges
    ) -> None:
        nz, nx = storage.shape
        start, weight = exchanges.start[:-1].reshape(nz, nx), exchanges.weight
        right = start.copy()
        right[:-1] += 1  # after the pair with the cell above
        self._upward = sent(exchanges.levels.duration * weight[start[:-1]])
        self._across = sent(exchanges.levels.duration * weight[right[:, :-1]])
        self._storage = sent(storage)

    def advance(self, c: Tensor) -> None:
        """Advance `c` (nz, nx) in place."""
        upward = _moved(c[1:] - c[:-1], self._upward)
        across = _moved(c[:, 1:] - c[:, :-1], self._across)
        gain = torch.zeros_like(c)
        gain[1:] -= upward
        gain[:, 1:] -= across
        gain[:-1] += upward
        gain[:, :-1] += across
        c += gain / self._storage


def _moved(difference: Tensor, factor: Tensor) -> Tensor:
    return torch.where(difference.abs() > NEGLIGIBLE, factor * difference, 0.0)


class _Sides(NamedTuple):
    """Constant numbers of the sides of the cells, (2, 2, cells), in the order of the levels.

    near: place of the neighbour; of the cell itself at the edge of the rig.
    sender: place in the tracer that leaves, flat, of the neighbour's opposite side.
    from_faster: whether the neighbour has a higher level.
    to_level: level of the neighbour.
    enters, pure: whether water enters; and through the edge of the rig, without tracer.
    edge: 1 where the side belongs to the edge of the rig, else 0.
    flux_out: water that leaves [m^3/s].
    cfl_out, cfl_in: fraction of the storage that leaves and enters in a substep.
    """

    near: Tensor
    sender: Tensor
    from_faster: Tensor
    to_level: Tensor
    enters: Tensor
    pure: Tensor
    edge: Tensor
    flux_out: Tensor
    cfl_out: Tensor
    cfl_in: Tensor


class _Cells(NamedTuple):
    """Constant numbers of the cells, in the order of the levels.

    storage [m^3]; length: of a substep [s]; tracer, outflow: as in `Sources` [m^3/s].
    low, high: concentration of the well that injects here; infinite without a well.
    room: fraction of the storage that stays for corrections [-].
    """

    storage: Tensor
    length: Tensor
    tracer: Tensor
    outflow: Tensor
    low: Tensor
    high: Tensor
    room: Tensor


class _Advection:
    """Advection over one step, as `transport_kernels`."""

    def __init__(
        self,
        sent: Callable[..., Tensor],
        storage: FloatArray,
        flux: FaceField,
        sources: Sources,
        levels: TimeStepLevels,
        scheme: Scheme,
    ) -> None:
        self._order = sent(levels.order).long()
        self._count = levels.count_at_least.tolist()
        self._scheme = scheme
        own = sent(levels.level).reshape(-1)[self._order]
        length = levels.duration / (1 << own.long()).double()
        inflow, tracer, outflow, store = (
            sent(values).reshape(-1)[self._order] for values in (*sources, storage)
        )
        self._sides = self._sides_of(sent(flux.x), sent(flux.z), own, length / store)
        cfl_well = inflow * (length / store)
        entering = _sum_of_sides(self._sides.cfl_in)
        injects = inflow > 0.0
        well = tracer / inflow
        self._cells = _Cells(
            store,
            length,
            tracer,
            outflow,
            torch.where(injects, well, torch.inf),
            torch.where(injects, well, -torch.inf),
            (1.0 - (entering + cfl_well)).clamp(min=0.0),
        )
        cells = storage.size
        # one more number, always zero: what the surroundings of the rig send
        self._leaving = torch.zeros(4 * cells + 1, dtype=torch.float64, device=store.device)
        self._amount = torch.zeros_like(self._leaving)

    def _sides_of(self, x: Tensor, z: Tensor, own: Tensor, cfl_per_flux: Tensor) -> _Sides:
        (nz, columns), cells = x.shape, len(own)
        nx = columns - 1
        row, column = self._order // nx, self._order % nx
        place = torch.empty_like(self._order)
        place[self._order] = torch.arange(cells, device=place.device)

        def both(low: Tensor, high: Tensor, left: Tensor, right: Tensor) -> Tensor:
            return torch.stack([torch.stack([low, high]), torch.stack([left, right])])

        edge = both(column == 0, column == nx - 1, row == 0, row == nz - 1)
        step = torch.tensor([[-1, 1], [-nx, nx]], device=place.device)[:, :, None]
        near = place[torch.where(edge, self._order, self._order + step)]
        opposite = torch.tensor([[1, 0], [3, 2]], device=place.device)[:, :, None]
        # positive outward
        out = both(-x[row, column], x[row, column + 1], -z[row, column], z[row + 1, column])
        leaving, entering = out.clamp(min=0.0), (-out).clamp(min=0.0)
        return _Sides(
            near,
            torch.where(edge, 4 * cells, opposite * cells + near),
            own[near] > own,
            own[near],
            entering > 0.0,
            (entering > 0.0) & edge,
            edge.double(),
            leaving,
            leaving * cfl_per_flux,
            entering * cfl_per_flux,
        )

    def advance(self, c: Tensor, lost: Tensor) -> None:
        """Advance the flat `c` in place; `lost` (2,) grows by the tracer that left [m^3]."""
        self._leaving.zero_()
        self._amount.zero_()
        ordered = c[self._order]
        highest = len(self._count) - 1
        for substep in range(1 << highest):
            self._send(ordered, self._count[lowest_starting_level(substep, highest)])
            self._receive(ordered, lowest_starting_level(substep + 1, highest), lost)
        c[self._order] = ordered

    def _send(self, c: Tensor, count: int) -> None:
        """Compute the tracer that leaves the first `count` cells, as `evaluate_faces`."""
        sides = _Sides(*(values[..., :count] for values in self._sides))
        here = c[:count]
        value = here
        if self._scheme != Scheme.UPWIND:
            value = here + self._corrections(c, sides, here)
        leaving = torch.where(here < NEGLIGIBLE, 0.0, sides.flux_out * value)
        self._of_sides(self._leaving)[..., :count] = leaving
        self._of_sides(self._amount)[..., :count] += self._cells.length[:count] * leaving

    def _corrections(self, c: Tensor, sides: _Sides, here: Tensor) -> Tensor:
        """Return the corrections on the outflow sides, as `cell_corrections`; any on the others."""
        count = len(here)
        near = c[sides.near]
        ahead = near - here
        entered = sides.cfl_in * (here - near)
        across = -0.5 * (entered[:, 0] + entered[:, 1]).flip(0)[:, None]
        added = self._slopes(here - near.flip(1), ahead, sides.cfl_out) + across
        added = torch.minimum(torch.maximum(added, ahead.clamp(max=0.0)), ahead.clamp(min=0.0))
        upstream = torch.where(sides.enters, near, here)
        upstream = torch.where(sides.pure, 0.0, upstream)
        low = torch.minimum(torch.minimum(upstream.amin((0, 1)), here), self._cells.low[:count])
        high = torch.maximum(torch.maximum(upstream.amax((0, 1)), here), self._cells.high[:count])
        down = self._share(here - low, _sum_of_sides(sides.cfl_out * added.clamp(min=0.0)))
        up = self._share(high - here, -_sum_of_sides(sides.cfl_out * added.clamp(max=0.0)))
        return added * torch.where(added > 0.0, down, up)

    def _slopes(self, behind: Tensor, ahead: Tensor, cfl: Tensor) -> Tensor:
        """Return the limited increments to the sides, as `transport_kernels.slope`."""
        a, b = ahead.abs(), behind.abs()
        most_ahead: Tensor | float = 2.0
        most_behind: Tensor | float = 2.0
        if self._scheme == Scheme.COMPRESSIVE:
            most_ahead, most_behind = 2.0 / (1.0 - cfl), 2.0 / cfl
        size = torch.maximum(torch.minimum(a, most_behind * b), torch.minimum(most_ahead * a, b))
        if self._scheme == Scheme.THIRD_ORDER:
            size = torch.minimum(((2.0 - cfl) * a + (1.0 + cfl) * b) / 3.0, size)
        slope = torch.copysign(0.5 * (1.0 - cfl) * size, ahead)
        return torch.where(behind * ahead > 0.0, slope, 0.0)

    def _share(self, distance: Tensor, wanted: Tensor) -> Tensor:
        """Return the share of the `wanted` change that keeps the cell within its range."""
        allowed = distance * self._cells.room[: len(distance)]
        return torch.where(wanted > allowed, allowed / wanted, 1.0)

    def _receive(self, c: Tensor, level: int, lost: Tensor) -> None:
        """End a substep of the cells with at least this `level`, as `update_cells`."""
        count = self._count[level]
        cells = _Cells(*(values[:count] for values in self._cells))
        sides = _Sides(*(values[..., :count] for values in self._sides))
        here = c[:count]
        sent = cells.length * self._of_sides(self._leaving)[..., :count]
        produced = cells.outflow * here
        received = torch.where(
            sides.from_faster,
            self._amount[sides.sender],
            cells.length * self._leaving[sides.sender],
        )
        lost[0] += (cells.length * produced).sum()
        lost[1] += (sides.edge * sent).sum()
        gain = cells.length * (cells.tracer - produced)
        here += _sum_of_sides(received - sent, gain) / cells.storage
        amount = self._of_sides(self._amount)[..., :count]
        amount.masked_fill_(sides.to_level >= level, 0.0)

    def _of_sides(self, flat: Tensor) -> Tensor:
        return flat[:-1].view(2, 2, -1)


def _sum_of_sides(values: Tensor, begin: Tensor | float = 0.0) -> Tensor:
    """Return `begin` plus west, east, south, north, in this order."""
    (west, east), (south, north) = values
    return begin + west + east + south + north
