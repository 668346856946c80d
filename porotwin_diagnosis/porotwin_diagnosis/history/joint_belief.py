"""The belief about a rig from all findings on it, and from it the prior of the next diagnosis.

The belief about a parameter is the mean of all findings of it, weighted by their precision. If the
findings scatter more than their intervals allow, the interval of the mean is widened by the Birge
ratio sqrt(chi^2 / (n - 1)) (Birge, Physical Review 40, 207, 1932).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from porotwin_diagnosis.decision.verdict import NONE, UNEXPLAINED
from porotwin_diagnosis.history.past_findings import (
    HALF_INTERVAL,
    FoundCause,
    PastFinding,
    Value,
)
from porotwin_diagnosis.search.prior import BelievedCause, Prior


@dataclass
class CauseCourse:
    """All findings of one cause: one effect at one well or place, the oldest first."""

    found: list[tuple[PastFinding, FoundCause]] = field(default_factory=list)

    @property
    def latest(self) -> FoundCause:
        """The cause as the newest finding tells it."""
        return self.found[-1][1]

    def believed(self) -> dict[str, Value]:
        """Return the belief about every parameter."""
        causes = [cause for _, cause in self.found]
        names = {name: None for cause in causes for name in cause.values}
        return {
            name: weighted([cause.values[name] for cause in causes if name in cause.values])
            for name in names
        }


def courses(findings: Sequence[PastFinding]) -> list[CauseCourse]:
    """Return the courses of all causes in `findings`, which are sorted by date.

    Of several leaks or zones, those that lie nearest to each other belong together, and none
    farther apart than `SAME_PLACE_M`.
    """
    found: list[CauseCourse] = []
    for finding in findings:
        open_courses = list(found)
        left = list(finding.causes)
        while left:
            pairs = [
                (course.latest.distance(cause), number, index)
                for number, course in enumerate(open_courses)
                for index, cause in enumerate(left)
                if course.latest.may_be(cause)
            ]
            if not pairs:
                break
            _, number, index = min(pairs)
            open_courses.pop(number).found.append((finding, left.pop(index)))
        found += [CauseCourse([(finding, cause)]) for cause in left]
    return found


NO_DEVIATION = 1e-30
"""Standard deviation, in the unit of the value, up to which a value counts as exact: its square
would vanish."""


def weighted(values: Sequence[Value]) -> Value:
    """Return the mean of `values` weighted by their precision, with its interval."""
    least = min((one.deviation for one in values if one.deviation > NO_DEVIATION), default=1.0)
    weights = [1.0 / max(one.deviation, 1e-3 * least) ** 2 for one in values]
    mean = sum(w * one.value for w, one in zip(weights, values, strict=True)) / sum(weights)
    scatter = sum(w * (one.value - mean) ** 2 for w, one in zip(weights, values, strict=True))
    birge = math.sqrt(max(1.0, scatter / max(1, len(values) - 1)))
    half = HALF_INTERVAL * birge / math.sqrt(sum(weights))
    return Value(value=mean, low=mean - half, high=mean + half)


def prior_from(findings: Sequence[PastFinding]) -> Prior:
    """Return the belief before the next recording, from `findings` sorted by date.

    The newest finding tells the probabilities: it was itself made with the belief of the earlier
    ones. After no gap, or an unexplained one, no effect is more probable than another. Whether
    there is a gap at all is never believed: only the maps decide that.
    """
    if not findings or findings[-1].verdict in (NONE, UNEXPLAINED):
        return Prior()
    last = findings[-1]
    probabilities = last.probabilities or {last.verdict: last.confidence}
    causes = [
        BelievedCause(
            course.latest.effect,
            course.latest.well,
            {name: (one.value, one.deviation) for name, one in course.believed().items()},
        )
        for course in courses(findings)
    ]
    return Prior(probabilities, tuple(causes))
