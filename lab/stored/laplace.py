"""A prototype of a diagnosis by one model of the errors, beside the present one.

    nice -n 15 python -m lab.stored.laplace FOLDER

Every set of effects that the search judged gets a Laplace approximation of its evidence. Let r be
its whitened residual (n,), and A = (J P, B) the slopes of its parameters and the modes of the
shared errors, each times its prior deviation (`effect_sets`). The amplitudes of A are normal with
deviation 1 about m. Each of the n / t independent errors has the variance v, where t cells of a map
and some frames share one:

    log E(v) = -n / 2t log v - r.r / 2tv - log det(I + G) / 2 + h (I + G)^-1 h / 2 - m.m / 2,
    G = A^T A / tv,  h = A^T r / tv + m

(MacKay, Information Theory, section 28.1). The variance has an inverse gamma prior about what the
noise leaves, and is integrated out. Every set has random fields beside its modes, since no model is
exact; their amplitude and length are integrated out too. `SMALL` ones are errors of the
model. *Something else* is a set with larger ones. A class (none, one effect, several, something
else) is as probable as another, and so are its sets. A power tempers the probabilities. It and the
frames that share an error are fitted.
"""

import argparse
import math
import pickle
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.special import gammaln, logsumexp

from lab.blind.blind_cases import BlindCase
from lab.blind.blind_table import expected_error, is_sure_and_wrong
from lab.stored.ablation import PRESENT, REMEMBERED, ChangedDiagnosis
from lab.stored.linear_sets import (
    WAVES,
    LinearRecording,
    LinearSet,
    judged_fits,
    linear_recording,
)
from lab.stored.simulation_store import SimulationStore
from lab.stored.stored_cases import StoredVerdict, is_held_out, stored_jobs
from porotwin_cli.terminal import print_table
from porotwin_core.geometry.grid import FloatArray
from porotwin_diagnosis.decision.verdict import NONE, UNEXPLAINED
from porotwin_diagnosis.search.findings import Findings
from porotwin_diagnosis.search.ranking import effect_and_well
from porotwin_diagnosis.thresholds import SYSTEMATIC_MISFIT

SETS = 'linear.pickle'
"""File with the sets of a stored recording, beside its verdict."""

SHAPE = 10.0
"""Shape of the inverse gamma prior of the variance: it is known to about a third."""

VARIANCES = np.geomspace(0.01, 30.0, 81)
"""Variances over which the evidence is integrated."""

SMALL, LARGE, LENGTHS = (0.0, 0.003, 0.01), (0.03, 0.1, 0.3, 1.0, 3.0), (0.0, 0.3)
"""Amplitudes of the random fields as errors of the model and as something else, and their
correlation lengths [sides of the rig]."""

FRAMES, TEMPERS = (1.0, 2.0, 4.0, 8.0), np.geomspace(0.01, 1.0, 41)
"""Frames that share an error, and powers of the probabilities, that are tried."""

LISTED = 1.0 / 3.0
"""Share of the largest probability from which another set is listed beside the first."""


class SetEvidence(NamedTuple):
    """The names of a set, its log evidence with small errors, and with something else beside it."""

    names: tuple[str, ...]
    alone: float
    beside: float


def log_evidence(
    one: LinearSet, scale: FloatArray | float, *, cells: float, correlated: float, variance: float
) -> float:
    """Return the log evidence of the set `one` with its amplitudes times `scale` (k,).

    Args:
        one: a set.
        scale: factors on the deviations of the amplitudes.
        cells: number n of cells.
        correlated: cells t that share an independent error.
        variance: prior mean of the variance of an error [-].
    """
    return float(logsumexp(_by_variance(one, scale, cells, correlated, variance)))


def _by_variance(
    one: LinearSet, scale: FloatArray | float, cells: float, correlated: float, variance: float
) -> FloatArray:
    """Return the log evidence of `one` at each of `VARIANCES`, with the prior of a step there."""
    factor = np.broadcast_to(scale, one.mean.shape)
    values, vectors = np.linalg.eigh(factor[:, None] * one.gram * factor)
    moments, mean = vectors.T @ (factor * one.moments), vectors.T @ one.mean
    k = correlated * VARIANCES[:, None]
    inner = 1.0 + np.maximum(values, 0.0) / k
    logs = -0.5 * (cells / correlated) * np.log(VARIANCES) - 0.5 * one.square / k[:, 0]
    logs += 0.5 * np.sum((moments / k + mean) ** 2 / inner - np.log(inner), axis=1)
    rate = (SHAPE - 1.0) * variance
    prior = SHAPE * np.log(rate / VARIANCES) - gammaln(SHAPE) - rate / VARIANCES
    step = np.log(VARIANCES[1] / VARIANCES[0])
    return np.asarray(logs + prior + np.log(step) - 0.5 * mean @ mean)


def evidences(recording: LinearRecording, frames: float) -> list[SetEvidence]:
    """Return the evidence of every set, if so many `frames` share an error."""
    numbers = numbers_of(recording, frames)
    return [set_evidence(one, recording.fields, numbers) for one in recording.sets]


def numbers_of(recording: LinearRecording, frames: float) -> dict[str, float]:
    """Return the numbers of a recording that `log_evidence` takes."""
    return {
        'cells': float(recording.cells),
        'correlated': recording.correlated * frames,
        'variance': recording.noise + SYSTEMATIC_MISFIT**2,
    }


def set_evidence(one: LinearSet, fields: int, numbers: Mapping[str, float]) -> SetEvidence:
    """Return the evidence of a set whose last `fields` amplitudes are those of something else.

    `numbers` are the named arguments of `log_evidence`.
    """
    size = len(one.mean) - fields

    def mean(amplitudes: Sequence[float]) -> float:
        logs = [
            log_evidence(one, np.append(np.ones(size), amplitude * spectrum_of(length)), **numbers)
            for length, amplitude in product(LENGTHS, amplitudes)
        ]
        return float(logsumexp(logs) - np.log(len(logs)))

    return SetEvidence(one.names, mean(SMALL), mean(LARGE))


def spectrum_of(length: float) -> FloatArray:
    """Return the deviations of the modes of fields of a correlation `length`, mean square 1/f."""
    waves = np.stack(np.meshgrid(*map(np.arange, WAVES), indexing='ij')).reshape(3, -1)
    decay = np.exp(-0.25 * (np.pi * length) ** 2 * np.sum(waves**2, axis=0))
    return np.tile(decay / np.linalg.norm(decay), 4)


def posterior(
    sets: Sequence[SetEvidence], singles: int, temper: float, unknown: Collection[str] = ()
) -> dict[tuple[str, ...], float]:
    """Return the probability of every set by the names of its effects, the largest first.

    Args:
        sets: the sets, the one without effects among them.
        singles: number of single effects that the search tried.
        temper: power of all probabilities.
        unknown: effects that are left out.
    """
    logs: dict[tuple[str, ...], float] = {}
    beside = []
    for one in sets:
        if {*one.names} & {*unknown}:
            continue
        count = len(one.names)
        prior = math.lgamma(count + 1.0) - count * math.log(singles)
        names = tuple(sorted(one.names)) or (NONE,)
        logs[names] = max(one.alone + prior, logs.get(names, -math.inf))
        if count < 2:
            beside.append(one.beside + prior)
    logs[(UNEXPLAINED,)] = float(logsumexp(beside))
    scaled = temper * np.array([*logs.values()])
    shares = np.exp(scaled - logsumexp(scaled))
    found = dict(zip(logs, map(float, shares), strict=True))
    return dict(sorted(found.items(), key=lambda pair: -pair[1]))


class EvidenceVerdict(NamedTuple):
    """The `first` set and those listed beside it, their probability, and whether one is right."""

    first: tuple[str, ...]
    confidence: float
    right: bool

    @property
    def sure_and_wrong(self) -> bool:
        """Whether a wrong name is stated with confidence."""
        (name, *_) = self.first
        return is_sure_and_wrong(name, self.confidence, confirmed=self.right)


def judged(right: Collection[str], found: Mapping[tuple[str, ...], float]) -> EvidenceVerdict:
    """Return the most probable set with those that are nearly as probable."""
    (first, most), *_ = found.items()
    listed = [names for names, value in found.items() if value >= LISTED * most]
    return EvidenceVerdict(
        first,
        min(1.0, sum(found[names] for names in listed)),
        any(name in right for names in listed for name in names),
    )


class Question(NamedTuple):
    """A stored recording, or the same with its true effect left out of the library."""

    truth: StoredVerdict
    sets: Mapping[float, Sequence[SetEvidence]]
    singles: int
    held_out: bool
    unknown: tuple[str, ...] = ()

    @property
    def right(self) -> tuple[str, ...]:
        """The names that are right."""
        return (UNEXPLAINED,) if self.unknown else self.truth.right

    def posterior(self, frames: float, temper: float) -> dict[tuple[str, ...], float]:
        """Return the probability of every set, with these two numbers."""
        return posterior(self.sets[frames], self.singles, temper, self.unknown)

    def answer(self, frames: float, temper: float) -> EvidenceVerdict:
        """Return the verdict with these two numbers."""
        return judged(self.right, self.posterior(frames, temper))

    def log_score(self, frames: float, temper: float) -> float:
        """Return the log probability of the right sets."""
        found = self.posterior(frames, temper)
        right = sum(value for names, value in found.items() if {*names} & {*self.right})
        return math.log(max(right, 1e-6))


def questions(folder: Path, seed: int) -> Iterator[Question]:
    """Yield the questions of the stored recordings in `folder`, from their stored sets."""
    diagnosis = ChangedDiagnosis(PRESENT, {})
    count = max((int(path.name[-3:]) for path in folder.glob('case_*')), default=-1) + 1
    for number, job in enumerate(stored_jobs(folder, count, seed)):
        if not job.file.exists():
            continue
        file = job.file.with_name(SETS)
        if not file.exists():
            file.write_bytes(pickle.dumps(found_sets(diagnosis, job.case, job.file.parent)))
        recording: LinearRecording = pickle.loads(file.read_bytes())
        sets = {frames: evidences(recording, frames) for frames in FRAMES}
        one = Question(job.found(), sets, recording.singles, is_held_out(number))
        yield one
        if one.truth.is_alone:
            yield one._replace(unknown=one.truth.right)


def found_sets(diagnosis: ChangedDiagnosis, case: BlindCase, folder: Path) -> LinearRecording:
    """Return the sets of the present search on the stored recording in `folder`."""
    file = folder / REMEMBERED
    memory = pickle.loads(file.read_bytes()) if file.exists() else {}
    found = diagnosis.judged(case, folder, memory, SimulationStore(folder / 'simulations'))
    findings = found.evidence.findings
    return linear_recording(found.levels, judged_fits(findings), tried_singles(findings))


def tried_singles(findings: Findings) -> int:
    """Return the number of different single effects that a search tried."""
    return len({effect_and_well(fit) for fit in findings.screened})


def rows_of(asked: Sequence[Question], numbers: tuple[float, float]) -> Iterator[list[str]]:
    """Yield the rows of the table of figures: part, library, method, and figures."""
    for held_out, unknown in product((False, True), repeat=2):
        own = [one for one in asked if (one.held_out, bool(one.unknown)) == (held_out, unknown)]
        answers = [one.answer(*numbers) for one in own]
        part = 'held out' if held_out else 'chosen by'
        stated = [(a.confidence, a.right, a.sure_and_wrong) for a in answers]
        yield [part, 'true effect left out' if unknown else 'whole', 'evidence', *figures(stated)]
        if not unknown:
            rules = [(t.confidence, t.is_right, t.is_sure_and_wrong) for t, *_ in own]
            yield [part, 'whole', 'rules', *figures(rules)]


def figures(stated: Sequence[tuple[float, bool, bool]]) -> list[str]:
    """Return cases, right ones, sure and wrong ones, and the calibration error, as words."""
    confidences, right, wrong = zip(*stated, strict=True) if stated else ((), (), ())
    error = expected_error(confidences, right) if stated else math.nan
    return [str(len(stated)), str(sum(right)), str(sum(wrong)), f'{error:.3f}']


def main() -> None:
    """Fit both numbers to the recordings that are not held out, and print the figures of all."""
    parser = argparse.ArgumentParser(prog='python -m lab.stored.laplace')
    parser.add_argument('folder', type=Path)
    parser.add_argument('--seed', type=int, default=31, help='seed of the stored recordings')
    given = parser.parse_args()
    asked = list(questions(given.folder.resolve(), given.seed))
    chosen = [one for one in asked if not one.held_out]
    numbers = max(
        product(FRAMES, TEMPERS), key=lambda both: sum(q.log_score(*both) for q in chosen)
    )
    for one in asked:
        told = one.answer(*numbers)
        print(
            one.truth.name, '+'.join(one.truth.truth) or NONE,
            'left out' if one.unknown else f'rules {one.truth.verdict} {one.truth.confidence:.2f}',
            f'evidence {"+".join(told.first)} {told.confidence:.2f}',
            '' if told.right else 'WRONG',
        )  # fmt: skip
    columns = ['part', 'library', 'method', 'cases', 'right', 'sure and wrong', 'calibration error']
    title = f'frames {numbers[0]:g}, temper {numbers[1]:.3f}'
    print_table(title, columns, list(rows_of(asked, numbers)))


if __name__ == '__main__':
    main()
