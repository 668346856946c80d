"""The figures and pictures of a demo whose rig had a hidden effect, and whose twin found it."""

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use('Agg')

import matplotlib.pyplot as plt
import numpy as np

from porotwin_cli.pictures.rig_drawing import draw_map, percent_scale
from porotwin_cli.recorded.run_account import TrueTracer, read_account
from porotwin_cli.running.hidden_effect import as_text
from porotwin_cli.running.loop_operator import Operator
from porotwin_cli.running.loop_rig import LoopSettings, map_eyes
from porotwin_cli.running.loop_run import LoopFigures, planning_twin, run_closed
from porotwin_cli.running.loop_scenario import PRODUCER_DELIVERY, LoopScenario, PumpFault
from porotwin_cli.running.rehearsal import producer_of
from porotwin_cli.terminal import say
from porotwin_core.basis.errors import writing
from porotwin_core.basis.parallel import crew
from porotwin_core.basis.units import MINUTE_S, ML
from porotwin_core.geometry.grid import FloatArray, relative_error
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import EffectDescription, Rig
from porotwin_core.rig.rig_on_axes import DOTS_PER_INCH
from porotwin_core.ros.from_messages import effects_from_msg, rates_from_msg, time_from_msg
from porotwin_hub.launching.graph import NAMESPACE
from porotwin_recording.mcap.bag_reader import BagReader
from porotwin_recording.tables.concentration import open_maps
from porotwin_solver.effects import EFFECTS
from porotwin_solver.model.model import Model
from porotwin_solver.service.effects_in_force import in_words

FORECAST_S = 900.0
"""Length of the forecasts that are compared [s]: the plume moves by some centimetres."""

Effects = tuple[EffectDescription, ...]


@dataclass
class Mending:
    """The decisions about the model in a run, by time [s], and the rates that were pumped."""

    changes: list[tuple[float, Effects]] = field(default_factory=list)
    offers: list[dict[str, Any]] = field(default_factory=list)
    rates: list[tuple[float, Any]] = field(default_factory=list)

    @property
    def accepted(self) -> float:
        """Time when the first effect began to act [s]; NaN if none was accepted."""
        return next((time for time, effects in self.changes if effects), math.nan)

    @property
    def last(self) -> Effects:
        """The effects in force at the end."""
        return self.changes[-1][1] if self.changes else ()


def read_mending(bag: Path) -> Mending:
    """Return the decisions about the model in a bag of the demo.

    Raises:
        InputError: the bag cannot be read.
    """
    found = Mending()
    reader = BagReader(bag)
    topics = {f'{NAMESPACE}/{name}' for name in ('model/effects', 'mend/offer', 'wells/measured')}
    for raw in reader.messages(topics & reader.topics.keys()):
        message = reader.decode(raw)
        stamp = time_from_msg(message.header.stamp)
        if raw.topic.endswith('model/effects'):
            found.changes.append((stamp, effects_from_msg(message.effects)))
        elif raw.topic.endswith('mend/offer'):
            found.offers.append(
                {
                    'minute': round(stamp / MINUTE_S, 1),
                    'state': int(message.state),
                    'sentence': message.sentence,
                    'confidence': round(float(message.confidence), 3),
                }
            )
        else:
            start = time_from_msg(message.start)
            found.rates.append((start, rates_from_msg(message.wells)))
    return found


def mended_figures(
    rig: Rig, folder: Path, hidden: EffectDescription, preset: str
) -> dict[str, Any]:
    """Return the figures of a run with a hidden effect, and draw its pictures into `folder`.

    Raises:
        InputError: the bag or the true maps cannot be read.
    """
    mending = read_mending(folder / 'bag')
    maps = open_maps(folder / 'truth.nc', rig)
    truth = TrueTracer(maps.times, maps.grid, maps)
    say('the same experiment with a twin that knew, and with one that never finds out ...')
    beside = runs_beside(rig, hidden, truth, preset)
    forecasts = forecast_errors(rig, truth, mending, hidden, preset)
    figures = {
        'hidden_effect': as_text(hidden),
        'hidden_in_words': in_words((hidden,)) if hidden.name in EFFECTS else as_text(hidden),
        'found': [as_text(effect) for effect in mending.last],
        'found_in_words': in_words(mending.last),
        'verdict_minute': mending.accepted / MINUTE_S,
        'offers': mending.offers,
        'forecast_error': forecasts,
        'dose_ml_min_never_told': beside['never told'].dose_ml_min,
        'dose_ml_min_knew': beside['knew'].dose_ml_min if 'knew' in beside else math.nan,
        'mended_picture': folder / 'mended.png',
    }
    _picture(folder / 'mended.png', rig, folder, truth, mending, beside)
    if mending.last:
        _forecast_picture(folder / 'forecast.png', rig, truth, mending, hidden, preset)
    (folder / 'mended.json').write_text(json.dumps(figures, indent=1, default=str))
    return figures


def mending_lines(figures: Mapping[str, Any]) -> Iterator[str]:
    """Yield lines for a person: the hidden effect, the found one, and the gain.

    `figures` come from `mended_figures`.
    """
    yield f'hidden effect: {figures["hidden_in_words"]}'
    minute = figures['verdict_minute']
    if figures['found']:
        yield f'found at minute {minute:.0f}, accepted and kept: {figures["found_in_words"]}'
    elif math.isnan(minute):
        yield 'no offer was accepted, so that the model stayed as described'
    else:
        yield (
            f'an effect was accepted at minute {minute:.0f} and taken back, because the next '
            'photographs contradicted it'
        )
    if not figures['found']:
        yield 'forecast.png is not drawn: no mended model is left to compare'
    told = {'as described': 'as described', 'mended': 'mended', 'knew': 'with the true effect'}
    errors = ', '.join(
        f'{100.0 * error:.1f} % {told[name]}'
        for name, error in figures['forecast_error'].items()
        if figures['found'] or name != 'mended'
    )
    yield f'forecasts over {FORECAST_S / MINUTE_S:g} min err by {errors} (medians)'
    doses = [f'{figures["dose_ml_min"]:.0f} ml min with this twin']
    doses.append(f'{figures["dose_ml_min_never_told"]:.0f} with one that never mends')
    if not math.isnan(figures['dose_ml_min_knew']):
        doses.append(f'{figures["dose_ml_min_knew"]:.0f} with one that knew the effect')
    yield f'dose in the zone: {", ".join(doses)}'


# --- the runs beside ------------------------------------------------------------------------------


def runs_beside(
    rig: Rig, hidden: EffectDescription, truth: TrueTracer, preset: str
) -> dict[str, LoopFigures]:
    """Return the runs of twins that are never told, and that knew from the start.

    They see maps with the noise of an image analysis instead of photographs, which is quicker. A
    twin cannot know an effect that the solver lacks.
    """
    scenario = scenario_of(
        rig, (hidden,), float(truth.times[0]), float(truth.times[-1]), _interval(truth)
    )
    settings = LoopSettings(preset=preset)
    known = {'never told': scenario.rig}
    if hidden.name in EFFECTS:
        known['knew'] = scenario.rig.with_effects([hidden])
    with crew() as pool:
        jobs = {
            name: pool.submit(run_beside, scenario, settings, described)
            for name, described in known.items()
        }
        return {name: job.result() for name, job in jobs.items()}


def run_beside(scenario: LoopScenario, settings: LoopSettings, described: Rig) -> LoopFigures:
    """Return the run of a twin that takes the rig for the `described` one."""
    return run_closed(
        scenario,
        settings,
        map_eyes(scenario, settings),
        lambda real, how: planning_twin(replace(real, rig=described), how),
    )


def scenario_of(
    rig: Rig, effects: Effects, start: float, end: float, interval: float
) -> LoopScenario:
    """Return the experiment of the demo with hidden `effects`, under control from `start` [s]."""
    producer = producer_of(rig)
    return LoopScenario(
        name='demo',
        rig=rig,
        effects=effects,
        faults=() if producer is None else (PumpFault(producer, PRODUCER_DELIVERY),),
        meters=True,
        operator=Operator(),
        start=start,
        end=end,
        photo_interval=interval,
        seed=7,
    )


def _interval(truth: TrueTracer) -> float:
    return float(truth.times[1] - truth.times[0])


# --- forecasts ------------------------------------------------------------------------------------


def models(
    rig: Rig, truth: TrueTracer, mending: Mending, hidden: EffectDescription, preset: str
) -> dict[str, Model]:
    """Return the models to compare: as described, as mended, and as the rig is."""
    known: dict[str, Effects] = {'as described': (), 'mended': mending.last}
    if hidden.name in EFFECTS:
        known['knew'] = (hidden,)
    return {
        name: Model(rig, truth.grid, preset=preset, effects=effects)
        for name, effects in known.items()
    }


def forecast_errors(
    rig: Rig, truth: TrueTracer, mending: Mending, hidden: EffectDescription, preset: str
) -> dict[str, float]:
    """Return the errors of forecasts over `FORECAST_S` from true maps after the verdict, medians.

    Without a verdict the second half of the run counts.
    """
    begin = mending.accepted if not math.isnan(mending.accepted) else truth.times[-1] / 2.0
    last = truth.times[-1] - FORECAST_S
    starts = [time for time in truth.times if begin <= time <= last][::10]
    compared = models(rig, truth, mending, hidden, preset)
    return {
        name: float(
            np.median([_forecast(model, truth, mending, float(time))[1] for time in starts])
        )
        if starts
        else math.nan
        for name, model in compared.items()
    }


def _forecast(
    model: Model, truth: TrueTracer, mending: Mending, start: float
) -> tuple[FloatArray, float]:
    """Return the forecast from the true map at `start` [s], and its relative error."""
    schedule, state = Schedule.from_rates(mending.rates), np.clip(truth.at(start), 0.0, 1.0)
    for low, high, rates in schedule.intervals(start, start + FORECAST_S):
        state = model.predict(state, rates, high - low)
    return state, relative_error(state, truth.at(start + FORECAST_S))


# --- pictures -------------------------------------------------------------------------------------


def _picture(
    path: Path,
    rig: Rig,
    folder: Path,
    truth: TrueTracer,
    mending: Mending,
    beside: dict[str, LoopFigures],
) -> None:
    """Draw the error of the forecasts, and the tracer in the zone beside the other twins."""
    account = read_account(folder / 'bag')
    figure, axes = plt.subplots(2, 1, figsize=(10, 7), sharex=True, layout='constrained')
    minutes = np.array(account.times) / MINUTE_S
    axes[0].plot(minutes, 100.0 * np.array(account.prediction_error), color='#333333')
    percent_scale(axes[0])
    axes[0].set_ylabel('error of the forecast\nfor this photograph [%]')
    twin = 'this twin, mended' if mending.last else 'this twin, not mended'
    axes[1].plot(truth.times / MINUTE_S, truth.disallowed(rig) * ML, color='#12502f', label=twin)
    for (name, run), colour in zip(beside.items(), ('#b03a2e', '#2e6db0'), strict=False):
        first, last = truth.times[0], truth.times[-1]
        times = np.linspace(first, last, len(run.course_ml)) / MINUTE_S
        axes[1].plot(times, run.course_ml, color=colour, linestyle='--', label=name)
    axes[1].set_ylabel('tracer in the zone [ml]')
    axes[1].set_xlabel('time since the start of the injection [min]')
    axes[1].legend(fontsize=8, loc='upper left', bbox_to_anchor=(1.0, 1.0), frameon=False)
    for axis in axes:
        axis.grid(alpha=0.3)
        for time, effects in mending.changes:
            if time > 0.0:
                axis.axvline(time / MINUTE_S, color='#777777', linestyle=':')
                words = 'effect accepted' if effects else 'taken back'
                axis.annotate(
                    words,
                    (time / MINUTE_S, 0.97),
                    xycoords=('data', 'axes fraction'),
                    rotation=90,
                    va='top',
                    ha='right',
                    fontsize=8,
                )
    found = f'found: {in_words(mending.last)}' if mending.last else 'nothing found to mend'
    figure.suptitle(found, fontsize=10, wrap=True)
    with writing(path):
        figure.savefig(path, dpi=DOTS_PER_INCH)
    plt.close(figure)


def _forecast_picture(
    path: Path,
    rig: Rig,
    truth: TrueTracer,
    mending: Mending,
    hidden: EffectDescription,
    preset: str,
) -> None:
    """Draw the plume some minutes after the verdict, and how far the forecasts were off it."""
    start = float(min(mending.accepted, truth.times[-1] - FORECAST_S))
    real = truth.at(start + FORECAST_S)
    compared = models(rig, truth, mending, hidden, preset)
    figure, axes = plt.subplots(
        1, 1 + len(compared), figsize=(4.4 * (1 + len(compared)), 3.2), layout='constrained'
    )
    draw_map(axes[0], rig, real)
    axes[0].set_title(f'the rig at {(start + FORECAST_S) / MINUTE_S:.0f} min', fontsize=10)
    shown: Any = None
    for axis, (name, model) in zip(axes[1:], compared.items(), strict=True):
        state, error = _forecast(model, truth, mending, start)
        shown = axis.imshow(
            state - real,
            origin='lower',
            extent=(0.0, rig.width_m, 0.0, rig.height_m),
            cmap='RdBu_r',
            vmin=-0.5,
            vmax=0.5,
        )
        axis.set_title(
            f'{name}: {100.0 * error:.1f} % off after {FORECAST_S / MINUTE_S:.0f} min', fontsize=10
        )
        axis.set_xticks([])
        axis.set_yticks([])
    figure.colorbar(shown, ax=axes[1:], label='forecast minus rig', shrink=0.8)
    with writing(path):
        figure.savefig(path, dpi=DOTS_PER_INCH)
    plt.close(figure)
