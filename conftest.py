"""How property tests run: the same examples every time, and none fails for being slow."""

from hypothesis import settings

settings.register_profile('porotwin', deadline=None, derandomize=True)
settings.load_profile('porotwin')
