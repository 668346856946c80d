"""The checks of a description: one question, one file, found because it lies here."""
