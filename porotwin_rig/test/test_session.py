"""The asset in a closed loop: commands, their limits and their expiry."""

import pytest
from rig_examples import make_rig, rates

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import to_ml_h
from porotwin_core.rates.safe_rates import safe_rates
from porotwin_core.rates.wells import WellRate
from porotwin_rig.camera import camera_before
from porotwin_rig.limits import refuse_broken_limits
from porotwin_rig.pumps import Pumps
from porotwin_rig.render import Photographer
from porotwin_rig.session import AssetSession
from porotwin_rig.virtual_rig import VirtualRig

TOO_MUCH = rates(injector=(500.0, 1.0), control1=300.0, control2=201.0, producer=-1001.0)
GOOD = rates(injector=(500.0, 1.0), control1=200.0, producer=-700.0)


def session(
    pumps: Pumps | None = None, pauses: tuple[tuple[float, float], ...] = ()
) -> AssetSession:
    rig = make_rig()
    assert rig.control is not None
    control = rig.control.with_pauses({'injector': pauses}, None)
    rig = rig.model_copy(update={'control': control})
    camera = camera_before(rig, 160, 100)
    asset = VirtualRig(rig, cell=0.02, pumps=pumps)
    return AssetSession(asset, Photographer(rig, camera=camera, seed=3), photo_interval=30.0)


def ml_h(measured: dict[str, WellRate]) -> dict[str, float]:
    return {name: round(to_ml_h(well.rate), 6) for name, well in measured.items() if well.rate}


def test_asset_begins_with_safe_rates() -> None:
    assert ml_h(session().advance()) == {'injector': 500.0, 'producer': -500.0}


def test_an_experiment_may_begin_with_a_plume_of_the_safe_rates() -> None:
    asset = session()
    asset.advance_with_safe_rates(90.0)
    assert asset.time == 90.0
    grid = asset.asset.rig.grid(30, 18)
    pore_volume = asset.asset.rig.porosity * asset.asset.rig.depth_m * grid.cell_area
    tracer = asset.asset.concentration(grid).sum() * pore_volume
    assert tracer == pytest.approx(500e-6 / 3600 * 90.0, rel=0.02)
    asset.advance_with_safe_rates(30.0)  # that time is over
    assert asset.time == 90.0


def test_command_is_pumped_and_measured_with_the_pumps_faults() -> None:
    asset = session(Pumps({'producer': 0.99}))
    asset.command(GOOD, valid_until=90.0)
    assert ml_h(asset.advance()) == {'injector': 500.0, 'control1': 200.0, 'producer': -693.0}


def test_expired_command_gives_way_to_safe_rates_at_its_time() -> None:
    asset = session()
    asset.command(GOOD, valid_until=45.0)
    asset.advance()
    # half of the second interval with the command, half without
    assert ml_h(asset.advance()) == {'injector': 500.0, 'control1': 100.0, 'producer': -600.0}
    assert ml_h(asset.advance()) == {'injector': 500.0, 'producer': -500.0}


def test_pumps_make_the_announced_pauses_that_setpoints_do_not_know() -> None:
    asset = session(pauses=((0.25, 0.75),))
    asset.command(GOOD, valid_until=30.0)
    # from 15 to 30 s with the command, from 30 to 45 s with the safe rates, the injector rests
    assert ml_h(asset.advance()) == {'injector': 250.0, 'control1': 200.0, 'producer': -450.0}
    assert ml_h(asset.advance()) == {'injector': 250.0, 'producer': -250.0}
    assert ml_h(asset.advance()) == {'injector': 500.0, 'producer': -500.0}
    early = session(pauses=((0.25, 0.75),))
    early.advance_with_safe_rates(45.0)
    assert early.asset.time == 45.0
    assert ml_h(early.asset.measured_rates()) == {}


def test_command_that_has_expired_is_refused() -> None:
    asset = session()
    asset.advance()
    with pytest.raises(InputError, match='valid until'):
        asset.command(GOOD, valid_until=20.0)


@pytest.mark.parametrize(
    ('wrong', 'complaint'),
    [
        (rates(injector=(500.0, 1.0), nowhere=10.0, producer=-510.0), 'nowhere'),
        (rates(injector=(500.0, 1.0), control1=501.0, producer=-1001.0), "'control1'"),
        (rates(injector=(500.0, 1.0), control1=-5.0, producer=-495.0), "'control1'"),
        (
            rates(injector=(500.0, 1.0), control1=300.0, control2=201.0, producer=-1001.0),
            'together',
        ),
        (rates(injector=(400.0, 1.0), producer=-400.0), 'must stay'),
        (rates(injector=(500.0, 1.0), control1=100.0, producer=-500.0), 'balance'),
        (rates(injector=(500.0, 0.0), producer=-500.0), 'concentration 0, must be 1'),
        (
            rates(injector=(500.0, 1.0), control1=(9.0, 1.0), producer=-509.0),
            'concentration 1, must be 0',
        ),
    ],
)
def test_limits_of_the_rig_are_kept(wrong: dict[str, WellRate], complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        session().command(wrong, valid_until=60.0)


def test_a_well_without_a_role_stays_shut_even_where_the_rig_is_open() -> None:
    control = {
        'wells': ('control1',),
        'fixed': {'injector': {'rate_ml_h': 500.0, 'concentration': 1.0}},
        'disallowed_zone_m': ((0.0, 0.4), (0.9, 0.4), (0.9, 0.5)),
    }
    rig = make_rig(control=control)
    with pytest.raises(InputError, match='no role'):
        refuse_broken_limits(rig, rates(injector=(500.0, 1.0), control2=1e6))
    refuse_broken_limits(rig, rates(injector=(500.0, 1.0), control1=100.0))


def test_safe_rates_keep_the_limits() -> None:
    rig = make_rig()
    refuse_broken_limits(rig, safe_rates(rig))
    uncontrolled = make_rig(control=None)
    assert all(well.rate == 0.0 for well in safe_rates(uncontrolled).values())
    refuse_broken_limits(uncontrolled, rates(injector=(2000.0, 1.0)))


def test_photographs_follow_the_experiment() -> None:
    asset = session()
    baseline, first = asset.baseline(), asset.photograph()
    for _ in range(10):
        asset.advance()
    assert asset.time == pytest.approx(300.0)
    assert len({baseline, first, asset.photograph()}) == 3
