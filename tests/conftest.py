"""Fixtures of tests of the whole project."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from diagnosis_examples import denser_sand, quiet

__all__ = ['denser_sand', 'quiet']

ROOT = Path(__file__).resolve().parents[1]
SHARED = ROOT.parent / 'shared'


@pytest.fixture(scope='session')
def real_photographs() -> Path:
    """The real photographs of the large FluidFlower rig."""
    folder = SHARED / 'data' / 'fluidflower_tracer'
    if not folder.is_dir():
        pytest.skip(f'the real photographs are not beside the checkout ({folder.parent.name})')
    return folder


@pytest.fixture
def small_rig_file(tmp_path: Path) -> Iterator[Path]:
    """The paper's rig.yaml, with the corners of the rig in the virtual camera's photographs."""
    from porotwin_core.rig import load_rig, write_rig
    from porotwin_rig.camera import camera_before

    rig = load_rig(ROOT / 'porotwin_hub' / 'config' / 'small_rig.yaml')
    rig = rig.model_copy(update={'camera': camera_before(rig, 800, 500).description()})
    path = tmp_path / 'rig.yaml'
    write_rig(rig, path)
    return path
