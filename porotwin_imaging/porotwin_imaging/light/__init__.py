"""The light of a photograph compared with the baseline, by chart and by sand."""
