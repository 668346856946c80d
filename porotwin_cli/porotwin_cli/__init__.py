"""The porotwin command: demo, up, simulate, image, train, record, replay, bench and test."""
