"""The panels of the page, one module each; see `porotwin_page.panel`."""
