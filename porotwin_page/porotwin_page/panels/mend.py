"""The newest offer of a diagnosis to mend the model, with buttons while it waits for an answer."""

from porotwin_page.graph_snapshot import GraphSnapshot
from porotwin_page.json_values import Json
from porotwin_page.panel import Moment, Region, ScriptPanel


def mend_view(snapshot: GraphSnapshot, _: Moment) -> Json | None:
    """Return the newest offer; None before the first one."""
    offer = snapshot.offer
    if offer is None:
        return None
    return {
        'sequence': offer.sequence,
        'state': offer.state,
        'open': offer.is_open,
        'time_s': offer.time,
        'sentence': offer.sentence,
        'confidence_percent': round(100.0 * offer.confidence),
        'report': bool(offer.report),
    }


PANEL = ScriptPanel(title='The model', region=Region.ACTIONS, order=30, view=mend_view)
