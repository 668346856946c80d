"""The health of the nodes, in words."""

from porotwin_page.graph_snapshot import GraphSnapshot, Health, Level
from porotwin_page.json_values import Json, finite

LONGEST_TEXT = 60
"""Characters of the worst report in the header of the page."""

_ORDER = {'error': 0, 'warn': 1}
_SYMBOLS = {'error': '✖', 'warn': '▲'}


def node_view(name: str, report: Health, steady: float, *, finished: bool) -> Json:
    """Return the line of one node.

    A node that has left the graph is an error, unless the experiment is over.

    Args:
        name: name of the node.
        report: its last report.
        steady: present time on this machine's steady clock [s].
        finished: whether the experiment is over.
    """
    if report.present is False:
        level, message = ('quiet', 'ended') if finished else ('error', 'not running')
        return {'name': name, 'level': level, 'message': message, 'age_s': None}
    age = None if report.level is Level.QUIET else finite(steady - report.arrival, 3)
    return {'name': name, 'level': report.level.value, 'message': report.message, 'age_s': age}


def nodes_view(snapshot: GraphSnapshot, steady: float) -> list[Json]:
    """Return the lines of all nodes, errors and warnings first; `steady` as in `node_view`."""
    finished = snapshot.finished is not None
    lines = [
        node_view(name, report, steady, finished=finished)
        for name, report in snapshot.health.items()
    ]
    return sorted(lines, key=lambda line: _ORDER.get(line['level'], len(_ORDER)))


def worst_view(nodes: list[Json]) -> Json:
    """Return level and text that sum up the lines of all nodes."""
    for level in _ORDER:
        affected = [node for node in nodes if node['level'] == level]
        if affected:
            text = f'{affected[0]["name"]}: {affected[0]["message"]}'
            text = text if len(text) <= LONGEST_TEXT else f'{text[: LONGEST_TEXT - 2]}…'
            others = f' (+{len(affected) - 1})' if len(affected) > 1 else ''
            return {'level': level, 'text': f'{_SYMBOLS[level]} {text}{others}'}
    return {'level': 'ok', 'text': f'✔ {len(nodes)} nodes' if nodes else ''}
