"""The hub of the twin: predicts, corrects, optimises the control wells and publishes setpoints."""
