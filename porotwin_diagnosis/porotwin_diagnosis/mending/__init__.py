"""The running twin gets better: diagnoses in time, offers, and their taking back."""
