"""The closed loop under several controllers, and with hidden effects that it finds."""
