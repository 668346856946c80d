"""The control section in words."""

from pathlib import Path

from porotwin_cli.checking.control_words import control_words
from porotwin_cli.checking.rig_check import check
from porotwin_cli.pictures.check_picture import check_picture
from porotwin_core.rig import ObjectiveDescription, load_rig

RIG_FILE = Path(__file__).resolve().parents[2] / 'porotwin_hub' / 'config' / 'small_rig.yaml'


def test_limits_and_parts_are_told() -> None:
    rig = load_rig(RIG_FILE)
    zone = [[0.2, 0.2], [0.4, 0.2], [0.4, 0.4]]
    parts = [{'name': 'keep_in', 'zone_m': zone, 'weight': 2.0}, {'name': 'least_water'}]
    assert rig.control is not None
    control = rig.control.model_copy(
        update={
            'objective': ObjectiveDescription(name='sum', parameters={'parts': parts}),
            'max_change_ml_h': 50.0,
            'end_min': 80.0,
            'disallowed_zone_m': (),
        }
    )
    limits, objective = control_words(rig.model_copy(update={'control': control}))
    assert 'at most 50 ml/h of change' in limits
    assert 'end after 80 min' in limits
    assert 'keep_in (weight 2.0) + least_water; zones: 1 keep in' in objective
    free = control.model_copy(update={'max_change_ml_h': None})
    limits = control_words(rig.model_copy(update={'control': free}))[0]
    assert 'any change from setpoint to setpoint' in limits
    spared = control.model_copy(update={'max_producer_rate_ml_h': control.most_fixed_ml_h + 200})
    assert ', 200 ml/h together' in control_words(rig.model_copy(update={'control': spared}))[0]
    assert control_words(rig.model_copy(update={'control': None})) == []


def test_the_picture_draws_the_zones(tmp_path: Path) -> None:
    check_picture(tmp_path / 'check.png', check(RIG_FILE))
    assert (tmp_path / 'check.png').stat().st_size > 0
