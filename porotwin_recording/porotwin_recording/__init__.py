"""Experiments on disk: the folder a lab keeps, MCAP bags, and the way between them.

`recording.open_recording` reads either. `experiment` holds the folder (`rates`, `concentration`,
`photos`), `bag_writer` and `bag_reader` the bag, `bag_recording` the experiment in a bag, `convert`
turns one into the other. `recorder_node` and `player_node` connect bags to a running graph.
"""
