"""Every tuning constant of the imaging, with its unit and its reason, grouped by step.

A step takes its group as an argument, so that a test or a special camera can change one value:

    from dataclasses import replace
    settings = replace(DEFAULTS, total_variation=TotalVariationSettings(weight_m=2e-4))
    baseline = make_baseline(rig, grid, photographs, settings=settings)

Lengths in pixels [px] refer to the decoded photograph unless the docstring names another picture.
"""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class TotalVariationSettings:
    """Denoising by total variation (`total_variation.py`)."""

    weight_m: float = 1e-4
    """Total variation weight [m]: a disc of radius r loses 2 weight / r of its height. At 0.1 mm a
    plume of 2 cm radius loses 1 %."""
    tolerance: float = 4e-3
    """Accepted root mean square distance from the exact minimiser [-]; less costs iterations."""
    most_iterations: int = 1000
    """The iteration stops here even if the tolerance is not reached."""
    least_data_weight: float = 0.05
    """Data weights are raised to this [-]. The accelerated method needs strong convexity."""
    tiled_from_cells: int = 1_000_000
    """Maps with more cells are solved in tiles."""
    tile_cells: int = 256
    """Side of a tile [cells]: its overlap costs a third, its arrays nearly fit a core's cache."""
    halo_cells: int = 24
    """Overlap of neighbouring tiles [cells]; cells further away hardly influence each other."""
    threads: int = 2
    """Threads that solve tiles at the same time."""


@dataclass(frozen=True)
class LevelSmoothingSettings:
    """Smoothing along the levels of concentration (`level_smoothing.py`)."""

    reach_m: float = 0.015
    """Standard deviation of the average along a level [m]. A plume bends on a longer way."""
    reach_cells: tuple[float, float] = (1.5, 5.0)
    """Least and largest reach [cells]."""
    clean_reach: float = 2.3
    """Total variation averages clean sand further than a level, by this factor [-]."""
    guide_blur_m: float = 0.004
    """Blur of the map that gives the levels [m], so that they do not follow the noise."""
    guide_blur_cells: tuple[float, float] = (0.5, 1.5)
    """Least and largest blur [cells]: a front of two cells must stay."""
    least_tracer: float = 0.01
    """Where no value within reach exceeds this there is no tracer to correct [-]."""
    most_columns: int = 400
    """Maps with more columns are corrected on coarser cells."""
    least_share: float = 0.3
    """Visible share of a coarse cell below which it does not count [-]."""


@dataclass(frozen=True)
class SharpeningSettings:
    """Taking the blur of the camera back (`front_sharpening.py`)."""

    blur_px: float = 0.7
    """Standard deviation of the blur of tracer in a photograph whose fronts were not compared with
    a model [px of the file]: JPEG and demosaicing alone. Fronts on composed photographs tell 1.2 to
    2.8 px. Taking too much back invents steep fronts, and costs more than taking too little."""


@dataclass(frozen=True)
class DecodingSettings:
    """Which photographs are refused when they are decoded (`photo_file.py`)."""

    dark_level: int = 12
    """Grey level (0 to 255). A photograph is black if its 99.5th percentile is lower."""
    bright_level: int = 250
    """Lowest grey level (0 to 255) of over-exposed pixels."""
    most_bright: float = 0.5
    """Largest accepted share of over-exposed pixels [-]."""


@dataclass(frozen=True)
class SamplingSettings:
    """How finely a photograph is decoded and sampled (`sampling.py`)."""

    least_pixels_per_cell: float = 1.4
    """Decoded pixels per cell in each direction that a coarser decoding must leave [px]."""
    least_pixels_per_fine_cell: float = 1.2
    """The same limit for the last step from half to full resolution, which costs the most time."""
    least_columns: int = 1200
    """Width [px] below which alignment to the baseline becomes inaccurate."""


@dataclass(frozen=True)
class AlignmentSettings:
    """Alignment of a photograph to the baseline (`alignment.py`)."""

    widest_px: int = 2000
    """Wider pictures are reduced before features are tracked; tracking costs time per pixel."""
    tracked_points: int = 1200
    """Features over the whole rig: enough even if tracer or a hand spoils many of them."""
    tiles_across: int = 8
    """Features are chosen in 8 x 8 tiles, so that they cover the rig evenly."""
    patch_px: int = 21
    """Side of a tracked patch [px], several grains wide."""
    normalisation_px: int = 31
    """Window of the local mean and spread of brightness [px], wider than a patch."""
    closure_px: float = 0.3
    """A feature tracked forth and back must return to within this distance [px]."""
    ransac_tolerance_px: float = 0.6
    """Largest distance of an inlier from the homography [px]."""
    fewest_inliers: int = 40
    """Inliers below which the photograph does not match; a homography needs four."""
    least_inlier_share: float = 0.35
    """Share of the tracked features that must be inliers [-]; other sand matches only by chance."""
    reported_shift_px: float = 2.0
    """Larger shifts of the camera are mentioned in the status [px of the file]."""
    suspicious_residual_px: float = 0.35
    """Residual of the homography that marks a map as suspicious [px]: the picture is deformed."""


@dataclass(frozen=True)
class ColourCheckerSettings:
    """Finding and judging the colour chart (`colour_checker.py`)."""

    worst_fit: float = 0.2
    """Largest misfit of a chart to its published colours, relative to their spread [-]."""
    least_spread: float = 0.02
    """Spread of linear colours below which the surface is even and no chart [-]."""
    over_exposed: float = 0.955
    """Lowest linear value of over-exposed patches, grey level 250 [-]."""
    least_light: float = 0.05
    """Darker patches of the baseline are not used for the gain: noise dominates them [-]."""
    fewest_patches: int = 4
    """Fewest patches per channel whose median ratio is a reliable gain."""
    darkest: float = 0.005
    """Darker patches of the baseline do not show haze [-]: a channel without light is clipped."""
    least_veil: float = 0.002
    """Haze that the chart shows [linear light]. It is below 0.001 on rendered and composed
    photographs without haze."""
    least_power: float = 0.03
    """Change of the power of the tone curve that the chart shows [-]."""
    most_power_misfit: float = 0.02
    """Scatter of the patches about another tone curve above which it is none [log ratio]."""
    least_diagonal: float = 0.2
    """Smallest plausible diagonal element of a colour matrix [-]."""
    most_moved: float = 0.01
    """Distance of the chart from its given place, relative to the width of the photograph, above
    which camera or rig have probably moved since the corners were marked [-]. People read corners
    to 0.1 to 0.3 % of the width."""
    most_mixing: float = 0.8
    """Largest plausible sum of off-diagonal elements relative to the diagonal one [-]."""


@dataclass(frozen=True)
class LightSettings:
    """Estimating the drift of light since the baseline (`light_drift.py`)."""

    least_background: float = 0.1
    """Share of the visible cells that must be free of tracer to fit the drift [-]."""
    tolerance: float = 0.06
    """Cut-off of Tukey's biweight [log ratio]: cells further from the drift are no background."""
    search_range: float = 0.25
    """Largest difference between chart and sand that can be light [log ratio]."""
    told_slope: float = 0.2
    """Slope of the light over the rig above which a remark tells it [log ratio]. It is below 0.08
    on rendered and composed photographs."""
    told_cast: float = 0.08
    """Difference between the channels that is told [log ratio]; below 0.02 on the same ones."""
    rounds: int = 6
    """Reweighted fits before the surroundings of tracer are left out, and again after that."""
    most_cells: int = 12_000
    """Cells used of a finer map: the drift varies slowly, a regular subset is enough."""
    histogram_bin: float = 0.01
    """Bin width of the histogram for the start value [log ratio]."""
    most_brighter: float = 0.08
    """Cells that are brighter than the baseline by more show a reflection [log ratio]. On real and
    rendered photographs the averages over 3 x 3 cells stay below 0.022."""
    most_brighter_share: float = 0.15
    """Photographs that are brighter on more than this share of the sand are refused [-]."""


@dataclass(frozen=True)
class ToneSettings:
    """Another tone curve, or haze (`tone_change.py`)."""

    least_spread: float = 0.15
    """Spread of the brightness of the sands that shows a change of tone [log]."""
    least_slope: float = 0.006
    """Drift of the log ratio with the log of brightness from which a change is searched [-]. It is
    below 0.003 on real and rendered photographs."""
    brighter: float = 0.05
    """Cells that are brighter by more count as a sign of it [log ratio]; single cells are noisy."""
    brighter_share: float = 0.03
    """Share of such cells from which a change is searched [-]. In ordinary photographs it is 0."""
    most_level: float = 0.03
    """By so much may haze on the chart fit the level of clean sand worse than light alone [log]:
    light differs between chart and sand."""
    least_gain: float = 1.03
    """Sand that follows one smooth light after the correction, relative to before [-]."""


@dataclass(frozen=True)
class LocalLightSettings:
    """Soft shadows and lamps (`local_light.py`)."""

    blocks_across: int = 140
    """Blocks of cells across the rig whose light is judged: enough for soft shadows."""
    nodes_across: int = 28
    """Nodes of the field of light across the rig; soft edges are a few nodes wide."""
    least_share: float = 0.3
    """Visible share of a block that counts [-]."""
    darkest: float = 0.9
    """Blocks that are darker by more are no soft shadow [log ratio]: 40 % of the light."""
    most_brighter: float = 0.08
    """Brighter places are corrected by at most so much [log ratio]; more is a reflection."""
    least_change: float = 0.02
    """Missing light that no ordinary photograph has [log ratio]; there it stays below 0.01."""
    least_part: float = 0.01
    """Share of the sand without tracer that must be changed so [-]."""
    tolerance: float = 0.06
    """Cut-off of Tukey's biweight [log ratio]: blocks further from the field show objects."""


@dataclass(frozen=True)
class ForeignSignalSettings:
    """Changes that tracer cannot make (`foreign_signal.py`).

    The limits hold for averages over small windows. In brackets: the largest values on real and
    rendered photographs of tracer.
    """

    most_brighter: float = 0.1
    """Brightening of one colour channel [log ratio] (0.053)."""
    hue_error: float = 0.05
    """Hue that noise and light make [log ratio] (0.04)."""
    most_turned: float = 0.8
    """Hue across the direction of the dye relative to the hue along it [-] (0.6)."""
    least_dark: float = 0.15
    """Darkening from which the hue of the dye must be seen [log ratio]."""
    least_hue: float = 0.3
    """Hue relative to the hue of tracer that darkens as much [-] (0.5)."""
    line_cells: int = 7
    """Cells across a window that a thin line does not fill: tubes are thinner."""
    line_depth: float = 0.08
    """Darkening of a thin line relative to its sides [log ratio] (0.05): 5 % of stock."""
    most_share: float = 0.15
    """Share of the sand above which a photograph is refused [-]."""
    most_left_out: float = 0.25
    """The same for these changes, reflections and the surroundings of both together [-]."""


@dataclass(frozen=True)
class BaselineMaskSettings:
    """Where the baseline shows sand (`baseline_mask.py`)."""

    least_light: float = 0.012
    """Linear brightness below which a sample is frame or deep shadow [-]."""
    over_exposed: float = 0.955
    """Lowest linear value of over-exposed channels, grey level 250 [-]."""
    reported_over_exposed: float = 0.005
    """Share of over-exposed samples from which it is reported [-]; bolts and glass reflect less."""
    smooth_texture: float = 0.25
    """Texture relative to the median of the rig below which there is water instead of sand [-]."""
    detection_columns: int = 900
    """Width of the picture for the search of objects [px]; shows tubes of 1/400 of the rig."""
    object_core: float = 6.0
    """Colour deviation of the core of an object [local spreads]."""
    object_edge: float = 3.0
    """Colour deviation of the edge of an object [local spreads]."""
    smallest_object_m: float = 0.03
    """Shorter objects are grains [m]."""


@dataclass(frozen=True)
class ValiditySettings:
    """Which cells of one photograph show their sand (`validity.py`)."""

    least_visible_share: float = 0.3
    """Share of a cell that must be visible for the cell to have a value [-]."""
    most_clipped_samples: float = 0.05
    """Share of over-exposed samples above which a cell has no value [-]. The darker grains that
    remain are not the same everywhere."""
    most_over_exposed: float = 0.25
    """Photographs that are over-exposed on more than this share of the sand are refused [-]."""
    most_hidden: float = 0.4
    """Photographs that hide or damage more than this share of the sand are refused [-]."""
    least_correlation: float = 0.25
    """Correlation with the grains of the baseline below which they are hidden [-]. It is 0.3 behind
    the strongest tracer of the real photographs, and about 0 on a hand or in a damaged file."""
    least_texture: float = 0.02
    """Contrast of grains in the baseline below which there is no pattern to compare [-]."""
    windows_across: int = 40
    """Grain patterns are compared in windows of this fraction of the width of the rig."""


@dataclass(frozen=True)
class ThinObjectSettings:
    """Tubes and cables that were laid before the sand after the baseline (`thin_objects.py`)."""

    core: float = 6.0
    """Scatter in a block relative to its surroundings that shows an object [-]."""
    edge: float = 4.0
    """The same for the blocks between [-]."""
    least_length: float = 14.0
    """Length of an object [blocks]. In ordinary photographs blocks join to at most 11."""
    least_seeds: float = 0.5
    """Blocks above `core` per block of its length [-]."""


@dataclass(frozen=True)
class NoiseSettings:
    """Standard deviation of a map (`baseline_subtraction.py`, `denoising.py`)."""

    correlated_samples: float = 3.3
    """Neighbouring samples that share one error, because JPEG and interpolation smear it."""
    fewest_samples_across: int = 5
    """Samples in each direction needed to estimate the scatter; smaller cells are pooled."""
    remaining_noise: float = 0.77
    """Noise of a map relative to the noise that is propagated through its steps [-]. Samples share
    less of it than assumed. Fitted to composed photographs, as are the next two."""
    place_error: float = 3e-4
    """Standard deviation of the place of a cell relative to the width of the rig [-]: half a pixel
    of 1600, from alignment and from corners that a person reads off. On the large FluidFlower, the
    lines of a laser grid deviate by 1.0 mm on 2.8 m, 3.6e-4."""
    blur_cells: float = 0.21
    """Standard deviation of the blur of a front that is left in a map, or that was taken back too
    much [cells]: 1.2 px on composed photographs with 5.5 px per cell."""
    credible: tuple[float, float] = (-0.5, 1.5)
    """Concentrations are clipped to this range before denoising [-]. Values beyond it are noise of
    a single cell and must not spread."""


@dataclass(frozen=True)
class LightErrorSettings:
    """Error of the map from light that differs from the baseline (`light_error.py`)."""

    measured: float = 3e-4
    """Standard deviation of the drift of light on clean sand, where it is measured [log ratio]."""
    below_plume: float = 2e-3
    """The same where clean sand is far: the drift is continued by a quadratic [log ratio]."""
    reach: float = 0.02
    """Distance over which clean sand tells the light, relative to the width of the map [-]."""
    clean: float = 0.01
    """Lower values are clean sand [-]."""
    full: float = 0.7
    """Higher values show the colour of tracer stock [-]."""
    fewest_full_cells: int = 100
    """Cells that determine this colour."""
    smoothing_cells: float = 3.0
    """Width of the local mean of colours [cells]; light changes slowly."""
    most_columns: int = 400
    """Maps with many more columns are judged on coarser cells."""
    front_step: float = 0.02
    """Larger steps between cells are fronts [-]."""
    colour_tolerance: float = 0.02
    """Smaller changes of colour are noise or drift [log ratio]."""
    dye_tolerance: float = 0.06
    """The same for tracer stock: its colour differs from sand to sand [log ratio]."""


@dataclass(frozen=True)
class SandSettings:
    """Telling sands apart and scaling them (`sands.py`)."""

    most_sands: int = 6
    """Classes of the k-means clustering, more than the sands of a rig."""
    fewest_cells: int = 50
    """Visible cells below which the rig counts as one sand."""
    separation: float = 3.0
    """Distance of two classes below which they are one sand [spreads of their features]."""
    least_spread: float = 0.05
    """Smallest spread of a feature [log]: light and lens alone cause this much."""
    smallest_share: float = 0.004
    """Smaller patches, relative to the rig, are merged into the sand around them [-]."""
    interface_reach_cells: int = 3
    """Texture shows an interface to within this many cells; the edge is searched there."""
    lamp_jump: float = 0.05
    """Jump of a colour channel at an interface below which it is no edge of a sand [log]."""
    lamp_texture: float = 0.25
    """Difference of texture across an interface below which it is no edge of a sand [log]."""
    least_signal: float = 0.3
    """Signal on both sides of an interface, relative to the strong signal of all sands [-]. Paler
    tracer at an interface has often not entered the finer sand."""
    fewest_pairs: int = 12
    """Pairs of cells across interfaces that determine a factor."""
    pairs_together: float = 12.0
    """Neighbouring pairs that share one error: grains, fronts and labels extend over cells."""
    jump_error: float = 0.1
    """Standard deviation of the true jump of the signal at an interface [log]: tracer flows along
    it on one side only. On composed photographs it is up to 0.17."""
    bright_slope: float = 0.6
    """Fall of the log signal of stock per log of light, for sands brighter than the reference. The
    law of Kubelka and Munk gives 0.5 to 0.8 for reflections of 0.3 to 0.6 and dye that absorbs ten
    times as much as sand."""
    dark_slope: float = 0.1
    """The same for darker sands; the law gives 0.2 for reflections of 0.1 to 0.2, and shadow at an
    edge is no property of the sand."""
    prior_deviation: float = 0.15
    """Standard deviation of the log factors before any evidence. Those fitted to photographs of the
    large FluidFlower differ by up to 0.3 from the law, those of composed photographs by 0.09."""
    same_sand_error: float = 0.08
    """Standard deviation of the log factors of two parts that the rig describes as one sand:
    packing, and light that the picture does not tell from sand. An estimate."""
    place_error: float = 0.02
    """Relative standard deviation of the signal of stock from place to place in a sand [-]. A small
    core tells only its own place. An estimate."""
    described_reach_cells: int = 4
    """The edges of the described sands are known to this many cells, 28 mm on 2.8 m."""
    described_share: float = 0.008
    """Smaller parts of a described sand, relative to the rig, join the sand around them [-]."""
    most_described: int = 12
    """More permeabilities than this are no sands but a field."""
    widest_factor: float = 2.5
    """Largest factor of a sand, and the inverse of the smallest."""


@dataclass(frozen=True)
class CoreSettings:
    """Finding the core of a plume (`plume_core.py`)."""

    edge_share: float = 0.4
    """The edge of a plume lies at this share of the strong signal [-]. Stock in fine sand gives
    about half the signal of stock in coarse sand."""
    fewest_cells: int = 40
    """Cells of a core: their median is known to 1 % although grains scatter by 5 %."""
    plateau_share: float = 0.88
    """Cells of the core exceed this share of its top [-]. Paler plumes beside it are no core."""
    least_share: float = 0.3
    """Share of the plume that its core has at least [-]: the level of few cells is uncertain."""
    reached: float = 0.99
    """The plateau begins at this share of the highest level [-]."""
    flattest: float = 0.025
    """Largest rise inside a core [-]; a plume that rises further has no plateau."""
    level_error: float = 0.007
    """Relative standard deviation of the level of a core [-]: light, and stock that is not quite
    reached."""
    outlier: float = 0.04
    """Photographs whose core differs from the others by more disagree with them [-]."""
    interface_cells: int = 2
    """Cells this near to another sand belong to no core: pixels and labels mix there."""


@dataclass(frozen=True)
class MassBalanceSettings:
    """Comparing the imaged with the injected mass (`mass_balance_fit.py`)."""

    fewest_photographs: int = 3
    """Photographs that give the level of stock by their mass and reveal an outlier."""
    log_error: float = 0.012
    """Relative deviation of the injected mass in the pores [-]: pumps, porosity and depth as a
    careful laboratory knows them. Larger differences occur, so its distribution has wide tails."""
    most_factor: float = 5.0
    """Largest ratio of imaged to injected mass that is considered, and its inverse smallest."""
    photograph_error: float = 0.005
    """Relative deviation of the mass in one photograph [-], from light and noise."""
    common_error: float = 0.003
    """The same relative to the largest injected mass."""
    independent_photographs: int = 12
    """More photographs tell the bend no better than this number: neighbours share the error of
    their light."""
    offset_error: float = 0.01
    """Deviation of the mass at zero injection, relative to the largest injected mass [-]: dead
    volume of the tubes, remaining light."""
    faulty_offset: float = 0.06
    """The same in an experiment with a fault [-]: a clock that is minutes off, a reflection."""
    fault_share: float = 0.05
    """Share of the experiments that have such a fault [-]."""
    outlier_distance: float = 0.03
    """Photographs that are farther from the common line disagree with it, relative to the largest
    injected mass [-]."""
    expected_bend: float = -0.02
    """Bend before any evidence [-]: light that the dye does not reach, from the glass and from the
    fronts of grains, bends absorbance. Three percent of stray light give -0.02."""
    bend_deviation: float = 0.07
    """Standard deviation of the bend before any evidence [-]: dyes differ. A narrow one would pull
    strong bends, which fronts or dilutions tell, towards the straight line."""
    dilution_error: float = 0.01
    """Standard deviation of the concentration in a photograph of a known dilution [-]."""


@dataclass(frozen=True)
class FrontSettings:
    """The bend of the response and the blur of the camera from fronts (`front_response.py`)."""

    dispersivities_m: tuple[float, ...] = (0.0, 1e-4, 5e-4, 1.6e-3, 4e-3)
    """Dispersivities along the flow that are modelled [m], from none to that of coarse gravel."""
    level_error: float = 0.012
    """Standard deviation of the volume above a level, relative to the width of a front [-]: grains
    and cells. On composed photographs it is 0.007 to 0.013."""
    offset_error: float = 3e-4
    """Standard deviation of the volume at zero injection, relative to the largest [-]: dead volume
    and clocks. An offset of 0.002 that nobody tells bends the response by 0.025."""
    faulty_offset: float = 0.06
    """The same in an experiment with a fault [-]: a clock that is minutes off, a reflection."""
    photograph_error: float = 2e-4
    """Standard deviation of the volume of one photograph, relative [-]: light."""
    factor_error: float = 0.1
    """Standard deviation of the common factor of all volumes [-]: porosity, sorption, pumps."""
    model_error: float = 0.015
    """Standard deviation of the bend from a model that is not the rig [-], if it fits to
    `level_error`: 0.01 on composed photographs. It grows with the misfit."""
    most_misfit: float = 0.06
    """Larger distances from the model are no evidence, relative to the width of a front [-]."""
    least_share: float = 0.1
    """Photographs with less of the largest injected volume are not compared [-]."""
    most_photographs: int = 5
    """Photographs that are compared, small and large plumes; more cost time."""
    fewest_photographs: int = 3
    """Photographs that tell the bend from the factor of all volumes."""
    surest_factor: float = 0.05
    """Sands with a larger relative deviation of their factor do not count [-]."""


@dataclass(frozen=True)
class CalibrationSettings:
    """The calibration from photographs of an injection (`calibration_fit.py`)."""

    columns: int = 400
    """Cells across the rig during calibration, and width of the picture of sands [px]."""
    tracer_share: float = 0.3
    """Cells above this share of the strongest signal count as tracer for the weights [-]."""
    fewest_tracer_cells: int = 30
    """Cells with tracer that determine the weights of the channels."""
    least_log_ratio: float = 0.05
    """A strongest signal below this is no tracer [log ratio]."""
    least_signal: float = 0.002
    """Smoothed signal below which there is no tracer, however even the background is [-]."""
    scale_error: float = 0.025
    """Relative standard deviation of a scale from the pump log [-]: an estimate."""
    scale_error_without_log: float = 0.1
    """The same if the strongest signal is taken for tracer stock [-]."""
    stock_percentile: float = 95.0
    """Percentile of the strong signals that is taken for tracer stock without a pump log."""


@dataclass(frozen=True)
class TrustSettings:
    """When a calibration is refused, and when a user is told (`calibration_trust.py`).

    Porosity, depth and sorption of a rig are rarely known better than to 10 %, a pump log is.
    """

    most_mass_factor: float = 1.25
    """Largest ratio of tracer in the plume to injected tracer, either way [-]. The core gives the
    level of stock, so that the maps are right up to it; beyond it the log is of something else."""
    most_filled_factor: float = 1.15
    """The same for the pores that the plume fills, where no core tells the level of stock [-]. Then
    the pump log alone gives the scale, so that it must agree better. A plume too small for a core
    seems larger than it is."""
    told_mass_error: float = 0.03
    """Difference of tracer in the maps and in the pump log that is told [-]."""
    sure_deviations: float = 2.0
    """Standard deviations from which a difference is told [-]."""
    most_offset: float = 0.14
    """Largest tracer at the start of the pump log, relative to the injected [-]."""
    told_offset: float = 0.05
    """Tracer at the start of the pump log that is told [-]."""
    least_hollow: float = 0.6
    """Least signal at the injecting well relative to the level of the plume [-]."""
    least_followers: float = 0.6
    """Least share of photographs that agree with each other [-]."""
    core_noise: float = 0.02
    """Difference of two cores that noise causes at most [-]: two deviations of the difference of
    two levels with `CoreSettings.level_error`."""
    fewest_core_levels: int = 4
    """Levels one after the other, each beyond the noise, that make a trend of the cores. A lamp or
    a moved camera makes two, before and after."""
    most_mass_misfit: float = 0.08
    """Largest scatter of the photographs about the pump log, relative to the injection [-]."""
    most_factor: float = 4.0
    """Largest factor between two sands [-]. Real sands differ by less than 2."""
    least_strongest: float = 0.85
    """Least concentration of the injected fluid, relative to stock [-]."""
    most_bend: float = 0.17
    """Largest deviation of the response from a straight line at half stock [-]; it may be exceeded
    by its standard deviation. A dye that bends as much in absorbance would lose a third of its
    effect from pale to stock. A tracer that fades bent an injection to 0.172 with a deviation of
    0.05, and the diagnosis of its maps named the decay."""
    most_bend_conflict: float = 0.08
    """Largest difference between the bend by fronts and that by all evidence [-]: three standard
    deviations. Where they agree it is below 0.025."""
    most_core_slope: float = 0.15
    """Largest relative difference of signal between the inner and the outer half of the core."""
    most_dilution_misfit: float = 0.1
    """Largest difference between known and imaged dilutions [-]. Mixing and light cause 0.03."""
    told_dilution_misfit: float = 0.04
    """Difference between known and imaged dilutions that is told [-]."""
    most_apart: float = 0.05
    """Largest distance of a plume from the wells that inject it, relative to the width of the rig
    [-]. Injected tracer begins at its well."""
    most_bow: float = 0.012
    """Largest depth of the frame in the middle of a side, relative to the size of the rig [-]. On
    the large FluidFlower it is 0.022 without the terms of curvature and 0.001 with them."""
    told_bend_deviation: float = 0.028
    """Error of the response at half stock that is told [-]."""


@dataclass(frozen=True)
class PhaseSettings:
    """Maps of water, dissolved CO2 and gas (`phase_colours.py`, `phase_segmentation.py`)."""

    least_change: float = 0.08
    """Smaller changes of colour are water [log]: light and grains cause up to 0.05."""
    most_uneven: float = 0.6
    """Range of a colour around a cell, relative to it, above which the cell lies at an edge [-]."""
    least_share: float = 0.002
    """Changed cells, relative to the sand of a photograph, that show the colour of a phase [-]."""
    apart: float = 0.45
    """Difference of two colours, relative to the stronger one, below which they are one [-]."""
    least_cluster: float = 0.02
    """Share of the changed cells below which a cluster joins the nearest one [-]."""
    least_gas: float = 0.05
    """Brightening of every channel in gas [log]: dry sand without indicator."""
    same_hue: float = 0.96
    """Cosine between two changes of colour from which they have one hue [-]."""
    cells_for_sand: float = 40.0
    """Cells that give a sand colours of its own; fewer are drawn to the colours of all sands."""
    least_spread: float = 0.04
    """Standard deviation of the colour of a cell that is added to its scatter [log]."""
    most_samples: int = 60_000
    """Most cells that are used to find colours; more tell nothing more."""
    sharpness: float = 0.5
    """Factor on the costs of colours, which are not independent from cell to cell [-]."""
    coupling: float = 4.0
    """Gain in log probability if all neighbours have the same phase [-]."""
    doubt: float = 0.5
    """Exponent of the probabilities: the model knows nothing of blur and place at edges [-]. Fitted
    to rendered photographs."""
    foreign: float = 0.25
    """Distance from all colours and their mixtures that no phase explains [log]."""
    foreign_share: float = 0.4
    """The same relative to the change of colour [-]."""
    told_foreign: float = 0.001
    """Share of the sand with the colour of no phase that is told [-]."""


@dataclass(frozen=True)
class ImagingSettings:
    """The settings of all steps."""

    total_variation: TotalVariationSettings = field(default_factory=TotalVariationSettings)
    level_smoothing: LevelSmoothingSettings = field(default_factory=LevelSmoothingSettings)
    sharpening: SharpeningSettings = field(default_factory=SharpeningSettings)
    decoding: DecodingSettings = field(default_factory=DecodingSettings)
    sampling: SamplingSettings = field(default_factory=SamplingSettings)
    alignment: AlignmentSettings = field(default_factory=AlignmentSettings)
    colour_checker: ColourCheckerSettings = field(default_factory=ColourCheckerSettings)
    light: LightSettings = field(default_factory=LightSettings)
    tone: ToneSettings = field(default_factory=ToneSettings)
    local_light: LocalLightSettings = field(default_factory=LocalLightSettings)
    foreign_signal: ForeignSignalSettings = field(default_factory=ForeignSignalSettings)
    baseline_mask: BaselineMaskSettings = field(default_factory=BaselineMaskSettings)
    validity: ValiditySettings = field(default_factory=ValiditySettings)
    light_error: LightErrorSettings = field(default_factory=LightErrorSettings)
    thin_objects: ThinObjectSettings = field(default_factory=ThinObjectSettings)
    noise: NoiseSettings = field(default_factory=NoiseSettings)
    sands: SandSettings = field(default_factory=SandSettings)
    core: CoreSettings = field(default_factory=CoreSettings)
    fronts: FrontSettings = field(default_factory=FrontSettings)
    mass_balance: MassBalanceSettings = field(default_factory=MassBalanceSettings)
    calibration: CalibrationSettings = field(default_factory=CalibrationSettings)
    trust: TrustSettings = field(default_factory=TrustSettings)
    phases: PhaseSettings = field(default_factory=PhaseSettings)


DEFAULTS = ImagingSettings()
"""The settings of all nodes and commands."""
