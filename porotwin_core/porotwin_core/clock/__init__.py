"""Times: units, stamps of messages, the age and the interval of photographs."""
