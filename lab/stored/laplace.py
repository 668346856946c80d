"""A prototype of a diagnosis by one model of the errors, beside the present one.

    nice -n 15 python -m lab.stored.laplace FOLDER

Every set of effects that the search judged gets a Laplace approximation of its evidence. Let r be
its whitened residual over all frames, J the slopes of the scaled parameters, and U the modes of
errors that no effect makes: the scheme's error in both parts of the recording, and the change on
two rough sands. The amplitudes b of A = (J P, U) are normal with deviation 1 about m, and every
cell has the noise k, which stands for its neighbours too:

    log E = -r.r / 2k - log det(I + G) / 2 + h (I + G)^-1 h / 2 - m.m / 2,
    G = A^T A / k,  h = A^T r / k + m

(MacKay, Information Theory, section 28.1). P is `STEPS`, or the spread of a place that may be
anywhere. Something else is the model without effects, with smooth random fields among its modes. A
class (none, one effect, several, something else) is as probable as another, and so are its sets.
"""

import argparse
import pickle
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lab.blind.blind_cases import BlindCase
from lab.blind.blind_table import SURE
from lab.stored.ablation import PRESENT, REMEMBERED, ChangedDiagnosis
from lab.stored.simulation_store import SimulationStore
from lab.stored.stored_cases import StoredVerdict, is_held_out, stored_jobs
from porotwin_cli.terminal import print_table
from porotwin_core.geometry.grid import FloatArray
from porotwin_diagnosis.decision.verdict import NONE, UNEXPLAINED

STEPS = 10.0
"""Prior deviation of a parameter without a place [scaled]."""

WAVES = (3, 4, 6)
"""Waves of the smooth random fields in time, height and width."""

FEATURES = 'laplace.pickle'
"""File with the linear models of a stored recording."""

NOISES, FIELDS = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0), (0.03, 0.1, 0.3, 1.0, 3.0)
"""Values that are tried for the noise, and for the deviation of the random fields."""


class LinearModel(NamedTuple):
    """A set of effects near its best fit: normal equations of A, with the modes at the end.

    Attributes:
        names: names of the effects.
        square: r.r.
        gram: A^T A.
        moments: A^T r.
        mean: prior mean m of the amplitudes.
    """

    names: tuple[str, ...]
    square: float
    gram: FloatArray
    moments: FloatArray
    mean: FloatArray


@dataclass(frozen=True)
class LinearRecording:
    """All sets of a recording.

    Attributes:
        sets: the judged sets, the one without effects first.
        other: something else, with a deviation 1 of the random fields.
        fields: how many of its first amplitudes are random fields.
        singles: number of single effects that the search tried.
    """

    sets: tuple[LinearModel, ...]
    other: LinearModel
    fields: int
    singles: int


def log_evidence(model: LinearModel, noise: float, scale: FloatArray | float = 1.0) -> float:
    """Return the log evidence of `model`, with its amplitudes times `scale`."""
    factor = np.broadcast_to(scale, model.mean.shape)
    gram = factor[:, None] * model.gram * factor / noise + np.eye(len(factor))
    moments = factor * model.moments / noise + model.mean
    _sign, determinant = np.linalg.slogdet(gram)
    gained = moments @ np.linalg.solve(gram, moments) - model.mean @ model.mean
    return float(-0.5 * model.square / noise - 0.5 * determinant + 0.5 * gained)


def posterior(
    recording: LinearRecording, noise: float, field: float
) -> dict[tuple[str, ...], float]:
    """Return the probability of every set by the names of its effects, the largest first."""
    scale = np.ones(len(recording.other.mean))
    scale[: recording.fields] = field
    logs: dict[tuple[str, ...], float] = {}
    logs[(UNEXPLAINED,)] = log_evidence(recording.other, noise, scale)
    counts = {0: 1.0, 1: recording.singles, 2: recording.singles**2, 3: recording.singles**3}
    for one in recording.sets:
        names: tuple[str, ...] = tuple(sorted(one.names)) or (NONE,)
        value = log_evidence(one, noise) - np.log(counts[len(one.names)])
        logs[names] = max(value, logs.get(names, -np.inf))
    top = max(logs.values())
    weights = {names: float(np.exp(value - top)) for names, value in logs.items()}
    total = sum(weights.values())
    return dict(sorted(((n, w / total) for n, w in weights.items()), key=lambda pair: -pair[1]))


class EvidenceVerdict(NamedTuple):
    """The verdict of the prototype on a recording: the `names`, their probability, and the rest."""

    names: tuple[str, ...]
    confidence: float
    right: bool

    @property
    def sure_and_wrong(self) -> bool:
        """Whether a wrong name is stated with confidence."""
        return not self.right and self.confidence >= SURE and self.names != (UNEXPLAINED,)


def judged(truth: StoredVerdict, probabilities: Mapping[tuple[str, ...], float]) -> EvidenceVerdict:
    """Return the most probable set, with those that have a third of its probability beside it."""
    (names, most), *others = probabilities.items()
    near = [names, *(other for other, value in others if value > most / 3.0)]
    right = any(name in truth.right for one in near for name in one)
    return EvidenceVerdict(names, sum(probabilities[one] for one in near), right)


def left_out_of(
    truth: StoredVerdict, recording: LinearRecording
) -> tuple[StoredVerdict, LinearRecording]:
    """Return both as if the true effect were unknown: something else is then right."""
    left = tuple(one for one in recording.sets if not {*one.names} & {*truth.right})
    return replace(truth, right=(UNEXPLAINED,)), replace(recording, sets=left)


def features_of(diagnosis: ChangedDiagnosis, case: BlindCase, folder: Path) -> LinearRecording:
    """Return the linear models of the stored recording in `folder`."""
    file = folder / REMEMBERED
    memory = pickle.loads(file.read_bytes()) if file.exists() else {}
    store = SimulationStore(folder / 'simulations')
    found = diagnosis.judged(case, folder, memory, store)
    findings, levels = found.evidence.findings, found.levels
    sample = levels.judging.samples[0]
    fits = [findings.null, *findings.singles, *findings.pairs[:6], *findings.triples[:3]]
    rows = []
    for fit in fits:
        near = levels.corrected_at(fit).judging
        residual = near.residuals(fit.effects, 1.5)[0]
        refining = levels.refining
        own = refining.residuals(fit.effects, 1.5)
        slopes = np.zeros((0, *residual.shape))
        if fit.members:
            slopes = refining.slopes(fit.members, fit.scaled_parameters, own, fitted_only=False)[0]
        rows.append((fit, residual, slopes, near.forwards[0].correction))
    fitted = sample.fitted_frames
    smooth = diagnosis.module('data.sample').at_compared_cells
    counted = diagnosis.module('data.misfit')._counted_cells
    weight = sample.weight(1.5)
    sands = [
        smooth((one[0].maps(()) - levels.judging.forwards[0].uncorrected().maps(())), 1.5) * weight
        for one in levels.judging.rough_sands._sands
    ]
    fields = random_fields(rows[0][1].shape)
    front = np.zeros(rows[0][1].shape, bool)
    for _fit, residual, _slopes, _correction in rows:
        front |= counted(sample, residual)
    models = []
    for fit, residual, slopes, correction in rows:
        modes = list(sands)
        if correction is not None:
            error = smooth(correction, 1.5) * weight
            parts = [error.copy(), error.copy()]
            parts[0][fitted:], parts[1][:fitted] = 0.0, 0.0
            modes += parts
        spread = prior_deviations(fit)
        columns = [slope * step for slope, step in zip(slopes, spread, strict=True)]
        matrix = np.stack([*columns, *modes])
        mean = np.concatenate([-fit.scaled_parameters / np.maximum(spread, 1e-9),
                               np.zeros(len(modes))])  # fmt: skip
        names = tuple(member.effect for member in fit.members)
        models.append(linear_model(names, residual[front], matrix[:, front], mean))
    null_modes = [*fields, *sands]
    matrix = np.stack(null_modes)[:, front]
    size = len(null_modes)
    other = linear_model((UNEXPLAINED,), rows[0][1][front], matrix, np.zeros(size))
    labels = {
        (fit.members[0].effect, fit.members[0].fixed.get('well')) for fit in findings.screened
    }
    return LinearRecording(tuple(models), other, len(fields), len(labels))


def linear_model(
    names: tuple[str, ...], residual: FloatArray, matrix: FloatArray, mean: FloatArray
) -> LinearModel:
    """Return the normal equations of the residual (n,) and the matrix A^T (k, n)."""
    r, a = residual.astype(float), matrix.astype(float)
    return LinearModel(names, float(r @ r), a @ a.T, a @ r, mean)


def prior_deviations(fit: object) -> FloatArray:
    """Return the prior deviations of the scaled parameters of `fit`, (p,)."""
    found = []
    for member in fit.members:  # type: ignore[attr-defined]
        for parameter in member.parameters:
            low, high = parameter.range
            place = parameter.name in ('x', 'z') and np.isfinite(high - low)
            found.append((high - low) / np.sqrt(12.0) if place else STEPS)
    return np.array(found, dtype=float)


def random_fields(shape: Sequence[int]) -> list[FloatArray]:
    """Return smooth fields (nt, nz, nx) with a mean square of about 1."""
    axes = [
        [
            np.sqrt(2.0 - (k == 0)) * np.cos(np.pi * k * (np.arange(n) + 0.5) / n)
            for k in range(most)
        ]
        for n, most in zip(shape, WAVES, strict=True)
    ]
    return [np.einsum('t,z,x->tzx', *waves) for waves in product(*axes)]


def fitted_numbers(
    recordings: Sequence[tuple[StoredVerdict, LinearRecording]],
) -> tuple[float, float]:
    """Return the noise and the deviation of the fields that give the truths most probability."""

    def score(numbers: tuple[float, float]) -> float:
        total = 0.0
        for truth, recording in recordings:
            found = posterior(recording, *numbers)
            right = sum(p for names, p in found.items() if {*names} & {*truth.right})
            total += float(np.log(max(right, 1e-3)))
        return total

    return max(product(NOISES, FIELDS), key=score)


def main() -> None:
    """Fit the two numbers to the recordings that are not held out, and print the table of all."""
    parser = argparse.ArgumentParser(prog='python -m lab.stored.laplace')
    parser.add_argument('folder', type=Path)
    parser.add_argument('--seed', type=int, default=31, help='seed of the stored recordings')
    given = parser.parse_args()
    folder = given.folder.resolve()
    diagnosis = ChangedDiagnosis(PRESENT, {})
    count = max((int(path.name[-3:]) for path in folder.glob('case_*')), default=-1) + 1
    known: list[tuple[int, StoredVerdict, LinearRecording]] = []
    for number, job in enumerate(stored_jobs(folder, count, given.seed)):
        if not job.file.exists():
            continue
        file = job.file.with_name(FEATURES)
        if not file.exists():
            file.write_bytes(pickle.dumps(features_of(diagnosis, job.case, job.file.parent)))
        known.append((number, job.found(), pickle.loads(file.read_bytes())))
    train = [(truth, recording) for number, truth, recording in known if not is_held_out(number)]
    numbers = fitted_numbers(train)
    rows = []
    left_out: list[str] = []
    totals = np.zeros((2, 3, 3), int)
    for number, truth, recording in known:
        new = judged(truth, posterior(recording, *numbers))
        part = int(is_held_out(number))
        totals[part, 0] += (1, truth.is_right, truth.is_sure_and_wrong)
        totals[part, 1] += (1, new.right, new.sure_and_wrong)
        if truth.is_alone:
            unknown, rest = left_out_of(truth, recording)
            hidden = judged(unknown, posterior(rest, *numbers))
            totals[part, 2] += (1, hidden.right, hidden.sure_and_wrong)
            left_out.append(f'{truth.name} {truth.truth[0]} left out: '
                            f'{"+".join(hidden.names)} {hidden.confidence:.2f}')  # fmt: skip
        rows.append([
            f'{truth.name}{" (held out)" if part else ""}', '+'.join(truth.truth) or NONE,
            f'{"+".join(truth.members) or truth.verdict} {truth.confidence:.2f}'
            f'{"" if truth.is_right else " WRONG"}',
            f'{"+".join(new.names)} {new.confidence:.2f}{"" if new.right else " WRONG"}',
        ])  # fmt: skip
    print_table('cases', ['case', 'truth', 'present', 'evidence'], rows)
    print('\n'.join(left_out))
    print(f'noise {numbers[0]:g}, fields {numbers[1]:g}')
    for part, name in enumerate(('chosen by', 'held out')):
        for which, method in enumerate(('present', 'evidence', 'evidence, left out')):
            every, right, wrong = totals[part, which]
            print(f'{name}: {method}: {right} of {every} right, {wrong} sure and wrong')


if __name__ == '__main__':
    main()
