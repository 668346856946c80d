"""What models exchange: effect parameters, corrections, cost terms, state estimates."""
