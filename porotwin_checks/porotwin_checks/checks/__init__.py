"""The checks, one file each; `porotwin_checks.all_checks` finds them."""
