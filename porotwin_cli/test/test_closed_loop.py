"""The demo on another rig than the paper's: its needs and its choices."""

import pytest

from porotwin_cli.running.closed_loop import DemoSettings, check_rig, usual_minutes
from porotwin_cli.running.rehearsal import balanced, injected_tracer
from porotwin_cli.workspace import small_rig
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import to_ml_h
from porotwin_core.rig import ObjectiveDescription, Rig, load_rig

RIG = load_rig(small_rig())


def with_control(**changes: object) -> Rig:
    assert RIG.control is not None
    return RIG.model_copy(update={'control': RIG.control.model_copy(update=changes)})


def test_the_well_that_injects_tracer_calibrates_the_camera() -> None:
    assert injected_tracer(RIG) == ('injector', 500.0, 1.0)
    with pytest.raises(InputError, match='names no well that injects tracer'):
        injected_tracer(with_control(fixed={}))


@pytest.mark.parametrize(('producer', 'wells'), [('producer', 2), (None, 1)])
def test_a_rig_without_a_producer_is_not_balanced(producer: str | None, wells: int) -> None:
    schedule = balanced([(0.0, 'injector', 500.0, 1.0)], producer)
    assert len(schedule.wells) == wells
    assert sum(to_ml_h(rate.rate) for rate in schedule.at(1.0).values()) == pytest.approx(
        0.0 if producer else 500.0
    )


def test_the_demo_needs_a_zone_to_keep_free_and_trains_for_the_small_rig_alone() -> None:
    check_rig(RIG, costa=False)
    swept = ObjectiveDescription(name='sweep', parameters={'zones_m': [[[0, 0], [0.4, 0], [0, 1]]]})
    with pytest.raises(InputError, match='counts the tracer in a zone to keep out of'):
        check_rig(with_control(objective=swept, disallowed_zone_m=()), costa=False)
    with pytest.raises(InputError, match=r'leave out --costa'):
        check_rig(RIG, costa=True)


def test_another_rig_is_controlled_from_the_start_until_its_end() -> None:
    assert usual_minutes(None, hidden=False) == 30.0
    assert usual_minutes(RIG, hidden=False) == 80.0
    assert usual_minutes(with_control(end_min=45.0), hidden=True) == 45.0
    settings = DemoSettings(20.0, 'max', 7, False, 'fast', 1600, '', rig=RIG)
    assert settings.start_minute == 0.0
