"""Experiments on disk: the experiment folder of a laboratory, and MCAP bags.

`recording.open_recording` is the front door: it reads a folder as well as a bag.

- Experiment folder: `experiment_folder`, with one module for each file in it (`rates`,
  `concentration`, `photos`; `csv_table` for their common form).
- Bag, as a file: `bag_reader` (`bag_folder`, `mcap_reader`, `mcap_index` below it) and `bag_writer`
  (`mcap_writer` below it), `bag_records`, `definitions` and `serialization` of the messages.
- Bag, as an experiment: `bag` finds the experiment in the messages, `segments` tells several in one
  bag apart, `joined_bags` refuses bags in one folder that are no single recording, `topic_names`
  names its topics, `bag_conversion` turns a folder into a bag and back.
- Running graph: `recorder` and `recorder_node` write a bag, `player` and `player_node` play one
  when the graph is ready (`replay_readiness`).

docs/formats.md describes all files.
"""
