"""What several recordings of one rig tell together: earlier findings, beliefs and drifts."""
