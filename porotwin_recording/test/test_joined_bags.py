"""Tests of bags in one folder that are no single recording."""

from pathlib import Path

import pytest
from recording_examples import controlled_rig, write_live_bag

from porotwin_core.conversions import rig_to_msg
from porotwin_core.errors import InputError
from porotwin_core.rig import Rig, write_rig
from porotwin_recording.recording import open_recording


def write_rig_bag(path: Path, rig: Rig) -> None:
    write_live_bag(path, [('/lab/rig/description', rig_to_msg(rig))])


@pytest.mark.parametrize(('first', 'second'), [('a', 'b'), ('a.mcap', 'b.mcap')])
@pytest.mark.parametrize('change', [{'name': 'other'}, {'width_m': 0.5}])
def test_bags_of_two_rigs_in_one_folder_are_refused(
    tmp_path: Path, first: str, second: str, change: dict[str, object]
) -> None:
    day, rig = tmp_path / 'day', controlled_rig()
    day.mkdir()
    other = rig.model_copy(update=change)
    write_rig_bag(day / first, rig)
    write_rig_bag(day / second, other)
    with pytest.raises(InputError) as error:
        open_recording(day)
    line = str(error.value)
    both = f"{day / first} of 'bench' and {day / second} of '{other.name}'"
    assert f'{both}, which differ in {next(iter(change))}; read' in line
    write_rig(rig, tmp_path / 'rig.yaml')
    open_recording(day, rig=tmp_path / 'rig.yaml')


@pytest.mark.parametrize('names', [('a', 'b'), ('run_0.mcap', 'run_1.mcap')])
def test_a_rig_may_be_corrected_from_bag_to_bag_and_within_one(
    tmp_path: Path, names: tuple[str, str]
) -> None:
    tmp_path.joinpath('day').mkdir()
    rig = controlled_rig()
    key = 'porosity' if names[0] == 'a' else 'width_m'
    for name, value in zip(names, (0.4, 0.41), strict=True):
        write_rig_bag(tmp_path / 'day' / name, rig.model_copy(update={key: value}))
    assert getattr(open_recording(tmp_path / 'day').rig, key) == 0.41
