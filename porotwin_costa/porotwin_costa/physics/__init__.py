"""Physics that COSTA learns before its network learns the remainder."""
