"""Folder to bag and back: not a frame, a rate or a photograph is lost or changed."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from porotwin_core.conversions import rates_to_msg, rig_to_msg
from porotwin_core.errors import InputError
from porotwin_core.rig import Control, FixedWell, Rig, Well, write_rig
from porotwin_core.units import from_ml_h
from porotwin_core.wells import Schedule, ScheduleRow, WellRate
from porotwin_msgs.msg import CleanState, NewState, Setpoint, WellRates
from porotwin_recording.bag_reader import BagReader
from porotwin_recording.bag_writer import BagWriter
from porotwin_recording.concentration import ConcentrationMaps, ConcentrationWriter
from porotwin_recording.convert import export_bag, import_experiment
from porotwin_recording.experiment import write_experiment
from porotwin_recording.photos import Photo
from porotwin_recording.recording import Recording, open_recording
from porotwin_recording.serialization import Serializer, message_type

SHARED = Path(__file__).resolve().parents[2].parent / 'shared'
SECOND = 1_000_000_000


def make_rig() -> Rig:
    return Rig(
        name='bench',
        width_m=0.4,
        height_m=0.3,
        depth_m=0.01,
        porosity=0.375,
        permeability_m2=6.57e-10,
        viscosity_pa_s=1e-3,
        density_kg_m3=998.0,
        wells={
            'in': Well(x_m=0.1, z_m=0.1),
            'out': Well(x_m=0.3, z_m=0.2),
            'water': Well(x_m=0.2, z_m=0.2, radius_m=0.003),
        },
        control=Control(
            wells=('water',),
            producer='out',
            fixed={'in': FixedWell(rate_ml_h=523.2, concentration=1.0)},
            disallowed_zone_m=((0.3, 0.1), (0.4, 0.1), (0.4, 0.3)),
        ),
    )


def changes(schedule: Schedule | None) -> Schedule | None:
    """Return the schedule without rows that tell a well what it does already."""
    if schedule is None:
        return None
    rates: dict[str, WellRate] = {}
    kept = []
    for row in schedule.rows:
        if rates.get(row.well) != row.rate:
            kept.append(row)
            rates[row.well] = row.rate
    return Schedule(tuple(kept))


def assert_same(back: Recording, original: Recording) -> None:
    assert back.rig.model_dump(exclude={'depth_m', 'porosity', 'permeability_m2'}) == (
        original.rig.model_dump(exclude={'depth_m', 'porosity', 'permeability_m2'})
    )
    for quantity in ('depth_m', 'porosity', 'permeability_m2'):
        np.testing.assert_array_equal(
            back.rig.nominal_map(quantity), original.rig.nominal_map(quantity)
        )
    assert changes(back.told) == changes(original.told)
    assert changes(back.measured) == changes(original.measured)
    assert (back.maps is None) == (original.maps is None)
    if original.maps is not None:
        assert back.grid == original.grid
        assert back.times.tobytes() == original.times.tobytes()
        assert back.concentration.tobytes() == original.concentration.tobytes()
        np.testing.assert_array_equal(list(back.maps), original.concentration)
    assert [(photo.time, photo.role, photo.read()) for photo in back.photos] == [
        (photo.time, photo.role, photo.read()) for photo in original.photos
    ]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    rig = make_rig()
    grid = rig.grid(8, 6)
    frames = np.random.default_rng(731).random((40, *grid.shape), dtype=np.float32)
    frames[3, :2] = np.nan
    told = Schedule(
        (
            ScheduleRow(0.0, 'in', WellRate(from_ml_h(523.2), 1.0)),
            ScheduleRow(0.0, 'out', WellRate(from_ml_h(-463.2))),
            ScheduleRow(61.7, 'water', WellRate(from_ml_h(0.1), 0.0)),
            ScheduleRow(61.7, 'in', WellRate(0.0, 1.0)),
        )
    )
    measured = Schedule((ScheduleRow(0.0, 'out', WellRate(-1.2868055555e-07)),))
    write_experiment(
        tmp_path / 'experiment',
        rig=rig,
        told=told,
        measured=measured,
        maps=ConcentrationMaps(
            np.round(np.arange(40) * 0.7 + 1 / 3, 9), grid, lambda start, stop: frames[start:stop]
        ),
        photos=(
            Photo(-30.0, 'baseline', 'photos/a.jpg', lambda: b'\xff\xd8 one'),
            Photo(-30.0, 'baseline', 'photos/b.jpg', lambda: b'\xff\xd8 two'),
            Photo(0.3, 'state', 'photos/c.png', lambda: b'\x89PNG\x00 three'),
        ),
    )
    return tmp_path / 'experiment'


@pytest.mark.parametrize('name', ['run', 'run.mcap'])
def test_an_experiment_survives_the_way_through_a_bag(
    folder: Path, tmp_path: Path, name: str
) -> None:
    original = open_recording(folder)
    import_experiment(folder, tmp_path / name)
    assert_same(open_recording(tmp_path / name), original)
    export_bag(tmp_path / name, tmp_path / 'back')
    assert_same(open_recording(tmp_path / 'back'), original)
    assert {path.suffix for path in (tmp_path / 'back' / 'photos').iterdir()} == {'.jpg', '.png'}


def test_importing_twice_gives_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    for name in ('one.mcap', 'two.mcap'):
        import_experiment(folder, tmp_path / name)
    assert (tmp_path / 'one.mcap').read_bytes() == (tmp_path / 'two.mcap').read_bytes()


def test_progress_counts_every_map_and_photograph(folder: Path, tmp_path: Path) -> None:
    for convert, source, target in (
        (import_experiment, folder, tmp_path / 'run'),
        (export_bag, tmp_path / 'run', tmp_path / 'back'),
    ):
        steps: list[tuple[int, int]] = []
        convert(source, target, progress=lambda *step, steps=steps: steps.append(step))
        assert steps[-1] == (43, 43)
        assert [done for done, _ in steps] == sorted(done for done, _ in steps)


@pytest.mark.parametrize('name', ['run', 'run.mcap'])
def test_an_import_that_stops_half_way_leaves_nothing(
    folder: Path, tmp_path: Path, name: str
) -> None:
    photo = folder / 'photos' / 'c.png'
    content = photo.read_bytes()

    def lose_the_photograph(*_: int) -> None:
        photo.unlink(missing_ok=True)

    with pytest.raises(FileNotFoundError):
        import_experiment(folder, tmp_path / name, progress=lose_the_photograph)
    assert [path.name for path in tmp_path.iterdir()] == ['experiment']
    photo.write_bytes(content)
    import_experiment(folder, tmp_path / name)
    assert_same(open_recording(tmp_path / name), open_recording(folder))


def test_an_export_that_stops_half_way_leaves_nothing(folder: Path, tmp_path: Path) -> None:
    import_experiment(folder, tmp_path / 'run')

    def stop(done: int, _: int) -> None:
        if done == 20:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        export_bag(tmp_path / 'run', tmp_path / 'back', progress=stop)
    assert sorted(path.name for path in tmp_path.iterdir()) == ['experiment', 'run']
    export_bag(tmp_path / 'run', tmp_path / 'back')
    assert_same(open_recording(tmp_path / 'back'), open_recording(folder))


def test_nothing_is_overwritten(folder: Path, tmp_path: Path) -> None:
    import_experiment(folder, tmp_path / 'run')
    with pytest.raises(InputError, match='run: exists already'):
        import_experiment(folder, tmp_path / 'run')
    with pytest.raises(InputError, match='experiment: exists already'):
        export_bag(tmp_path / 'run', folder)


def well_rate(rate: float, concentration: float) -> WellRate:
    return WellRate(rate, 0.0 if rate < 0 else concentration)


well_rates = st.dictionaries(
    st.sampled_from(['in', 'out', 'water']),
    st.builds(well_rate, st.floats(-1e-6, 1e-6), st.floats(0, 1)),
    min_size=1,
)


@given(
    told=st.lists(
        st.tuples(st.integers(0, 9 * 10**15).map(lambda ns: ns / 1e9), well_rates), max_size=6
    )
)
@settings(max_examples=20)
def test_any_schedule_pumps_the_same_after_the_way_through_a_bag(
    tmp_path_factory: pytest.TempPathFactory, told: list
) -> None:
    base = tmp_path_factory.mktemp('schedule')
    rows = (ScheduleRow(time, well, rate) for time, rates in told for well, rate in rates.items())
    schedule = Schedule(tuple(rows))
    write_experiment(base / 'experiment', rig=make_rig(), told=schedule)
    original = open_recording(base / 'experiment').schedule
    import_experiment(base / 'experiment', base / 'run.mcap')
    recording = open_recording(base / 'run.mcap')
    if not told:
        assert recording.told is None
        return
    for time in {row.time for row in schedule.rows}:
        assert recording.schedule.at(time) == original.at(time)
    assert set(recording.schedule.wells) == set(original.wells)


@pytest.mark.skipif(not SHARED.is_dir(), reason='the shared recordings are not beside the checkout')
@pytest.mark.parametrize('case', ['cases/case_001', 'cases/case_014', 'data/fluidflower_tracer'])
def test_shared_recordings_survive_the_way_through_a_bag(tmp_path: Path, case: str) -> None:
    original = open_recording(SHARED / case)
    import_experiment(SHARED / case, tmp_path / 'run')
    assert_same(open_recording(tmp_path / 'run'), original)
    export_bag(tmp_path / 'run', tmp_path / 'back')
    assert_same(open_recording(tmp_path / 'back'), original)


def stamped(message: object, stamp: int) -> object:
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, SECOND)
    return message


def write_live_bag(path: Path, messages: list[tuple[str, object]]) -> None:
    """Write messages as a recorder would have seen them, a second of wall clock apart."""
    serializer = Serializer()
    with BagWriter(path) as bag:
        for number, (topic, message) in enumerate(messages):
            bag.add_topic(topic, message_type(message))
            bag.write(topic, serializer.to_cdr(message), log_time=(7000 + number) * SECOND)


def state(stamp: int, value: float) -> NewState:
    message = stamped(NewState(), stamp)
    message.tracer.grid.nx = message.tracer.grid.nz = 2
    message.tracer.grid.width, message.tracer.grid.height = 0.4, 0.3
    message.tracer.concentration = [value] * 4
    return message


def test_a_live_bag_counts_time_from_its_clean_start(tmp_path: Path) -> None:
    begin = 50 * SECOND
    start = stamped(CleanState(cause=CleanState.START), begin)
    setpoint = stamped(Setpoint(wells=rates_to_msg({'in': WellRate(1e-7, 1.0)})), begin - SECOND)
    measured = WellRates(wells=rates_to_msg({'in': WellRate(0.9e-7, 1.0)}))
    measured.start.sec = 50
    write_live_bag(
        tmp_path / 'run.mcap',
        [
            ('/lab/rig/description', rig_to_msg(make_rig())),
            ('/lab/wells/setpoint', setpoint),
            ('/lab/asset/clean_state', start),
            ('/lab/asset/new_state', state(begin, 0.0)),
            ('/lab/asset/new_state', state(begin + 2 * SECOND, 0.5)),
            ('/lab/wells/measured', stamped(measured, begin + 2 * SECOND)),
            ('/lab/asset/new_state', state(begin + SECOND, 0.25)),
            ('/lab/asset/new_state', state(begin + 2 * SECOND, 0.75)),
        ],
    )
    recording = open_recording(tmp_path / 'run.mcap')
    assert recording.times.tolist() == [0.0, 1.0, 2.0]
    assert recording.concentration[:, 0, 0].tolist() == [0.0, 0.25, 0.75]
    assert recording.schedule.rows == (ScheduleRow(0.0, 'in', WellRate(1e-7, 1.0)),)
    assert recording.measured == Schedule((ScheduleRow(0.0, 'in', WellRate(0.9e-7, 1.0)),))


def test_only_the_first_of_two_experiments_is_read(tmp_path: Path) -> None:
    messages = [('/lab/rig/description', rig_to_msg(make_rig()))]
    for value in (0.25, 0.75):
        messages += [
            ('/lab/asset/clean_state', stamped(CleanState(cause=CleanState.START), SECOND)),
            ('/lab/asset/new_state', state(SECOND, value)),
            ('/lab/asset/new_state', state(2 * SECOND, value)),
        ]
    write_live_bag(tmp_path / 'run.mcap', messages)
    recording = open_recording(tmp_path / 'run.mcap')
    assert recording.concentration[:, 0, 0].tolist() == [0.25, 0.25]
    assert 'a second experiment' in recording.remarks[0]


def test_a_bag_cut_off_gives_the_experiment_so_far(folder: Path, tmp_path: Path) -> None:
    original = open_recording(folder)
    bag = tmp_path / 'run.mcap'
    whole = tmp_path / 'whole.mcap'
    import_experiment(folder, whole)
    with BagWriter(bag, compress=False) as writer:
        for message in (reader := BagReader(whole)).messages():
            topic = reader.topics[message.topic]
            writer.add_topic(topic.name, topic.type_name, definition=topic.definition)
            writer.write(topic.name, message.data, log_time=message.log_time)
            writer.flush()
    content = bag.read_bytes()
    bag.write_bytes(content[: len(content) // 2])
    recording = open_recording(bag)
    frames = len(recording.times)
    assert 0 < frames < 40
    assert recording.concentration.tobytes() == original.concentration[:frames].tobytes()
    assert 'has no end' in recording.remarks[0]


def test_a_bag_without_a_rig_asks_for_one(folder: Path, tmp_path: Path) -> None:
    write_live_bag(tmp_path / 'run.mcap', [('/lab/asset/new_state', state(SECOND, 0.5))])
    with pytest.raises(InputError, match=r'holds no rig description; name its rig\.yaml'):
        open_recording(tmp_path / 'run.mcap')
    assert open_recording(tmp_path / 'run.mcap', rig=folder).times.tolist() == [0.0]
    other = make_rig().model_copy(update={'width_m': 0.9})
    with pytest.raises(InputError, match=r'maps cover 0.4 x 0.3 m, the rig 0.9 x 0.3 m'):
        open_recording(tmp_path / 'run.mcap', rig=other)


def test_a_bag_of_something_else_is_named(tmp_path: Path) -> None:
    from std_msgs.msg import String

    write_live_bag(tmp_path / 'run.mcap', [('/chatter', String(data='hello'))])
    with pytest.raises(InputError, match='holds no topic of a PoroTwin experiment'):
        open_recording(tmp_path / 'run.mcap')


def test_a_bag_of_two_rigs_is_named(tmp_path: Path) -> None:
    write_live_bag(
        tmp_path / 'run.mcap',
        [('/a/asset/new_state', state(SECOND, 0.5)), ('/b/asset/new_state', state(SECOND, 0.5))],
    )
    with pytest.raises(InputError, match='holds two rigs'):
        open_recording(tmp_path / 'run.mcap')


def test_a_bag_with_an_unknown_well_is_named(tmp_path: Path) -> None:
    rates = rates_to_msg({'inn': WellRate(1e-7, 1.0)})
    write_live_bag(
        tmp_path / 'run.mcap',
        [
            ('/lab/rig/description', rig_to_msg(make_rig())),
            ('/lab/wells/setpoint', stamped(Setpoint(wells=rates), SECOND)),
        ],
    )
    with pytest.raises(InputError, match="unknown well 'inn'; the rig has in, out, water"):
        open_recording(tmp_path / 'run.mcap')


def measured(stamp: int, well: str, rate: float) -> WellRates:
    message = stamped(WellRates(wells=rates_to_msg({well: WellRate(1e-7)})), stamp)
    message.start = message.header.stamp
    message.wells[0].rate = rate
    return message


def test_rates_that_the_hub_ignored_are_left_out(tmp_path: Path) -> None:
    write_live_bag(
        tmp_path / 'run.mcap',
        [
            ('/lab/rig/description', rig_to_msg(make_rig())),
            ('/lab/asset/clean_state', stamped(CleanState(cause=CleanState.START), SECOND)),
            ('/lab/wells/measured', measured(SECOND, 'in', 1e-7)),
            ('/lab/wells/measured', measured(2 * SECOND, 'in', float('nan'))),
            ('/lab/wells/measured', measured(3 * SECOND, 'inn', 2e-7)),
            ('/lab/wells/measured', measured(4 * SECOND, 'in', 3e-7)),
            ('/lab/asset/new_state', state(4 * SECOND, 0.5)),
        ],
    )
    recording = open_recording(tmp_path / 'run.mcap')
    assert recording.measured is not None
    assert [(row.time, row.rate.rate) for row in recording.measured.rows] == [(0, 1e-7), (3, 3e-7)]
    assert len(recording.remarks) == 1
    assert "2 messages of rates left out: well 'in': well rate nan" in recording.remarks[0]


def test_an_odd_rig_description_is_named_and_a_rig_yaml_takes_its_place(
    folder: Path, tmp_path: Path
) -> None:
    description = rig_to_msg(make_rig())
    description.wells[0].radius = -1.0
    write_live_bag(
        tmp_path / 'run.mcap',
        [('/lab/rig/description', description), ('/lab/asset/new_state', state(SECOND, 0.5))],
    )
    with pytest.raises(InputError, match=r'wells\.in\.radius_m = -1\.0.*name its rig\.yaml'):
        open_recording(tmp_path / 'run.mcap')
    assert open_recording(tmp_path / 'run.mcap', rig=folder).times.tolist() == [0.0]


def test_packed_maps_come_back_as_the_same_values(tmp_path: Path) -> None:
    rig = make_rig()
    grid = rig.grid(8, 6)
    (tmp_path / 'packed').mkdir()
    write_rig(rig, tmp_path / 'packed' / 'rig.yaml')
    with ConcentrationWriter(tmp_path / 'packed' / 'concentration.nc', grid, packed=True) as nc:
        nc.append(0.0, np.linspace(0, 1, 48).reshape(grid.shape))
    import_experiment(tmp_path / 'packed', tmp_path / 'run')
    assert_same(open_recording(tmp_path / 'run'), open_recording(tmp_path / 'packed'))
