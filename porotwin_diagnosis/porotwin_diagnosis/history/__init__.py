"""Several recordings of one rig together: earlier findings, beliefs and drifts."""
