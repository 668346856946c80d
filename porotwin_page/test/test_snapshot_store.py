"""Tests of the store of snapshots."""

from page_examples import point

from porotwin_page.graph_snapshot import GraphSnapshot, with_cycle
from porotwin_page.snapshot_store import SnapshotStore


def test_every_update_is_counted_and_leaves_old_snapshots_unchanged() -> None:
    store = SnapshotStore()
    before = store.snapshot
    store.update(with_cycle, point(1))
    assert store.revision == 1
    assert before == GraphSnapshot()
    assert len(store.snapshot.history) == 1
