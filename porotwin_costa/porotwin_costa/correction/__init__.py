"""The corrective source term of a trained model, and the gates that allow it."""
