"""The person at the pumps: setpoints in force, announcements, confirmations."""
