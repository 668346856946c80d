"""The advection schemes by name."""

from enum import IntEnum


class Scheme(IntEnum):
    """How `transport` computes the concentration on a face.

    The kernels compare an integer with these members; an integer is cheaper to pass than a member.
    """

    UPWIND = 0
    """First order: the concentration of the upstream cell."""

    SUPERBEE = 1
    """Second order: Lax-Wendroff slopes with the superbee limiter."""

    THIRD_ORDER = 2
    """QUICKEST slopes, third order where the field is smooth, kept within the superbee region."""

    COMPRESSIVE = 3
    """The same as SUPERBEE with the wider bounds that short substeps allow: the sharpest fronts."""
