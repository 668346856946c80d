"""Problems that the field knows, with their solutions: rigs/verification, docs/verification.md."""
