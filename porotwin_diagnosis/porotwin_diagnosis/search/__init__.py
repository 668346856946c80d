"""Which effects, alone or in pairs, explain a recording."""
