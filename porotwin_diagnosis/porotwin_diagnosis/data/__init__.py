"""What a recording says, with its noise, ready for comparison."""
