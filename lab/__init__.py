"""The laboratory of a checkout: benches, blinded checks, long tests, the experiments of the paper.

It is not installed. It may import every package, and no package imports it: `porotwin_cli` only
finds its commands.
"""
