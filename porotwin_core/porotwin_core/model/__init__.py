"""Data that models exchange: effect parameters, corrections, cost terms, state estimates."""
