"""The health of the nodes, in words."""

from porotwin_core.clock.photo_interval import SILENT_INTERVALS, USUAL_PHOTO_INTERVAL_S
from porotwin_page.graph_snapshot import GraphSnapshot, Health, Level
from porotwin_page.json_values import Json, finite

LONGEST_TEXT = 60
"""Characters of the worst report in the header of the page."""

SILENT_AFTER_S = 10.0
"""Nodes report every second; after this time without a report a node is silent [s]."""


_ORDER = {'error': 0, 'silent': 1, 'warn': 2}
_SYMBOLS = {'error': '✖', 'silent': '✖', 'warn': '▲'}


def silent_after(report: Health, interval: float) -> float:
    """Return the longest time [s] between two reports, after which the node counts as silent.

    Args:
        report: its last report.
        interval: time between photographs [s].
    """
    expected = max(SILENT_AFTER_S, SILENT_INTERVALS * report.gap)
    return min(expected, max(SILENT_AFTER_S, SILENT_INTERVALS * interval))


def node_view(
    name: str,
    report: Health,
    steady: float,
    *,
    finished: bool,
    interval: float = USUAL_PHOTO_INTERVAL_S,
) -> Json:
    """Return the line of one node.

    A node that has left the graph is an error, unless it said so or the experiment is over. A node
    without reports is silent, even if another node reports for it.

    Args:
        name: name of the node.
        report: its last report.
        steady: present time on this machine's steady clock [s].
        finished: whether the experiment is over.
        interval: time between photographs [s].
    """
    if report.present is False:
        over = finished or report.ended
        word, reason = ('quiet', 'ended') if over else ('error', 'not running')
        return {'name': name, 'level': word, 'message': reason, 'age_s': None}
    if report.level is Level.QUIET:
        return {'name': name, 'level': 'quiet', 'message': report.message, 'age_s': None}
    age = steady - report.arrival
    level, message = report.level, report.message
    if level is not Level.SILENT and age > silent_after(report, interval):
        level, message = Level.SILENT, f'silent; last said: {message}'
    return {'name': name, 'level': level.value, 'message': message, 'age_s': finite(age, 3)}


def nodes_view(snapshot: GraphSnapshot, steady: float) -> list[Json]:
    """Return the lines of all nodes, errors and warnings first; `steady` as in `node_view`."""
    finished = snapshot.finished is not None
    interval = snapshot.photo_interval or USUAL_PHOTO_INTERVAL_S
    lines = [
        node_view(name, report, steady, finished=finished, interval=interval)
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
            shown = 'error' if level == 'silent' else level
            return {'level': shown, 'text': f'{_SYMBOLS[level]} {text}{others}'}
    count = '1 node' if len(nodes) == 1 else f'{len(nodes)} nodes'
    return {'level': 'ok', 'text': f'✔ {count}' if nodes else ''}
