"""All nodes of the graph, their parameters and processes."""
