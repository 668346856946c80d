"""Twins that find a hidden effect, beside twins that knew it and twins that never find out.

Every case is the demo's experiment with another hidden effect. The mended twin uses the modules of
the running graph, in one process: maps with the noise of an image analysis, the diagnosis on the
run so far, an operator who accepts at once, and the shadow forecast. A run leaves one file, so that
an interrupted bench goes on where it stopped.
"""

import math
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from lab.study import FiguresJob, Study, study_folder
from porotwin_cli.recorded.run_account import TrueTracer
from porotwin_cli.running.hidden_effect import MENDABLE, as_text, draw_context, surprise
from porotwin_cli.running.loop_rig import LoopRig, LoopSettings, map_eyes
from porotwin_cli.running.loop_run import PLAN_PRESET, planning_twin, with_plan
from porotwin_cli.running.loop_scenario import LoopScenario
from porotwin_cli.running.mended_loop import Mending, forecast_errors, run_beside, scenario_of
from porotwin_cli.terminal import print_table
from porotwin_cli.workspace import small_rig
from porotwin_core.basis.parallel import TASK_BYTES
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.rate_periods import KnownRates, RatePeriod
from porotwin_core.rates.wells import WellRates
from porotwin_core.rig import EffectDescription, Rig, load_rig
from porotwin_diagnosis.data.live_run import LiveRun
from porotwin_diagnosis.examine import DiagnosisSettings, examine
from porotwin_diagnosis.mending.finding import finding_of
from porotwin_diagnosis.mending.mender import Effects, Mender, MendSettings, model_maker
from porotwin_diagnosis.mending.offer_book import Offer
from porotwin_diagnosis.report.diagnosis_json import diagnosis_json
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.loop.cycle import Cycle, Observation
from porotwin_recording.experiment.recording import open_recording
from porotwin_rig.virtual_rig import VirtualRig
from porotwin_solver.adjoint.grid_models import GridModels

START_S, END_S = 1200.0, 3600.0
"""Time when the twin takes over, and end of an experiment [s]: the tracer then approaches the zone,
as in the demo."""

INTERVAL_S = 60.0
"""Time between photographs [s]: half as many as in the demo take half the time."""

EVERY_S = 600.0
"""Time between two diagnoses [s]."""

RUNS = ('never told', 'knew', 'mended')
"""The twins of a case."""

SECONDS_PER_RUN = 120.0
"""One run on one core, the mean over all kinds of runs [s]."""

WANTED_FORECAST, WANTED_DOSE, WANTED_HARM = 1.2, 1.1, 1.05
"""Wanted: the forecast error and the dose relative to the twin that knew, and either of them
relative to the twin that is never told."""


LEAST_DOSE_ML_MIN = 1.0
"""Smaller doses are equal [ml min]: a map of the rig is seldom sure of a millilitre."""


@dataclass(frozen=True)
class MendFigures:
    """The figures of one run; the last four are of a mended one.

    Attributes:
        dose_ml_min: tracer in the zone, integrated over time [ml min].
        found: effects in force at the end, as text.
        minute: when the first effect was accepted [min]; NaN: none was.
        lines: the words of the mender.
        forecast_error: median relative error of forecasts over a quarter of an hour after that, by
            model.
    """

    dose_ml_min: float
    found: list[str] = field(default_factory=list)
    minute: float = math.nan
    lines: list[str] = field(default_factory=list)
    forecast_error: dict[str, float] = field(default_factory=dict)


def case_effect(number: int, rig: Rig, seed: int) -> EffectDescription:
    """Return the hidden effect of case `number`; the kinds follow in turn.

    Raises:
        InputError: the effect never shows in this rig.
    """
    name = MENDABLE[number % len(MENDABLE)]
    return surprise((name,), np.random.default_rng([seed, number]), draw_context(rig))


@dataclass(frozen=True)
class MendJob(FiguresJob[MendFigures]):
    """One run of one case; `file` receives its figures."""

    scenario: LoopScenario
    run: str
    settings: LoopSettings
    file: Path
    kind: ClassVar = MendFigures

    def figures(self) -> MendFigures:
        """Run and return the figures."""
        if self.run == 'mended':
            return run_mended(self.scenario, self.settings)
        described = self.scenario.rig
        if self.run == 'knew':
            described = described.with_effects(self.scenario.effects)
        found = run_beside(self.scenario, self.settings, described)
        return MendFigures(found.dose_ml_min)


class _ChangingModels:
    """Models whose effects change while a twin uses them."""

    def __init__(self, models: GridModels) -> None:
        self.models = models

    @property
    def own(self) -> '_ChangingModels':
        return self

    def __getattr__(self, name: str) -> Any:
        return getattr(self.models if name == 'plan_cost' else self.models.own, name)

    def change(self, effects: Effects) -> None:
        """Let `effects` act from now on."""
        self.models = self.models.with_effects(effects)


class _MendedRun:
    """A closed loop whose twin is diagnosed and mended on the way."""

    def __init__(self, scenario: LoopScenario, settings: LoopSettings, folder: Path) -> None:
        rig, grid = with_plan(scenario), settings.grid(scenario)
        self._rig, self.grid = rig, grid
        self._settings, self._folder = settings, folder
        self._models = _ChangingModels(
            GridModels(rig, grid, preset=settings.preset, coarse_preset=PLAN_PRESET)
        )
        self.twin = planning_twin(scenario, settings, self._models)
        self.live = LiveRun(rig, grid, folder)
        self.mending = Mending()
        self.truth: list[FloatArray] = []
        self.times: list[float] = []
        self.lines: list[str] = []
        self._now = 0.0
        self.mender = Mender(
            model_maker(rig, grid, settings.preset),
            MendSettings(every_s=EVERY_S, least_confidence=0.9),
            set_effects=self._set,
            publish=self._note,
            say=self.lines.append,
        )

    def _set(self, effects: Effects) -> None:
        self._models.change(effects)
        self.twin.change_model(self._rig.with_effects(effects))
        self.live.note_effects(effects)
        self.mending.changes.append((self._now, effects))

    def _note(self, offer: Offer) -> None:
        self.mending.offers.append({'minute': self._now / 60.0, 'state': offer.state.value})

    def pumped(self, begin: float, end: float, rates: WellRates) -> None:
        """Keep the rates from `begin` to `end` [s]."""
        self.live.rates.add_known(KnownRates(begin, end, rates))
        self.mending.rates.append((begin, rates))

    def look(self, asset: VirtualRig) -> None:
        """Keep the truth that nobody in the loop sees."""
        self.times.append(asset.time)
        self.truth.append(asset.concentration(self.grid))

    def after(self, seen: Observation, cycle: Cycle, periods: Sequence[RatePeriod]) -> None:
        """Let a photograph judge, and diagnose if there is an occasion."""
        self._now = seen.time
        self.live.add_map(seen.time, seen.concentration, self.grid)
        self.mender.see(seen.concentration, periods)
        if self.mender.occasion(seen.time, cycle.prediction_error, math.nan):
            self._diagnose()
        offer = self.mender.newest
        if offer is not None and offer.is_open:
            self.mender.answer(offer.sequence, accept=True)

    def _diagnose(self) -> None:
        recording = self._folder / f'run_{self._now:.0f}'
        self.live.write(recording)
        result = examine(
            [open_recording(recording)], DiagnosisSettings(preset=self._settings.preset)
        )
        finding = finding_of(diagnosis_json(result))
        self.lines.append(f'{self._now / 60.0:.0f} min: {finding.verdict} {finding.confidence:.2f}')
        self.mender.found(finding, seen=self._now, now=self._now, given=self.mender.in_force)


def run_mended(scenario: LoopScenario, settings: LoopSettings) -> MendFigures:
    """Return the figures of a twin that finds the hidden effect by itself."""
    with tempfile.TemporaryDirectory() as folder:
        run = _MendedRun(scenario, settings, Path(folder))
        rig, eyes = LoopRig(scenario, settings), map_eyes(scenario, settings)

        def watched(asset: VirtualRig) -> Observation:
            run.look(asset)
            return eyes(asset)

        known: list[KnownRates] = []
        run.pumped(0.0, rig.time, Limits.of(scenario.rig).safe())
        while not rig.is_over:
            seen = rig.seen(watched)
            cycle = run.twin.cycle(seen, known)
            run.after(seen, cycle, [RatePeriod(*item) for item in known])
            assert cycle.setpoint is not None
            begin = rig.time
            delivered = rig.advance(cycle.setpoint.rates)
            known = [KnownRates(begin, rig.time, delivered)]
            run.pumped(begin, rig.time, delivered)
        rig.seen(watched)
    truth = TrueTracer(np.array(run.times), run.grid, np.array(run.truth))
    return MendFigures(
        rig.dose_ml_min,
        [as_text(effect) for effect in run.mending.last],
        run.mending.accepted / 60.0,
        run.lines,
        forecast_errors(scenario.rig, truth, run.mending, scenario.effects[0], settings.preset),
    )


def jobs_of(folder: Path, *, scenarios: int, seed: int) -> list[MendJob]:
    """Return all runs, those of a case one after the other."""
    rig = load_rig(small_rig())
    settings = LoopSettings()
    jobs = []
    for number in range(scenarios):
        hidden = case_effect(number, rig, seed)
        scenario = replace(
            scenario_of(rig, (hidden,), START_S, END_S, INTERVAL_S),
            name=f'case_{number + 1:02d}',
            seed=seed * 1000 + number,
        )
        jobs += [
            MendJob(scenario, name, settings, folder / f'{scenario.name}_{seed}_{name[:5]}.json')
            for name in RUNS
        ]
    return jobs


def run(
    *,
    scenarios: int = 20,
    seed: int = 1,
    workers: int | None = None,
    scheduler: str = '',
    output: Path | None = None,
) -> list[dict[str, Any]]:
    """Run all cases and return a row for each.

    Args:
        scenarios: number of hidden effects.
        seed: of their draws.
        workers: runs at a time; None: one per core, as far as the memory holds.
        scheduler: address of a Dask scheduler whose workers do the runs instead.
        output: folder of the runs; one with earlier runs is continued.

    Raises:
        InputError: the folder cannot be used.
    """
    folder = study_folder(output, 'bench-mend', lambda path: any(path.glob('case_*.json')))
    jobs = jobs_of(folder, scenarios=scenarios, seed=seed)
    Study(folder, TASK_BYTES, workers, scheduler).do(jobs, seconds_per_job=SECONDS_PER_RUN)
    return [_row(jobs[first : first + len(RUNS)]) for first in range(0, len(jobs), len(RUNS))]


def _row(jobs: Sequence[MendJob]) -> dict[str, Any]:
    """Return the figures of one case."""
    found = {job.run: job.found() for job in jobs}
    mended = found['mended']
    errors = mended.forecast_error
    dose = {name: run.dose_ml_min for name, run in found.items()}
    return {
        'hidden': as_text(jobs[0].scenario.effects[0]),
        'found': '; '.join(mended.found) or 'nothing',
        'minute': mended.minute,
        'forecast, described': errors['as described'],
        'forecast, mended': errors['mended'],
        'forecast, knew': errors['knew'],
        'dose, never told': dose['never told'],
        'dose, mended': dose['mended'],
        'dose, knew': dose['knew'],
    }


def show(rows: Sequence[dict[str, Any]]) -> None:
    """Print a table of all cases, and the number that reaches each aim."""
    table = [
        [f'{value:.3g}' if isinstance(value, float) else value.partition(':')[0]
         for value in row.values()]
        for row in rows
    ]  # fmt: skip
    print_table('hidden effects', list(rows[0]), table)
    for words, count in summary(rows).items():
        print(f'{words}: {count} of {len(rows)}')
    late = sum(math.isnan(row['forecast, mended']) for row in rows)
    if late:
        print(
            f'no forecast to compare, because the effect was accepted in the last minutes: {late}'
        )


def summary(rows: Sequence[dict[str, Any]]) -> dict[str, int]:
    """Return the number of cases that reach each aim, by the words of the aim.

    A case without a forecast to compare reaches no aim for forecasts, and cannot have harmed them.
    """

    def ratio(row: dict[str, Any], what: str, other: str) -> float:
        least = LEAST_DOSE_ML_MIN if what == 'dose' else 1e-9
        return float(max(row[f'{what}, mended'], least) / max(row[f'{what}, {other}'], least))

    return {
        f'forecast error at most {WANTED_FORECAST:g} times the one of a twin that knew': sum(
            ratio(row, 'forecast', 'knew') <= WANTED_FORECAST for row in rows
        ),
        f'dose at most {WANTED_DOSE:g} times the one of a twin that knew': sum(
            ratio(row, 'dose', 'knew') <= WANTED_DOSE for row in rows
        ),
        f'neither above {WANTED_HARM:g} times that without mending': sum(
            not ratio(row, 'forecast', 'described') > WANTED_HARM
            and ratio(row, 'dose', 'never told') <= WANTED_HARM
            for row in rows
        ),
    }
