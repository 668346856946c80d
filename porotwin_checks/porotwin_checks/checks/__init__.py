"""The checks, one file each; `porotwin_checks.remarks` finds them."""
