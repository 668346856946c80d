"""Photographs with known truth, composed on real sand, and the score of maps made of them."""
