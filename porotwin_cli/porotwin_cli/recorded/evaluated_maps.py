"""The observed, free-running and corrected maps of an evaluation, as `simulate` writes maps."""

from contextlib import ExitStack
from pathlib import Path
from typing import Self

from porotwin_cli.options.output_files import maker
from porotwin_core.geometry.grid import Grid
from porotwin_costa.evaluation.evaluation import FrameFields
from porotwin_recording.tables.concentration import ConcentrationWriter, MapOrigin

MAP_KINDS = {'observed': 'observed', 'free_run': 'free_predicted', 'corrected': 'free_corrected'}
"""Names of the files of a recording, and their fields: the maps of the errors, the free run of the
model, and the free run with COSTA."""


class EvaluatedMaps(ExitStack):
    """Writes `maps_NUMBER_KIND.nc` into `folder`, map by map, for recordings in their order.

    `NUMBER` is left out if there is one recording. Every command that takes maps reads these files.
    """

    def __init__(self, folder: Path, grid: Grid, recordings: int) -> None:
        super().__init__()
        self._folder, self._grid, self._several = folder, grid, recordings > 1
        self._writers: dict[str, dict[str, ConcentrationWriter]] = {}

    def see(self, frame: FrameFields) -> None:
        """Write the maps of `frame`; the frames of a recording come in the order of time.

        Raises:
            OSError: the disk is full or fails.
        """
        if frame.experiment not in self._writers:
            number = f'{len(self._writers) + 1}_' if self._several else ''
            self._writers[frame.experiment] = {
                kind: self.enter_context(self._writer(f'maps_{number}{kind}.nc'))
                for kind in MAP_KINDS
            }
        for kind, writer in self._writers[frame.experiment].items():
            writer.append(frame.time, getattr(frame, MAP_KINDS[kind]))

    def _writer(self, name: str) -> ConcentrationWriter:
        origin = MapOrigin(program=maker('evaluate'))
        return ConcentrationWriter(self._folder / name, self._grid, origin=origin)

    def __enter__(self) -> Self:
        super().__enter__()
        return self
