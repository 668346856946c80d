"""Constants that decide, each with its unit and its reason.

They were set on 22 recordings of an independent simulator and on blinded cases of the virtual rig
(`./porotwin blind-check`, seeds 2 to 5, 80 cases of seed 8, 88 of seed 9 and 90 of seed 10).

Misfits are dimensionless: a whitened residual of 1 is one standard deviation of the noise and of a
front that lies `FRONT_TOLERANCE` cells off. Ratios and factors are dimensionless as well. Log-odds
are natural logarithms of odds.
"""

import math

# Search -----------------------------------------------------------------------------------------

# The normalised misfit (`ranking.normalised_misfit`) and the ranking

NOISE_UNCERTAINTY = 1.1
"""Ratio of the true to the measured noise that is still plausible. The estimate comes from a
limited number of cells, and its error must not look like a gap."""

CORRECTED_MISFIT = 2.5
"""Misfit below which a fit is judged with its own point spread and with the errors of the scheme
taken back at itself, and below which runs on coarse cells are corrected at it. On a large rig with
layers of sand the scheme alone leaves 1.7 of the true effect. From about 4 on fronts lie more than
half a cell apart, and the correction, which stays in place, would miss them."""

# Selection of the fits that go on

BEAM = 3
"""Number of the best that go on wherever the search branches: places where the fits of a leak or a
zone start, judged fits, sets with one effect exchanged, and triples that are taken apart. The
linear response and coarse cells rank only roughly, so that the first need not be the right one."""

WIDE_BEAM = 6
"""The same where fits are cheap: fits that go on to the cells of the recording, and sets that are
fitted together, for each smoothing width."""

CLOSE_TO_BEST = 1.8
"""Ratio of the misfits of a fit and of the best one above which the fit is dropped. It balances
time against the risk that coarse cells rank the true effect too low."""

WELL_DISTANCE = 5.0
"""Distance [cells of the recording] from the rim of a well. A leak within it cannot be told from a
wrong rate of that well."""

ODDS_PER_PARAMETER = 0.5
"""Factor on the odds of a single effect for every parameter (Occam's razor). Before a recording, an
effect with four parameters could move fronts in many ways, so that each way was less probable. A
shifted picture imitates a bent response, a displaced well or a porosity: without the factor, three
of four such cases were named wrongly or with 0.5. True shifts keep their 0.99."""

PART_OF_A_TRIPLE = 0.2
"""Share of the normalised misfit of a large gap that a pair may leave for a third effect to be
looked for. A pair that closes most of a gap of 30 is probably part of the truth, although it leaves
3."""

# Decision ---------------------------------------------------------------------------------------

NO_GAP_MISFIT = 0.45
"""Normalised misfit of the model without effects below which there is no gap. The search then ends
early, and point spread and correction are measured without any effect, which could adapt to the
noise. Most recordings without an effect stay below it: noise and the errors of the scheme leave
that much. With sharp fronts between three sands one left 0.61."""

SUFFICIENT_MISFIT = 0.53
"""Normalised misfit above which effects do not explain the gap, and further ones are looked for.
True effects stay below it, effects that imitate a missing one seldom do."""

UNRESOLVED_SHARE = 0.04
"""Share of the normalised misfit of a large gap that even the true effect leaves: no scheme follows
a strong effect exactly. Of gaps above 4, true effects left 0.02 to 0.06 in 20 recordings, wrong
ones 0.14 and more in 8; one imitation by settling tracer left 0.07."""

COMBINATION_GAIN = 0.8
"""Ratio of the misfits of a pair and of the best single effect below which the second effect is
kept, and likewise of a triple and the best pair. More effects always fit better, so that a further
one must earn its place."""

SYSTEMATIC_MISFIT = 0.16
"""Standard deviation of the misfit that the true effect leaves beyond the noise. Its cause is the
scheme, which misplaces fronts by 0.16 of the 0.12 cells of the front tolerance."""

RIVAL_LOG_ODDS = math.log(20.0)
"""Log-odds against a single effect below which it is compared on equal terms with the best one. The
correction of the cells moves a misfit of 0.45 by up to 0.06, and so the log-odds by 1. An effect
that was dropped before the final judgement has at least as much against it: the misfit on coarse
cells alone does not prove more."""

NEAR_EQUAL_LOG_ODDS = math.log(3.0)
"""Log-odds against a single effect below which the verdict lists it beside the named one. Nobody
would stake a repair on odds below three to one."""

MOVING_PRICE = 10.0
"""Price of the squared misfit that moved parameters add to the fitted frames, in squares of the
held-out misfit. At a price of 1, two leaks that fronts reach late added 0.002 to 0.004 and need the
move; a pump that drifts, an effect outside the library, added 0.15 and passed for a wrong rate.
"""

INDISTINGUISHABLE = 0.06
"""Whitened root mean square difference of two predictions below which the camera shows the same."""

AT_THE_LIMIT, GAP_SLOPE = 1.0, 4.0
"""Log-odds of a statement whose misfit just meets its limit, such as `none` at `NO_GAP_MISFIT`, and
the increase of the log-odds of a gap, or of none, with the misfit relative to its limit. Misfits
that effects explain count likewise beside those that a calibration explains."""

SUFFICIENT_SLOPE, SURELY_SUFFICIENT = 12.0, 0.7
"""Increase of the log-odds that a model misses nothing per unit of lack of fit below
`SURELY_SUFFICIENT`; they are `AT_THE_LIMIT` from there to 1. Of 34 blinded cases above 0.7 eight
were wrong, of 33 from 0.5 to 0.7 one, and of 250 below 0.5 one."""

SURELY_BESIDE_SHARED = 0.6
"""`SURELY_SUFFICIENT` for maps with errors that all maps share, as photographs have them; the
log-odds there are even from it to 1. The model may choose these errors, so that a true effect fits
better. In 80 cases a single effect that was wrong although the true maps fit better had 0.60 to
0.75; true effects that the calibration does not hide had 0.37 at most, but one with 0.52."""

CONFIDENCE_RANGE = (0.05, 0.99)
"""Least and greatest confidence that is stated: a few hundred cases cannot prove more."""

OPEN_CONFIDENCE = 0.6
"""Largest confidence where the evidence leaves a question open: a clock where tracer from before
the recording makes the same maps, a scant recording, a search that was ended."""

SCANT_CELLS, SCANT_FRAMES = 80, 4
"""A recording with fewer cells along the longer side of the rig, or fewer frames to fit to, is
scant: no verdict on it has more than `OPEN_CONFIDENCE`. On 47 columns a shifted picture passed for
a wrong rate, on 70 columns a wrong rate passed for unexplained."""

SHARPER_SCHEME_GAIN = 0.75
"""Ratio of the misfits of the accurate and the configured scheme below which numerical diffusion is
named. Any finer scheme lowers the misfit a little, whatever causes the gap."""

INTERVAL_DEVIATIONS = 1.645 * 1.7
"""Half width of a 90 % interval in standard deviations: 1.645 for a normal distribution, times 1.7.
Errors of the scheme shift parameters too; without the factor the intervals held only two thirds of
the true values of the independent simulator."""

LEAST_RIVAL = 1e-3
"""Least probability of an effect for an experiment that separates it from the named one."""

LEAST_EXPERIMENT_GAIN = 1.1
"""Least gain in the distance of two explanations for another experiment to be proposed. A smaller
one is no reason to change the schedule."""

VISIBLE_CHANGE = 0.5
"""Least whitened change per cell with tracer, in standard deviations, of a visible effect."""

SAME_PLACE_M = 0.1
"""Distance of two leaks or zones that may be one [m]: as far as a weak gap leaves a place open."""
