"""Constants that decide, each with its unit and its reason.

They were set on 22 recordings of an independent simulator and on blinded cases of the virtual rig
(`./porotwin blind-check`, seeds 2 to 5, 80 cases of seed 8, 88 of seed 9 and 90 of seed 10).

Misfits are dimensionless: a whitened residual of 1 is one standard deviation of the noise and of a
front that lies `FRONT_TOLERANCE` cells off. Log-odds are natural logarithms of odds.
"""

# Decision ---------------------------------------------------------------------------------------

NO_GAP_MISFIT = 0.45
"""Normalised misfit of the model without effects below which there is no gap. Recordings without
an effect stay below it: noise and the errors of the scheme leave that much."""

SUFFICIENT_MISFIT = 0.53
"""Normalised misfit above which a single effect does not explain the gap. True effects stay below
it, effects that imitate a missing one seldom do."""

SUFFICIENT_PAIR_MISFIT = 0.6
"""The same threshold for a pair. It is higher because the scheme makes errors in both effects."""

UNRESOLVED_SHARE = 0.01
"""Share of the normalised misfit of a large gap that even the true effect leaves: no scheme follows
a strong effect exactly."""

PAIR_GAIN = 0.8
"""Ratio of the misfits of a pair and of the best single effect below which the second effect is
kept. Two effects always fit better than one, so that the second must earn its place."""

SYSTEMATIC_MISFIT = 0.16
"""Standard deviation of the misfit that the true effect leaves beyond the noise. Its cause is the
scheme, which misplaces fronts by 0.16 of the 0.12 cells of the front tolerance."""

INDISTINGUISHABLE = 0.06
"""Whitened root mean square difference of two predictions below which the camera shows the same."""

NO_GAP_LOG_ODDS, NO_GAP_SLOPE = 1.0, 4.0
"""Log-odds of `none` at the threshold `NO_GAP_MISFIT`, and their increase down to a misfit of 0."""

SUFFICIENT_LOG_ODDS, SUFFICIENT_SLOPE, SURELY_SUFFICIENT = 1.35, 8.0, 0.7
"""Log-odds that a model with a lack of fit from `SURELY_SUFFICIENT` to 1 misses nothing, and their
increase per unit of lack of fit below. Of the blinded cases one in nine was wrong above 0.7, one in
sixteen from 0.5 to 0.7, and one in 150 below 0.5."""

MISSING_SLOPE = 4.0
"""Increase, per unit of log(lack of fit), of the log-odds that a model misses something. They are 0
at a lack of fit of 1."""

ORDER_LOG_ODDS, ORDER_SLOPE = 0.4, 8.0
"""Log-odds that the first of two equally strong effects is the stronger one (equal strengths leave
this nearly open), and their increase per unit of log(ratio of strengths)."""

SCREENED_LOG_ODDS = 3.0
"""Least log-odds against an effect that was dropped before the final judgement. Its misfit on
coarse cells alone does not prove more than 1 : 20."""

SINGLE_SHARE_RANGE = (1e-3, 1 - 1e-3)
"""Range of the probability of the best single effect, so that its log-odds stay within 7."""

LEAST_LOG_ODDS = -60.0
"""Least log-odds of an effect, so that no exponential underflows."""

CONFIDENCE_RANGE = (0.05, 0.99)
"""Least and greatest confidence that is stated: a few hundred cases cannot prove more."""

CONTRADICTED_CONFIDENCE = 0.6
"""Confidence in `unexplained` where the misfit at the fronts names an effect and the held-out maps
contradict it."""

WORSENED = 1.02
"""Ratio of the held-out errors with and without the named effects above which the maps contradict
them. Smaller differences mean nothing: if the pumps rest at last, and the gap arose before, both
predictions hardly differ in the held-out part."""

SCANT_COLUMNS, SCANT_FRAMES, SCANT_CONFIDENCE = 80, 4, 0.7
"""A recording with fewer columns of cells, or fewer frames to fit to, is scant: no verdict on it
has a higher confidence. On 47 columns a shifted picture passed for a wrong rate, on 70 columns a
wrong rate passed for unexplained."""

LEAST_NUMERICAL_MISFIT = 1.5
"""Misfit of the configured scheme below which its numerical diffusion does not matter: a gap as
small as this is judged by its effects alone."""

SHARPER_SCHEME_GAIN = 0.75
"""Ratio of the misfits of the accurate and the configured scheme below which numerical diffusion is
named. Any finer scheme lowers the misfit a little, whatever causes the gap."""

INTERVAL_DEVIATIONS = 1.645 * 1.7
"""Half width of a 90 % interval in standard deviations: 1.645 for a normal distribution, times 1.7.
Errors of the scheme shift parameters too; without the factor the intervals held only two thirds of
the true values of the independent simulator."""

LEAST_EXPERIMENT_GAIN = 1.1
"""Least gain in the distance of two explanations for another experiment to be proposed. A smaller
one is no reason to change the schedule."""

VISIBLE_CHANGE = 0.5
"""Least whitened change per cell with tracer, in standard deviations, of a visible effect."""
