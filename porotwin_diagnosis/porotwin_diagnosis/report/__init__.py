"""The verdict as a page, pictures and files."""
