"""Grids of cells, polygons, shapes of zones, and the orientation of pictures."""
