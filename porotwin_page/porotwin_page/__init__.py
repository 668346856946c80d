"""The web page that a person watches and operates beside the rig.

- From the graph: `page_node` converts messages; `graph_snapshot` holds the newest of them, and
  `snapshot_store` shares a snapshot between threads.
- To the browser: `server` serves the files of `web_files` and the events of `event`, with the
  parts `header`, `health`, `curve_history` and the panels.
- Panels: one module each in `panels`, found by `panel_registry`; `panel` holds their kinds and
  `map_pictures` paints maps. docs/extend/panel.md adds one.
- From the browser: `confirmation` checks the operator's answer.
"""
