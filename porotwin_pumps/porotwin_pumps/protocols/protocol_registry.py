"""All protocols of pumps by name."""

from porotwin_core.basis.discovery import discovered
from porotwin_pumps.protocols.pump_protocol import PumpProtocol

PROTOCOLS: dict[str, PumpProtocol] = discovered(
    __package__,
    'PROTOCOL',
    PumpProtocol,
    'docs/pumps.md',
    helpers=('pump_protocol', 'protocol_registry'),
)
"""All protocols by name, in alphabetical order."""
