"""Physics that a data-driven model has learnt: effects on top of those of rig.yaml.

The data-driven model keeps them in a file, and the solver runs them. Neither imports the other.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from porotwin_core.basis.errors import InputError
from porotwin_core.rig import EffectDescription


@dataclass(frozen=True)
class LearntPhysics:
    """Changes of flow and transport; none means the model as described.

    Attributes:
        effects: each on top of what the model has of it: factors multiply, other numbers add. The
            solver checks them.
        scheme: name of a sharper numerical scheme for single steps; empty: the scheme of the model.
            It belongs to the model, not to the sand: models over longer times keep their own.
    """

    effects: tuple[EffectDescription, ...] = ()
    scheme: str = ''

    def description(self) -> dict[str, Any]:
        """Return everything as JSON values."""
        return {'effects': [one.model_dump() for one in self.effects], 'scheme': self.scheme}

    @classmethod
    def from_description(cls, values: Mapping[str, Any]) -> Self:
        """Return the physics in a description as JSON keeps it.

        Raises:
            InputError: the description is of an older version, and not empty.
            KeyError, TypeError, ValueError: an entry is missing or wrong.
        """
        if 'effects' in values:
            effects = tuple(EffectDescription(**one) for one in values['effects'])
            return cls(effects, str(values['scheme']))
        coefficients = [value for name, value in values.items() if name != 'scheme']
        if any(value not in (0.0, [], [0.0, 0.0]) for value in coefficients):
            raise InputError(
                'learnt physics: of an older version, without effects; train again with '
                './porotwin train'
            )
        return cls((), str(values.get('scheme', '')))


NO_LEARNT_PHYSICS = LearntPhysics()
"""The model as it is described."""
