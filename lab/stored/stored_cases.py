"""Recordings with their truth, diagnosed with every simulation kept.

    nice -n 15 python -m lab.stored.stored_cases FOLDER [--cases 60] [--seed 31] [--photographs]

Every recording gets a folder with the recording, the simulations, the evidence of the verdict
(findings.json), the linear models of its sets (linear.pickle) and the verdict (verdict.json). A
second call continues, and makes the table anew. Photographs are those of the coarse blind check.
"""

import argparse
import pickle
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

from lab.blind.blind_cases import SMALL, BlindCase, draw_case
from lab.blind.blind_photographs import MAPS, photograph_case
from lab.blind.blind_score import verdicts_beside
from lab.blind.blind_study import make_recording
from lab.blind.blind_table import is_sure_and_wrong
from lab.blind.calibration_absorption import map_figures
from lab.blind.simulation_store import SimulationStore
from lab.stored.linear_sets import recording_of
from lab.stored.stored_draw import HELD_OUT_EVERY, WEAK, draw_stored
from lab.study import FiguresJob, Study
from porotwin_cli.terminal import print_table
from porotwin_diagnosis.data.false_cells import without_false_cells
from porotwin_diagnosis.decision.verdict import Verdict
from porotwin_diagnosis.examine import DiagnosisSettings, judge
from porotwin_diagnosis.report.evidence_json import write_evidence
from porotwin_recording.experiment.recording import open_recording

CASE_BYTES = 1.0e9
"""Memory of one diagnosis [B]."""

CASE_S = 120.0
"""Usual time of one recording [s], for the estimate."""

FINDINGS, SETS, VERDICT = 'findings.json', 'linear.pickle', 'verdict.json'
"""Files in the folder of a recording."""


@dataclass(frozen=True)
class StoredVerdict:
    """The truth of a recording and the verdict on it.

    Attributes:
        name: name of the recording.
        kind: its kind.
        truth: names of its effects.
        right: names of the verdicts that are right.
        verdict: name of the verdict.
        members: names of all effects that are named.
        listed: names that the recording cannot separate from the verdict.
        confidence: its confidence.
        doubt: its least certain point.
        simulations: different simulations that the diagnosis asked for.
        seconds: CPU time of the diagnosis [s].
    """

    name: str
    kind: str
    truth: tuple[str, ...]
    right: tuple[str, ...]
    verdict: str
    members: tuple[str, ...]
    listed: tuple[str, ...]
    confidence: float
    doubt: str
    simulations: int
    seconds: float

    @property
    def is_right(self) -> bool:
        """Whether the verdict, or an effect listed beside it, is right."""
        return self.verdict in self.right or not {*self.right}.isdisjoint(self.listed)

    @property
    def is_sure_and_wrong(self) -> bool:
        """Whether a wrong name is stated with confidence."""
        return is_sure_and_wrong(self.verdict, self.confidence, confirmed=self.is_right)

    @property
    def is_alone(self) -> bool:
        """Whether the truth is one effect of the library, which may be left out of it."""
        return len(self.truth) == 1 and self.kind in ('single', WEAK)

    @property
    def has_all(self) -> bool:
        """Whether it names as many effects as there are, and each of them by name."""
        return sorted(self.members) == sorted(self.truth)


@dataclass(frozen=True)
class StoredJob(FiguresJob[StoredVerdict]):
    """Makes and diagnoses the recording of `case`; `file` is its verdict."""

    case: BlindCase
    file: Path
    photographed: bool = False
    kind: ClassVar = StoredVerdict
    did: ClassVar = 'stored'

    @property
    def name(self) -> str:
        """The name of the recording."""
        return self.case.name

    def figures(self) -> StoredVerdict:
        """Make the recording, diagnose it, and keep the evidence."""
        folder, case = self.file.parent, self._made()
        begin = time.process_time()
        store = SimulationStore(folder / 'simulations')
        recording = without_false_cells(open_recording(folder / 'recording'))
        judged = judge([recording], DiagnosisSettings(excluded=case.withheld, crew=store))
        seconds = time.process_time() - begin
        findings = judged.evidence.findings
        write_evidence(folder / FINDINGS, judged.evidence)
        (folder / SETS).write_bytes(pickle.dumps(recording_of(judged.levels, findings)))
        return stored_verdict(case, judged.verdict, findings.runs, seconds)

    def _made(self) -> BlindCase:
        """Make the recording, and return its case with all verdicts that are right.

        Raises:
            CalibrationRefused: the photographs of the case cannot be calibrated.
        """
        case, folder = self.case, self.file.parent
        clean, begun = folder / 'clean.nc', folder / 'begun.nc'
        if self.photographed:
            photograph_case(case, folder, clean=clean)
            hidden = map_figures(case, folder / 'recording' / MAPS, clean).hidden
            return replace(case, right=(*case.right, *verdicts_beside(case, hidden)))
        if not clean.exists():
            make_recording(case, folder / 'recording', clean=begun)
            begun.rename(clean)
        return case


def stored_verdict(
    case: BlindCase, verdict: Verdict, simulations: int, seconds: float
) -> StoredVerdict:
    """Return the `verdict` on `case` beside its truth."""
    return StoredVerdict(
        name=case.name,
        kind=case.kind,
        truth=tuple(effect.name for effect in case.effects),
        right=case.right,
        verdict=verdict.name,
        members=verdict.members,
        listed=(*verdict.inseparable, *verdict.close),
        confidence=verdict.confidence,
        doubt=verdict.doubt.value,
        simulations=simulations,
        seconds=seconds,
    )


def is_held_out(number: int) -> bool:
    """Return whether no rule may be chosen by recording `number`."""
    return number % HELD_OUT_EVERY == HELD_OUT_EVERY - 1


def stored_jobs(
    folder: Path, cases: int, seed: int, *, photographs: bool = False
) -> list[StoredJob]:
    """Return the jobs of `cases` recordings in `folder`; `photographs` have none of large rigs."""
    if photographs:
        drawn = [draw_case(number, seed, coarse=True) for number in range(cases)]
    else:
        drawn = [draw_stored(number, seed) for number in range(cases)]
    return [
        StoredJob(case, folder / case.name / VERDICT, photographs)
        for case in drawn
        if not photographs or case.rig.name == SMALL.name
    ]


def rows(verdicts: Sequence[StoredVerdict]) -> list[list[str]]:
    """Return the rows of the table, one per kind and one for all."""
    kinds = list(dict.fromkeys(one.kind for one in verdicts))
    groups = [(kind, [one for one in verdicts if one.kind == kind]) for kind in kinds]
    return [
        [
            name,
            str(len(own)),
            str(sum(one.is_right for one in own)),
            str(sum(one.has_all for one in own)),
            str(sum(one.is_sure_and_wrong for one in own)),
            f'{sum(one.seconds for one in own) / len(own):.0f}',
        ]
        for name, own in [*groups, ('all', list(verdicts))]
        if own
    ]


HEADINGS = ['kind', 'recordings', 'right', 'all members', 'sure and wrong', 'CPU s']
"""Headings of the table."""


def main() -> None:
    """Make missing recordings, and print the table."""
    parser = argparse.ArgumentParser(prog='python -m lab.stored.stored_cases')
    parser.add_argument('folder', type=Path)
    parser.add_argument('--cases', type=int, default=60, help='number of recordings')
    parser.add_argument('--seed', type=int, default=31, help='seed of effects and noise')
    parser.add_argument('--photographs', action='store_true', help='seen by a camera')
    given = parser.parse_args()
    folder = given.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    jobs = stored_jobs(folder, given.cases, given.seed, photographs=given.photographs)
    Study(folder, CASE_BYTES, workers=1).do(jobs, seconds_per_job=CASE_S)
    print_table('stored recordings', HEADINGS, rows([job.found() for job in jobs]))


if __name__ == '__main__':
    main()
