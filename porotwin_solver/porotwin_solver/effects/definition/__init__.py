"""What an effect consists of: physics or observation, search, words, blind draw; the registry."""
