"""Constants that decide, each with its unit and its reason.

They were set on 22 recordings of an independent simulator and on blinded cases of the virtual rig.

Misfits are dimensionless: a whitened residual of 1 is one standard deviation of the noise and of a
front that lies `FRONT_TOLERANCE` cells off. Ratios and factors are dimensionless as well.
"""

# Search -----------------------------------------------------------------------------------------

# The normalised misfit (`ranking.normalised_misfit`) and the ranking

NOISE_UNCERTAINTY = 1.1
"""Ratio of the true to the measured noise that is still plausible. The estimate comes from a
limited number of cells, and its error must not look like a gap."""

PENALTY_PER_PARAMETER = 1.08
"""Factor on the misfit of a judged fit for every parameter. A wrong effect with many parameters
takes up some of the errors of the schemes, so that each must lower the misfit by this factor."""

EXPLAINED_MISFIT = 0.5
"""Normalised misfit below which a fit leaves nothing for a second effect. It lies slightly below
the limit for a sufficient single effect, so that pairs are searched whenever a verdict may need
one."""

SMALL_GAP_MISFIT = 0.8
"""Normalised misfit of the model without effects below which it counts as the best model: point
spread and correction are then measured without any effect, which could adapt to the noise."""

NEARLY_CLOSED_MISFIT = 1.5
"""Normalised misfit below which a fit nearly closes the gap. Only then do its fronts lie close
enough to the observed ones for a multifidelity correction and an estimate of the point spread, and
only then is a search through more pairs worth its time."""

CORRECTABLE_MISFIT = 4.0
"""Misfit of a model below which runs on coarse cells are corrected by the difference to the judging
cells. Above it fronts lie more than about half a cell apart, and the correction, which stays in
place, would miss them."""

# Selection of the fits that go on

CLOSE_TO_BEST = 1.5
"""Ratio of the misfits of a fit and of the best one above which the fit is dropped. It balances
time against the risk that coarse cells rank the true effect too low."""

TIE = 1.03
"""Ratio of two misfits that counts as a tie: fits tied with the last selected one are selected."""

UNPROMISING = 2.0
"""Ratio of the coarse misfits of a fit and of the best one above which the fit is not continued on
fine residuals. It is wider than `CLOSE_TO_BEST`, since few iterations were made."""

REFINED_FITS = 7
"""Largest number of fits refined on the cells of the recording; it bounds the time."""

JUDGED_FITS = 4
"""Largest number of fits judged on fine cells, where a simulation takes about eight times as long:
twice as many cells each way, and twice as many time steps."""

REFITTED_SINGLES = 6
"""Largest number of single effects fitted again on newly corrected cells before pairs are made; it
bounds the time."""

WELL_DISTANCE = 5.0
"""Distance [cells of the recording] from the rim of a well. A leak within it cannot be told from a
wrong rate of that well."""

# Places of a leak or a zone

STARTING_PLACES = 3
"""Number of places where fits of an effect start. The linear response on a coarse grid ranks places
only roughly, so that the first one need not be the right one."""

# Pairs

PAIR_BASES = 3
"""Largest number of single effects that get partners, beside the best judged one."""

PAIR_PARTNERS = 4
"""Number of partners that are fitted beside each base, chosen by their linear response; it bounds
the time."""

PAIR_BASE_MISFIT = 1.8
"""Ratio of the misfits of a single effect and of the best one above which no pairs are made from
it. It is generous: the effect that imitates a pair best need not be a member of the pair."""

PAIR_PENALTY_PER_PARAMETER = 1.05
"""Factor on the misfit of a screened pair for every parameter. It is less than
`PENALTY_PER_PARAMETER`, since screening only has to keep the right pair."""

PARTNER_GAIN_PER_PARAMETER = 0.85
"""Factor on the linear gain of a partner for every parameter: many parameters imitate much."""

EXCHANGE_MISFIT = 3.0
"""Normalised misfit of a judged pair above which its members are not exchanged again. An exchange
keeps one member, and in a pair that leaves so much probably neither is right."""

MOST_EXCHANGES = 4
"""Largest number of times that the best pair exchanges a member. Exchanges end earlier if the score
no longer decreases."""

RELOCATED_PAIRS = 2
"""Number of pairs with a leak or a zone that are tried at other places, and number of places."""
