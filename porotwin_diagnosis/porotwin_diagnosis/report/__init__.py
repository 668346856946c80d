"""A diagnosis as a page, as pictures, and as files for programs."""
