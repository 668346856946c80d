"""Digital siblings: an ensemble of twins that disagree as far as the photographs allow."""
