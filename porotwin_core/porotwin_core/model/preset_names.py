"""Names of the presets of the physics-based model, for help texts; `porotwin_solver` defines them.

The name alone needs no NumPy, so a command answers --help at once.
"""

PRESET_NAMES = ('fast', 'accurate', 'sharp', 'upwind', 'implicit')
"""Every preset of `porotwin_solver.model.presets`, in its order."""

PRESET_WORDS = f'{", ".join(PRESET_NAMES[:-1])} or {PRESET_NAMES[-1]}'
"""The same as words."""

FREE_PRESET_WORDS = f'{", ".join(PRESET_NAMES[:-2])} or {PRESET_NAMES[-2]}'
"""The presets of free runs: `implicit` is that of single intervals."""
