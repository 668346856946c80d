"""Commands of a checkout, as `porotwin_cli.commands` explains."""
