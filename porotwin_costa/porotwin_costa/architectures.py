"""The networks by name, each with the training that suits it."""

from dataclasses import replace

from porotwin_core.errors import InputError
from porotwin_costa.network import COMPLEX_RIG, HOMOGENEOUS_RIG, LOCAL
from porotwin_costa.training import TrainingSettings

DEFAULT = 'paper'

TRAININGS: dict[str, TrainingSettings] = {
    'paper': TrainingSettings(network=HOMOGENEOUS_RIG, epochs=150, patience=40),
    'paper-complex': TrainingSettings(network=COMPLEX_RIG, epochs=150, patience=40),
    'local': TrainingSettings(
        network=LOCAL, epochs=30, batch_size=4, learning_rate=3e-3, patience=15, window=32
    ),
}
"""The paper's networks of sections 3.1 and 3.2, and the local one (`network.LocalFluxNetwork`)."""


def training_settings(name: str = '', *, epochs: int = 0) -> TrainingSettings:
    """Return the settings called `name` (empty: the paper's); `epochs` 0 keeps their number.

    Raises:
        InputError: there are none of that name; the message lists those there are.
    """
    name = name or DEFAULT
    if name not in TRAININGS:
        raise InputError(f"architecture '{name}': unknown; choose from {', '.join(TRAININGS)}")
    return replace(TRAININGS[name], epochs=epochs) if epochs else TRAININGS[name]
