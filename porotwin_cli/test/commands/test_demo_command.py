"""./porotwin demo."""

from dataclasses import replace
from pathlib import Path

import pytest
from cli_examples import porotwin

from porotwin_cli.running.closed_loop import DemoSettings
from porotwin_cli.workspace import small_rig
from porotwin_core.rig import load_rig


@pytest.mark.parametrize(
    'arguments',
    [['--speed', 'abc'], ['--speed', '-1'], ['--preset', 'abc'], ['--page', 'nowhere:99999']],
)
def test_demo_checks_its_options_before_it_works(arguments: list[str], tmp_path: Path) -> None:
    result = porotwin('demo', '--output', tmp_path / 'demo', *arguments)
    assert result.returncode == 2, result.stderr
    assert f"'{arguments[1]}'" in result.stderr
    assert not (tmp_path / 'demo').exists()


def test_a_demo_without_offers_asks_nobody(tmp_path: Path) -> None:
    result = porotwin('demo', '--output', tmp_path / 'demo', '--ask')
    assert result.returncode == 2
    assert 'give one' in result.stderr


def test_a_short_demo_begins_when_the_tracer_comes_near_the_zone() -> None:
    short, long = settings(minutes=10.0), settings(minutes=80.0)
    assert short.start_minute > 0.0
    assert long.start_minute == 0.0
    assert (short.photographs, long.photographs) == (21, 161)
    assert short.expected_seconds() < long.expected_seconds()
    assert settings(minutes=80.0, speed='1').expected_seconds() > 80.0 * 60.0


def test_a_rig_whose_water_flows_faster_takes_longer() -> None:
    rig = load_rig(small_rig())
    assert rig.control is not None
    control = rig.control.model_copy(update={'max_total_rate_ml_h': 5000.0})
    fast = rig.model_copy(update={'control': control})
    usual, slow, more = (
        replace(settings(minutes=60.0), rig=one).expected_seconds() for one in (None, rig, fast)
    )
    assert usual == slow < more


def test_a_slow_demo_waits_for_its_photographs() -> None:
    assert settings(minutes=30.0, speed='0.1').patience_s > 300.0


def settings(*, minutes: float, speed: str = 'max') -> DemoSettings:
    return DemoSettings(
        minutes=minutes,
        speed=speed,
        seed=7,
        costa=True,
        preset='upwind',
        photo_width=1600,
        page='',
    )
