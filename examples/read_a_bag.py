"""Read the sample bag: its topics, the rates of the pumps, the tracer and the forecast errors.

`open_recording` returns the experiment in a bag or a folder. `BagReader` reads any topic, here the
reports of the hub. Neither needs ROS.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from picture import picture_path

from porotwin_core.basis.units import to_ml_h
from porotwin_recording.experiment.recording import open_recording
from porotwin_recording.mcap.bag_reader import BagReader

BAG = Path(__file__).parents[1] / 'bags' / 'sample'

bag = BagReader(BAG)
for name, topic in sorted(bag.topics.items()):
    print(f'{topic.message_count:4d}  {name}  ({topic.type_name})')
reports = [bag.decode(message) for message in bag.messages(['/porotwin/hub/cycle'])]

recording = open_recording(BAG)
rig, grid, times = recording.rig, recording.grid, recording.times
pore_volume = rig.cell_pore_volume(grid)
assert recording.maps is not None
tracer_ml = np.array(
    [1e6 * (values * pore_volume)[values > 0.05].sum() for values in recording.maps]
)  # the noise of clear water does not count
injected_ml = to_ml_h(recording.schedule.at(0.0)['injector'].rate) * times / 3600
assert recording.measured is not None
commanded, measured = (
    to_ml_h(schedule.at(0.0)['producer'].rate)
    for schedule in (recording.schedule, recording.measured)
)
print(f'producer: {commanded:.0f} ml/h commanded, {measured:.0f} ml/h measured; ', end='')
print(f'{tracer_ml[-1]:.1f} ml of tracer seen after {times[-1]:.0f} s')
assert len(reports) == len(times) == 13
assert abs(tracer_ml[-1] - injected_ml[-1]) < 0.05 * injected_ml[-1]

figure, axes = plt.subplots(1, 3, figsize=(11, 3), layout='constrained')
for well, marker in {'injector': 'o', 'control1': 'x', 'producer': 's'}.items():
    asked, delivered = (
        [to_ml_h(schedule.at(time)[well].rate) for time in times]
        for schedule in (recording.schedule, recording.measured)
    )
    (line,) = axes[0].plot(times, asked, linewidth=4, alpha=0.3)
    axes[0].plot(times, delivered, marker, color=line.get_color(), markersize=4, label=well)
axes[0].set(title='rates (marks: measured)', ylabel='rate [ml/h]')
axes[1].plot(times, injected_ml, '--', label='injected')
axes[1].plot(times, tracer_ml, 'o', markersize=4, label='in the maps')
axes[1].set(title='tracer', ylabel='volume [ml]')
axes[2].plot(times, [report.prediction_error for report in reports], 'o-', label='hub/cycle')
axes[2].set(title='forecasts of the next map', ylabel='relative error [-]', ylim=(0, None))
for axis in axes:
    axis.set_xlabel('time [s]')
    axis.legend()
figure.savefig(picture_path(__file__), dpi=80)
