"""What a network learns from: frames, data sets, their scaling and their files."""
