"""What knows nothing of photographs: robust statistics, sums over cells, bands."""
