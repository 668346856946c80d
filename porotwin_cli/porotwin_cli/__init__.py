"""The porotwin command: demo, up, simulate, image, train, record, replay, bench and test.

Every command is a module of its own, named after it; it parses, calls the packages, and prints.
"""
