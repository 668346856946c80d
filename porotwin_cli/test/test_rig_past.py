"""The earlier findings on a rig beside a new diagnosis of it."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from porotwin_cli.checking.rig_past import RigPast
from porotwin_core.basis.errors import InputError
from porotwin_core.rig import EffectDescription, Rig, load_rig
from porotwin_recording.experiment.recording import Recording
from porotwin_recording.tables.concentration import VIRTUAL, MapOrigin

RIG = load_rig(Path(__file__).resolve().parents[2] / 'porotwin_hub' / 'config' / 'small_rig.yaml')
PORE_EFFECT = EffectDescription(name='porosity', parameters={'factor': 1.15})


def made(folder: Path) -> Recording:
    return Recording(source=folder, rig=RIG)


def past(folder: Path, name: str, date: str, rig: Rig = RIG) -> RigPast:
    recordings: Any = [Recording(source=folder / name, rig=rig)]
    return RigPast(folder / 'history', recordings, date)


def summary(factor: float) -> dict[str, Any]:
    entry = {'value': factor, 'low': factor - 0.02, 'high': factor + 0.02}
    row = {'name': 'porosity', 'probability': 0.9, 'parameters': {'factor': entry}}
    return {
        'verdict': 'porosity',
        'confidence': 0.9,
        'combination': ['porosity'],
        'not_separable_from': [],
        'effects': [row],
    }


def test_the_second_recording_is_compared_with_the_first(tmp_path: Path) -> None:
    first = past(tmp_path, 'monday', '2025-11-23')
    assert 'this is the first one' in first.compare(summary(1.15))[0]
    first.remember(summary(1.15))
    second = past(tmp_path, 'tuesday', '2025-11-24')
    assert len(second.before) == 1
    (line,) = second.compare(summary(1.3))
    assert line.startswith(
        'porosity factor drifts: 1.15 on 2025-11-23, 1.3 now. It rises by 0.15 a day. '
        'The effect is stronger now.'
    )


def test_a_recording_knows_neither_itself_nor_a_later_one(tmp_path: Path) -> None:
    past(tmp_path, 'tuesday', '2025-11-24').remember(summary(1.15))
    assert past(tmp_path, 'tuesday', '2025-11-24').before == []
    assert past(tmp_path, 'monday', '2025-11-23').before == []


def test_findings_of_a_later_date_are_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    past(tmp_path, 'thursday', '2025-11-26').remember(summary(1.1))
    past(tmp_path, 'monday', '2025-11-23')
    assert '1 findings on this rig are dated later than 00:00 of 2025-11-23' in (
        capsys.readouterr().err
    )


def test_findings_before_a_correction_of_the_rig_are_not_compared(tmp_path: Path) -> None:
    past(tmp_path, 'monday', '2025-11-23').remember(summary(1.15))
    mended = past(tmp_path, 'tuesday', '2025-11-24', RIG.with_effects([PORE_EFFECT]))
    none = {**summary(1.0), 'verdict': 'none', 'combination': []}
    (line,) = mended.compare(none)
    assert 'no earlier finding with this rig.yaml; this is the first one.' in line


def test_a_history_of_another_rig_is_refused_before_the_work(tmp_path: Path) -> None:
    past(tmp_path, 'monday', '2025-11-23').remember(summary(1.15))
    with pytest.raises(InputError, match='findings on another rig'):
        past(tmp_path, 'tuesday', '2025-11-24', RIG.model_copy(update={'porosity': 0.3}))


def test_what_a_replaced_finding_held_besides_is_told(tmp_path: Path) -> None:
    recordings: Any = [made(tmp_path / 'monday'), made(tmp_path / 'tuesday')]
    RigPast(tmp_path / 'history', recordings, '2025-11-23').remember(summary(1.15))
    recordings = [made(tmp_path / 'tuesday'), made(tmp_path / 'friday')]
    *_, line = RigPast(tmp_path / 'history', recordings, '2025-11-27').remember(summary(1.15))
    assert 'monday together with this recording was replaced' in line
    (line,) = past(tmp_path, 'friday', '2025-11-27').remember(summary(1.15))
    assert 'together with others; this one is not added' in line
    assert past(tmp_path, 'saturday', '2025-11-28').remember(summary(1.15)) == []


def test_a_recording_from_the_future_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r'--date 2999-01-01: lies in the future'):
        past(tmp_path, 'monday', '2999-01-01')
    assert not (tmp_path / 'history').exists()


def test_a_finding_on_the_virtual_rig_is_no_belief_about_the_real_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    maps = SimpleNamespace(origin=MapOrigin(program=f'PoroTwin 1.0, {VIRTUAL}'))
    rehearsed: Any = [Recording(source=tmp_path / 'rehearsed', rig=RIG, maps=maps)]
    virtual = RigPast(tmp_path / 'history', rehearsed, '2025-11-23')
    assert 'rehearsed: was made by the virtual rig' in capsys.readouterr().err
    virtual.remember(summary(1.15))
    assert past(tmp_path, 'tuesday', '2025-11-24').before == []
    again: Any = [Recording(source=tmp_path / 'rehearsed-again', rig=RIG, maps=maps)]
    assert len(RigPast(tmp_path / 'history', again, '2025-11-24').before) == 1
