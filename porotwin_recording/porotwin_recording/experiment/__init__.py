"""A folder or a bag as one recording; cuts, conversion, the catalogue."""
