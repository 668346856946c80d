"""The result of a diagnosis, for the report and for callers."""

from dataclasses import dataclass

from porotwin_diagnosis.advice.partial_cause import PartialCause
from porotwin_diagnosis.advice.proposals import Proposal
from porotwin_diagnosis.advice.remainder_form import RemainderForm
from porotwin_diagnosis.advice.strength import Strength
from porotwin_diagnosis.data.sample import Sample
from porotwin_diagnosis.decision.compared_readings import ComparedReading
from porotwin_diagnosis.decision.evidence import Evidence
from porotwin_diagnosis.decision.held_out import HeldOut
from porotwin_diagnosis.decision.verdict import Verdict
from porotwin_diagnosis.model.gap_map import GapMap
from porotwin_diagnosis.model.unknown_rates import SourceRate
from porotwin_recording.experiment.recording import Recording


@dataclass(frozen=True)
class Diagnosis:
    """A verdict on recordings of one rig, with all data for the report.

    Attributes:
        recordings: the recordings that were diagnosed.
        samples: the frames of each recording that were compared.
        evidence: all fits and measures that the verdict was made from.
        verdict: the verdict.
        held_out: the held-out part of each recording, without and with the verdict's effects.
        gap: where and when the gap arises; without places if there is no gap.
        strengths: the smallest visible strength of each effect, by name.
        proposals: checks and experiments that would show more.
        seconds: time that the diagnosis took [s].
        excluded: names of effects that were not considered.
        rates: the rates of sources that nobody measured.
        remainder: the form of an unexplained gap; None for other verdicts.
        partial: effects that close much of an unexplained gap, and the remainder.
        remarks: lines on what is odd in the recordings.
        readings: the readings beside the maps, and the model in their place.
    """

    recordings: tuple[Recording, ...]
    samples: tuple[Sample, ...]
    evidence: Evidence
    verdict: Verdict
    held_out: tuple[HeldOut, ...]
    gap: GapMap
    strengths: dict[str, Strength]
    proposals: tuple[Proposal, ...]
    seconds: float
    excluded: tuple[str, ...] = ()
    remainder: RemainderForm | None = None
    partial: PartialCause | None = None
    remarks: tuple[str, ...] = ()
    rates: tuple[SourceRate, ...] = ()
    readings: tuple[ComparedReading, ...] = ()
