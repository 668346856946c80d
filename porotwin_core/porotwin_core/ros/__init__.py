"""The shell of ROS: nodes, their health, senders, messages to numpy and back."""
