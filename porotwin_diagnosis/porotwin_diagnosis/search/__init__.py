"""The search for effects, alone or in pairs, that explain a recording."""
