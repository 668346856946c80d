"""Small experiments and bags that several tests share."""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import Boundaries, Camera, Control, FixedWell, Rig, Well
from porotwin_recording.mcap.bag_reader import BagReader
from porotwin_recording.mcap.bag_records import TopicQos
from porotwin_recording.mcap.bag_writer import BagWriter
from porotwin_recording.mcap.serialization import SECOND, Serializer, message_type
from porotwin_recording.tables.concentration import ConcentrationMaps
from porotwin_recording.tables.photos import Photo
from porotwin_recording.tables.recorded_data import RecordedData

STRING = 'std_msgs/msg/String'
SHARED = Path(__file__).resolve().parents[2].parent / 'shared'

SCHEDULE = Schedule(
    (
        ScheduleRow(0.0, 'in', WellRate(from_ml_h(523.2), 1.0)),
        ScheduleRow(0.0, 'out', WellRate(from_ml_h(-463.2))),
        ScheduleRow(61.7, 'in', WellRate(0.0, 1.0)),
    )
)


def bench_rig() -> Rig:
    """Return a small rig with a camera."""
    return Rig(
        name='bench',
        width_m=0.4,
        height_m=0.3,
        depth_m=0.01,
        porosity=0.375,
        permeability_m2=6.57e-10,
        viscosity_pa_s=1e-3,
        density_kg_m3=998.0,
        boundaries=Boundaries(top='closed'),
        wells={'in': Well(x_m=0.1, z_m=0.1), 'out': Well(x_m=0.3, z_m=0.2)},
        camera=Camera(corners_px=((1, 2), (1, 90), (120, 91), (121, 2))),
    )


def controlled_rig() -> Rig:
    """Return a small rig with a control well and a disallowed zone."""
    return bench_rig().model_copy(
        update={
            'boundaries': Boundaries(),
            'camera': None,
            'wells': {
                'in': Well(x_m=0.1, z_m=0.1),
                'out': Well(x_m=0.3, z_m=0.2),
                'water': Well(x_m=0.2, z_m=0.2, radius_m=0.003),
            },
            'control': Control(
                wells=('water',),
                producer='out',
                fixed={'in': FixedWell(rate_ml_h=523.2, concentration=1.0)},
                disallowed_zone_m=((0.3, 0.1), (0.4, 0.1), (0.4, 0.3)),
            ),
        }
    )


def random_maps(rig: Rig, frames: int = 5) -> ConcentrationMaps:
    """Return random maps on 8 x 6 cells, one every 30.1 s, with two unseen cells in the second."""
    grid = rig.grid(8, 6)
    values = np.random.default_rng(731).random((frames, *grid.shape), dtype=np.float32)
    values[1, 2:4, 3] = np.nan
    return ConcentrationMaps(np.arange(frames) * 30.1, grid, lambda start, stop: values[start:stop])


def two_photos() -> tuple[Photo, ...]:
    """Return a baseline and a state photograph."""
    return (
        Photo(-30.0, 'baseline', 'photos/first.jpg', lambda: b'\xff\xd8 baseline'),
        Photo(0.1 + 0.2, 'state', 'photos/second.jpg', lambda: b'\xff\xd8 state \x00\n'),
    )


def bench_experiment() -> RecordedData:
    """Return an experiment with commanded rates, maps and photographs."""
    rig = bench_rig()
    return RecordedData(rig, commanded=SCHEDULE, maps=random_maps(rig), photos=two_photos())


def write_string_bag(
    path: Path, names: list[str], *, latched: tuple[str, ...] = (), count: int = 10
) -> BagReader:
    """Write `count` messages on every topic of `names`, one per second, and open the bag."""
    with BagWriter(path) as bag:
        add_string_topics(bag, names, latched=latched)
        for number in range(count):
            for name in names:
                bag.write(name, b'%d' % number, log_time=number * SECOND)
    return BagReader(path)


def add_string_topics(bag: BagWriter, names: list[str], *, latched: tuple[str, ...] = ()) -> None:
    """Add topics of strings to a bag."""
    for name in names:
        durability = 'transient_local' if name in latched else 'volatile'
        bag.add_topic(name, STRING, qos=TopicQos(durability=durability))


def write_live_bag(path: Path, messages: list[tuple[str, object]]) -> None:
    """Write (topic, message) pairs as a live recorder does, one per second of its clock."""
    serializer = Serializer()
    with BagWriter(path) as bag:
        for number, (topic, message) in enumerate(messages):
            bag.add_topic(topic, message_type(message))
            bag.write(topic, serializer.to_cdr(message), log_time=(7000 + number) * SECOND)


def eventually(condition: Callable[[], bool], timeout_s: float = 60.0) -> bool:
    """Return whether `condition` becomes true within `timeout_s`."""
    deadline = time.monotonic() + timeout_s
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.02)
    return condition()
