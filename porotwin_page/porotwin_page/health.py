"""The health of the nodes, in words."""

from porotwin_core.clock.freshness import RESTART_AFTER_S, STALE_AFTER_S
from porotwin_page.graph_snapshot import GraphSnapshot, Health, Level
from porotwin_page.json_values import Json, finite

LONGEST_TEXT = 60
"""Characters of the worst report in the header of the page."""

SUPERVISOR = 'supervisor'
"""Name of the node that tells which others are silent, as long as it reports itself."""

_ORDER = {'error': 0, 'silent': 1, 'warn': 2}
_SYMBOLS = {'error': '✖', 'silent': '✖', 'warn': '▲'}


def node_view(name: str, report: Health, steady: float, *, finished: bool, longest: float) -> Json:
    """Return the line of one node.

    A node that has left the graph is an error, unless it said so or the experiment is over.

    Args:
        name: name of the node.
        report: its last report, or the supervisor's on its silence.
        steady: present time on this machine's steady clock [s].
        finished: whether the experiment is over.
        longest: silence of a healthy node [s].
    """
    if report.present is False:
        over = finished or report.ended
        word, reason = ('quiet', 'ended') if over else ('error', 'not running')
        return {'name': name, 'level': word, 'message': reason, 'age_s': None}
    if report.level is Level.QUIET:
        return {'name': name, 'level': 'quiet', 'message': report.message, 'age_s': None}
    age = steady - report.arrival
    level, message = report.level, report.message
    if level is not Level.SILENT and age > longest:
        level, message = Level.SILENT, f'silent; last said: {message}'
    return {'name': name, 'level': level.value, 'message': message, 'age_s': finite(age, 3)}


def nodes_view(snapshot: GraphSnapshot, steady: float) -> list[Json]:
    """Return the lines of all nodes, errors and warnings first; `steady` as in `node_view`."""
    finished = snapshot.finished is not None
    supervisor = snapshot.health.get(SUPERVISOR)
    longest = STALE_AFTER_S
    if supervisor is not None and steady - supervisor.arrival <= supervisor.stale_after_s:
        # it judges who is silent, and starts a silent node again in time: whoever stays silent
        # longer is not watched by it
        longest = max(RESTART_AFTER_S, supervisor.stale_after_s)
    lines = [
        node_view(name, report, steady, finished=finished, longest=longest)
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
